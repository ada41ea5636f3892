"""The check of a folder: its views are read, and compared by all evidence that there is."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenegen.checking.evidence import Pair, color_error, depth_error, normal_error, track_error
from scenegen.checking.faults import (
    Error,
    Fault,
    Guesses,
    explained,
    of_geometry,
    of_images,
    of_normals,
)
from scenegen.checking.layouts import Scenes, reading, scenes_of
from scenegen.checking.views import View
from scenegen.common.errors import SpecError
from scenegen.files.verify import Check

MOST_VIEWS = 24  # that are read, of scenes spread over the folder


class Evidence(NamedTuple):
    """What is compared.

    Attributes:
        name, told: as the report has it, and how it tells a disagreement.
        error: the disagreement of views; NaN where they have nothing to compare.
        guesses: the mistakes that may explain it.
        least: disagreement that rounding explains.
        enough: disagreement that fails, whatever explains it.
    """

    name: str
    told: str
    error: Error
    guesses: Guesses
    least: float
    enough: float


@dataclass(frozen=True)
class Report:
    """What a check found.

    Attributes:
        layout: one of `layouts.LAYOUTS`.
        views: number of views that were read.
        faults: the mistakes that were found.
        checks: a line for each kind of evidence.
    """

    layout: str
    views: int
    faults: list[Fault]
    checks: list[Check]


def check_folder(folder: Path) -> Report:
    """Cross-check depth, cameras, normals and images of a folder.

    Raises FileFormatError as `layouts.scenes_of`, SpecError where nothing can be compared; OSError.
    """
    with reading(folder):
        layout, scenes = scenes_of(folder)
        views, pairs = _chosen(scenes)
        faults, checks = check_views(views, pairs, str(folder))
    return Report(layout, len(views), faults, checks)


def _chosen(scenes: Scenes) -> tuple[list[View], list[Pair]]:
    """Read neighbouring views of scenes spread over a folder; return them, and pairs of them."""
    each = 2 if len(scenes) > 1 else MOST_VIEWS
    count = min(len(scenes), MOST_VIEWS // 2)
    views: list[View] = []
    pairs: list[Pair] = []
    for place in np.linspace(0, len(scenes) - 1, count).astype(int).tolist():
        loads = scenes[place][:each]
        first = len(views)
        views += [load() for load in loads]
        for i in range(first, len(views) - 1):
            pairs += [(i, i + 1), (i + 1, i)]
    return views, pairs


def check_views(
    views: Sequence[View], pairs: Sequence[Pair], where: str = "views"
) -> tuple[list[Fault], list[Check]]:
    """Cross-check views, of which pairs show the same scene. Raises SpecError as `check_folder`."""
    faults: list[Fault] = []
    checks: list[Check] = []
    for kind in _evidence(views, pairs):
        found, views = explained(views, kind.error, kind.guesses, kind.least)
        rest, told = kind.error(views), kind.told.format
        if not np.isfinite(rest) and checks:
            continue
        texts = [f"{f.text} ({told(f.before)}; undone, {told(f.after)})" for f in found]
        if rest > kind.enough:
            texts.append(f"{told(rest)}: no known fault, or views that hardly overlap")
        checks.append(Check(kind.name, not texts, "; ".join(texts) or told(rest)))
        faults += found
    if not checks:
        none = "neither two posed views of a scene with depth, nor normals, nor observed points"
        raise SpecError(where, none, "something to compare")
    return faults, checks


def _evidence(views: Sequence[View], pairs: Sequence[Pair]) -> list[Evidence]:
    """Return what can be compared in views; mistakes that an item finds are undone for the next."""
    posed = [
        v.depth is not None and np.isfinite(v.depth).any() and v.world_from_camera is not None
        for v in views
    ]
    pairs = [(i, j) for i, j in pairs if posed[i] and posed[j]]
    normals = Evidence(
        "normals and depth", "{:.1f} degrees apart", normal_error, of_normals, 0.5, 8
    )
    if pairs:
        depth = partial(depth_error, pairs=pairs)
        colors = partial(color_error, pairs=pairs)  # may always differ, as surfaces shine
        told = "1 - correlation of brightness is {:.2f}"
        return [
            Evidence("depth of other views", "differs by {:.3%}", depth, of_geometry, 0.0, 0.01),
            normals,
            Evidence("images of other views", told, colors, of_images, 0.0, np.inf),
        ]
    if all(view.points is not None for view in views):
        told = "off by {:.2f} pixels"
        return [Evidence("observed points", told, track_error, of_geometry, 0.05, 1.0)]
    if not np.isfinite(normal_error(views)):
        return []

    def all_of(views: Sequence[View], error: Error) -> chain[Fault]:
        return chain(of_normals(views, error), of_geometry(views, error))

    return [normals._replace(guesses=all_of)]

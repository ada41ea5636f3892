"""The check of a folder: its views are read, and compared by all evidence that there is."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenegen.checking.evidence import Pair, depth_error, normal_error, track_error
from scenegen.checking.faults import Fault, geometry_faults, image_faults, normal_faults
from scenegen.checking.layouts import Scenes, reading, scenes_of
from scenegen.checking.views import View
from scenegen.common.errors import SpecError
from scenegen.files.verify import Check

MOST_VIEWS = 24  # that are read, of scenes spread over the folder


class _Kind(NamedTuple):
    """A kind of evidence.

    Attributes:
        name, told: as the report has it, and how it tells a disagreement.
        least: disagreement that rounding explains.
        enough: disagreement that fails, whatever explains it.
    """

    name: str
    told: str
    least: float
    enough: float


DEPTH = _Kind("depth of other views", "differs by {:.3%}", 0.0, 0.01)
TRACKS = _Kind("observed points", "off by {:.2f} pixels", 0.05, 1.0)
NORMALS = _Kind("normals and depth", "{:.1f} degrees apart", 0.5, 8.0)
# Images may always differ, as surfaces shine.
IMAGES = _Kind("images of other views", "1 - correlation of brightness is {:.2f}", 0.0, np.inf)


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
    posed = [
        v.depth is not None and np.isfinite(v.depth).any() and v.world_from_camera is not None
        for v in views
    ]
    pairs = [(i, j) for i, j in pairs if posed[i] and posed[j]]
    has_normals = bool(np.isfinite(normal_error(views)))
    faults: list[Fault] = []
    if pairs:
        kind, error = DEPTH, partial(depth_error, pairs=pairs)
    elif all(view.points is not None for view in views):
        kind, error = TRACKS, partial(track_error)
    elif has_normals:
        kind, error = NORMALS, partial(normal_error)
        faults, rest = normal_faults(views)
    else:
        found = "neither two posed views of a scene with depth, nor normals, nor observed points"
        raise SpecError(where, found, "something to compare")
    if not faults:
        faults, views = geometry_faults(views, error, kind.least)
        rest = error(views)
    checks = [_check(kind, faults, rest)]
    if pairs and has_normals:
        wrong, rest = normal_faults(views)
        faults, checks = [*faults, *wrong], [*checks, _check(NORMALS, wrong, rest)]
    if pairs:
        wrong, rest = image_faults(views, pairs)
        if np.isfinite(rest):
            faults, checks = [*faults, *wrong], [*checks, _check(IMAGES, wrong, rest)]
    return faults, checks


def _check(kind: _Kind, faults: Sequence[Fault], rest: float) -> Check:
    """Return the outcome of a kind of evidence; `rest` is the disagreement that remains."""
    told = kind.told.format
    texts = [f"{f.text} ({told(f.before)}; undone, {told(f.after)})" for f in faults]
    if rest > kind.enough:
        texts.append(f"{told(rest)}: no known fault, or views that hardly overlap")
    return Check(kind.name, not texts, "; ".join(texts) or told(rest))

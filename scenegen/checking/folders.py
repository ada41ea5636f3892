"""The check of a folder: its views are read, and compared by all evidence that there is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenegen.checking.evidence import Pair, depth_error, normal_error, track_error
from scenegen.checking.faults import Fault, geometry_faults, image_faults, normal_faults
from scenegen.checking.layouts import Scenes, reading, scenes_of
from scenegen.checking.views import View
from scenegen.common.errors import SpecError
from scenegen.files.verify import Check

MOST_VIEWS = 24  # that are read, of scenes spread over the folder
# Disagreement that needs no explanation: relative depth, pixels, degrees. Images may always
# differ, as surfaces shine.
DEPTH_AGREES, TRACKS_AGREE, NORMALS_AGREE = 0.01, 1.0, 8.0


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
    checks: list[Check] = []

    def note(name: str, form: Callable[[float], str], found: list[Fault], rest: float,
             enough: float) -> None:  # fmt: skip
        if not np.isfinite(rest) and not found:
            return
        text = "; ".join(f"{f.text}: {form(f.before)}, {form(f.after)} if undone" for f in found)
        unexplained = "" if rest <= enough else f"{form(rest)}, and no known fault explains it"
        detail = "; ".join(filter(None, (text, unexplained))) or form(rest)
        checks.append(Check(name, not found and rest <= enough, detail))

    kinds: dict[str, tuple[Callable[[Sequence[View]], float], Callable[[float], str], float]] = {
        "depth of other views": (
            lambda some: depth_error(some, pairs), lambda e: f"differs by {e:.3%}", DEPTH_AGREES),
        "observed points": (track_error, lambda e: f"off by {e:.2f} pixels", TRACKS_AGREE),
        "normals and depth": (normal_error, lambda e: f"{e:.1f} degrees apart", NORMALS_AGREE),
    }  # fmt: skip
    has_normals = np.isfinite(normal_error(views))
    if pairs:
        name = "depth of other views"
    elif all(view.points is not None for view in views):
        name = "observed points"
    elif has_normals:
        name = "normals and depth"
    else:
        found = "neither two posed views of a scene with depth, nor normals, nor observed points"
        raise SpecError(where, found, "something to compare")
    error, form, enough = kinds[name]
    wrong, rest = normal_faults(views) if not pairs and has_normals else ([], np.nan)
    faults, mended = ([], views) if wrong else geometry_faults(views, error)
    faults = [*wrong, *faults]
    note(name, form, faults, rest if wrong else error(mended), enough)
    if has_normals and pairs:
        wrong, rest = normal_faults(mended)
        name = "normals and depth"
        note(name, kinds[name][1], wrong, rest, NORMALS_AGREE)
        faults = [*faults, *wrong]
    if pairs:
        wrong, rest = image_faults(mended, pairs)
        note("images of other views", lambda e: f"brightness correlates by {1 - e:.2f}",
             wrong, rest, np.inf)  # fmt: skip
        faults = [*faults, *wrong]
    return faults, checks

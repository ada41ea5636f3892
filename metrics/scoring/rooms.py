"""Scores of submissions that predict rooms, from the scores of their rows."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.scoring.geometry import scored_alignment
from metrics.scoring.metric_names import OBJECT_SCORES
from metrics.scoring.records import OBJECT_COLUMNS, SHAPE_COLUMN, ScoreFile
from metrics.scoring.rows import score_rows
from metrics.scoring.runs import (
    Progress,
    RoomRuns,
    ScoringError,
    Settings,
    matched_rows,
    meta_of,
    refuse_copies,
)
from metrics.scoring.truth_digests import images_digest
from metrics.submissions.reader import RoomPredictions
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
IDS_SHOWN = 8


def score_rooms(
    runs: RoomRuns,
    settings: Settings,
    progress: Progress,
) -> ScoreFile:
    """Score runs of one method on an open rooms file; raises as `evaluate.score`."""
    files, truth = runs.files, runs.truth
    rows = matched_rows(runs, settings.allow_partial)
    require_one_kind(files)
    scored = score_rows(files, truth, rows, settings, progress)
    scores, bad = scored.scores, scored.bad
    require_scored(bad, settings)

    def alike(i: int, j: int) -> bool:
        return all(np.array_equal(x[i], x[j], equal_nan=True) for x in scores.values())

    refuse_copies(files, alike)
    digest = images_digest(truth, scored.digests)
    scene = truth.read("scene_index", slice(None))
    view = truth.read("view_index", slice(None))
    angle = view_angles(scene, view, truth.read("camera/world_from_camera", slice(None)))[rows]
    shape = object_shapes(truth, scored.objects["row"], scored.objects["object"])
    counts = {
        "rows_in_truth": len(truth),
        "rows_penalised": len(bad),
        "pixels": truth.spec.height * truth.spec.width,
    }
    items = {
        "row": rows,
        "scene_index": scene[rows],
        "view_index": view[rows],
        "view_angle_degrees": angle,
        **scores,
        **scored.floors,
    }
    objects = {name: scored.objects[name] for name in (*OBJECT_COLUMNS, *OBJECT_SCORES)}
    meta = meta_of(runs, truth.fingerprint, digest, settings, counts)
    alignment = scored_alignment(files[0].kind, files[0].fitted)
    objects[SHAPE_COLUMN] = shape
    more: dict[str, Any] = {"shown": files[0].shown}
    more |= {"length": "metre"} if truth.spec.interior else {}
    return ScoreFile("rooms", files[0].method, alignment, items, meta, objects, **more)


def require_one_kind(files: Sequence[RoomPredictions]) -> None:
    """Raise ScoringError unless all submissions are alike in kind and columns."""
    for file in files:
        if file.kind != files[0].kind:
            expected = f"{files[0].kind} as in {files[0].path}"
            raise ScoringError(f"{file.path}: {file.kind}", file.kind, expected)
        if file.has_normals != files[0].has_normals:
            found, expected = ("normals", "none") if file.has_normals else ("none", "normals")
            raise ScoringError(f"{file.path}: normal", found, f"{expected} as in {files[0].path}")
        if file.has_confidence != files[0].has_confidence:
            found, expected = ("one", "none") if file.has_confidence else ("none", "one")
            expected = f"{expected} as in {files[0].path}"
            raise ScoringError(f"{file.path}: confidence", found, expected)


def require_scored(bad: Mapping[int, ScoringError], settings: Settings) -> None:
    """Raise the first error of rows that cannot be scored, unless they are to be penalised."""
    if bad and settings.non_finite == "error":
        first = next(iter(bad.values()))
        shown = ", ".join(map(str, list(bad)[:IDS_SHOWN])) + ", ..." * (len(bad) > IDS_SHOWN)
        listed = f"rows that cannot be scored, {len(bad)} in all: {shown}"
        advice = "mend them, or score them at the worst with --non-finite penalise"
        raise ScoringError(first.where, first.found, first.expected, f"{listed}; {advice}")


def view_angles(scene_index: Array, view_index: Array, world_from_camera: Array) -> Array:
    """Return by how much each view is turned from its scene's first one, (N,) whole degrees.

    The camera turns about the world's +y, counter-clockwise as seen from above: from -179 to 180.
    NaN where the scene's first view is not in the file. `scene_index` and `view_index` are (N,),
    `world_from_camera` is (N, 4, 4).
    """
    back = world_from_camera[:, :3, 2]
    azimuth = np.degrees(np.arctan2(back[:, 0], back[:, 2]))
    first = {int(scene_index[i]): azimuth[i] for i in np.flatnonzero(view_index == 0)}
    from_first = np.array([first.get(int(scene), np.nan) for scene in scene_index])
    return np.asarray(180.0 - (180.0 - np.rint(azimuth - from_first)) % 360.0)


def object_shapes(truth: RoomsFile, row: Array, object_id: Array) -> Array:
    """Return the shape or class of objects, texts (M,), by their rows and ids, (M,) each.

    Raises FileFormatError where an object that is seen has none.
    """
    shape, names = truth.read("object/shape", slice(None)), truth.spec.shapes
    shapes = []
    for i, k in zip(row.tolist(), object_id.tolist(), strict=True):
        index = int(shape[i, k - 1]) if k <= shape.shape[1] else -1
        if not 0 <= index < len(names):
            where = f"{truth.path}: object/shape, row {i}"
            raise FileFormatError(where, f"no shape of object {k}, which is seen", "its shape")
        shapes.append(names[index])
    return np.array(shapes, object)

"""Score files of submissions that predict images: rooms, or those whose truth was measured."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.protocols import BY_NAME, DECLARED, PROTOCOLS, ProtocolError
from metrics.scoring.images.geometry import scored_alignment
from metrics.scoring.images.measured_rows import PIXELS, require_suited, suits
from metrics.scoring.images.rows import ScoredRows, score_rows
from metrics.scoring.metric_names import OBJECT_SCORES, OF_TRUTH, metric
from metrics.scoring.records import OBJECT_COLUMNS, SHAPE_COLUMN, ScoreFile
from metrics.scoring.runs import (
    MeasuredRuns,
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
from scenegen.common.names import check_choice
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
IDS_SHOWN = 8


def score_rooms(runs: RoomRuns, settings: Settings, progress: Progress) -> ScoreFile:
    """Score runs of one method on an open rooms file; raises as `evaluate.score`."""
    files, truth = runs.files, runs.truth
    rows, scored, digest = _scored(runs, settings, progress)
    scene = truth.read("scene_index", slice(None))
    view = truth.read("view_index", slice(None))
    angle = view_angles(scene, view, truth.read("camera/world_from_camera", slice(None)))[rows]
    counts = {
        "rows_in_truth": len(truth),
        "rows_penalised": len(scored.bad),
        "pixels": truth.spec.height * truth.spec.width,
    }
    items = {
        "row": rows,
        "scene_index": scene[rows],
        "view_index": view[rows],
        "view_angle_degrees": angle,
        **scored.scores,
        **scored.floors,
    }
    objects = {name: scored.objects[name] for name in (*OBJECT_COLUMNS, *OBJECT_SCORES)}
    objects[SHAPE_COLUMN] = object_shapes(truth, objects["row"], objects["object"])
    meta = meta_of(runs, truth.fingerprint, digest, settings, counts)
    alignment = scored_alignment(files[0].kind, files[0].fitted)
    more: dict[str, Any] = {"shown": files[0].shown}
    more |= {"length": "metre"} if truth.spec.interior else {}
    return ScoreFile("rooms", files[0].method, alignment, items, meta, objects, **more)


def score_measured(
    runs: MeasuredRuns, settings: Settings, progress: Progress, all_protocols: bool = False
) -> list[ScoreFile]:
    """Score runs on measured truth under the protocol of the settings, or under all that suit.

    Raises as `evaluate.score`, and ProtocolError where the protocol does not suit the truth, or
    what the method predicts.
    """
    file, truth = runs.files[0], runs.truth
    if all_protocols:
        protocols = [p for p in PROTOCOLS if suits(p, file.kind, file.fitted)]
    else:
        name = settings.protocol or DECLARED.name
        check_choice("protocol", name, BY_NAME, ProtocolError)
        protocols = [BY_NAME[name]]
        require_suited(protocols[0], file.kind, file.fitted)
    rows, scored, digest = _scored(runs, settings, progress, tuple(p.name for p in protocols))
    counts = {"rows_in_truth": len(truth), "rows_penalised": len(scored.bad)}
    meta = meta_of(runs, truth.fingerprint, digest, settings, counts)
    found = []
    for protocol in protocols:
        ours = {
            key.removeprefix(f"{protocol.name} "): values
            for key, values in scored.scores.items()
            if key.startswith(f"{protocol.name} ")
        }
        pixels = ours.pop(PIXELS)[0].astype(np.int64)
        if not pixels.all():  # of all protocols; one alone is refused
            continue
        # A score that some image cannot have, as it shows no normals, is none of this set.
        scores = {
            name: values
            for name, values in ours.items()
            if name.startswith(OF_TRUTH) or metric(name).lacking or not np.isnan(values).any()
        }
        items = {"row": rows, "group": truth.groups[rows], "pixels": pixels, **scores}
        alignment = protocol.alignment or scored_alignment(file.kind, file.fitted)
        found.append(
            ScoreFile("measured", file.method, alignment, items, meta, protocol=protocol.name)
        )
    return found


def _scored(
    runs: RoomRuns | MeasuredRuns,
    settings: Settings,
    progress: Progress,
    protocols: tuple[str, ...] = (),
) -> tuple[Array, ScoredRows, str]:
    """Return the rows that all runs predict, their scores, and the digest of the truth."""
    files, truth = runs.files, runs.truth
    rows = matched_rows(runs, settings.allow_partial)
    require_one_kind(files)
    scored = score_rows(files, truth, rows, settings, progress, protocols)
    require_scored(scored.bad, settings)

    def alike(i: int, j: int) -> bool:
        values = scored.scores.values()
        return all(np.array_equal(x[i], x[j], equal_nan=True) for x in values)

    refuse_copies(files, alike)
    return rows, scored, images_digest(truth, scored.digests)


def require_one_kind(files: Sequence[RoomPredictions]) -> None:
    """Raise ScoringError unless all submissions are alike in kind and columns."""
    first = files[0]
    for file in files:
        for name, held in (("kind", "kind"), ("normal", "has_normals"),
                           ("confidence", "has_confidence")):  # fmt: skip
            ours, theirs = getattr(file, held), getattr(first, held)
            if ours != theirs:
                where, said = f"{file.path}: {name}", {True: "it", False: "none"}
                expected = f"{said.get(theirs, theirs)} as in {first.path}"
                raise ScoringError(where, said.get(ours, ours), expected)


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

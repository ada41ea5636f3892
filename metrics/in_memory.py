"""Scores of predictions in memory, the same numbers as `bench score` prints.

    scores = metrics.evaluate((model.infer(image) for image in images), "rooms.h5")
    print(scores.metrics["relief_iou"].value)

Predictions are arrays or tensors of torch, or dicts as `bench run` takes them.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.intake.outputs import Frame, Geometry, OutputError, fitted_to, image_of, read_output
from metrics.measured.reader import is_flat
from metrics.measures.alignment import Alignment
from metrics.scoring.images.image_scores import NonFinite, reference_of, score_prediction
from metrics.scoring.images.panoramas import baselines_of, score_panorama
from metrics.scoring.metric_names import OTHER_SCENE
from metrics.scoring.records import ScoreFile
from metrics.scoring.rooms import score_rooms
from metrics.scoring.runs import RoomRuns, Settings
from metrics.submissions.inspection import Inspection
from metrics.submissions.layout import KINDS
from metrics.submissions.reader import PredictedView, RoomPredictions
from metrics.submissions.rules import as_doubles, refuse_behind_camera
from metrics.submissions.truths import TrueView
from scenegen.common.errors import SpecError
from scenegen.common.threads import one_thread
from scenegen.rooms.reader import Room, RoomsFile

Array = NDArray[Any]
PLACE = Path("predictions in memory")


@one_thread()
def evaluate_room(
    prediction: Any,
    truth: Room,
    *,
    kind: str = "depth",
    alignment: Alignment | None = None,
    normal: Any = None,
    frame: Frame = "opencv",
    non_finite: NonFinite = "error",
) -> dict[str, float]:
    """Return the values of all metrics for one prediction, by name, as in a score file.

    Metrics that compare with another scene need several rooms and are left out. Metrics that are
    undefined for this room are NaN. So are metrics of hidden surfaces, which need the first view of
    the scene.

    Args:
        prediction: depth or disparity (h, w), or points (h, w, 3); or a dict, as
            `intake.outputs.read_output` describes it, whose key sets kind and alignment.
        truth: a row of an open file of rooms, such as `rooms[0]`.
        kind, alignment: for an array: the prediction type, one of `layout.KINDS`, and the
            alignment that it needs.
        normal: (h, w, 3), if the prediction is an array.
        frame: of points and normals: "opencv" has x right, y down, z forward; "opengl" is ours.
        non_finite: "error", or "penalise" as `image_scores.score_view`.

    Raises OutputError for an invalid prediction, SpecError for kind or alignment, and
    PredictionError for values on surfaces that are not finite, or are behind the camera.
    """
    height, width = truth.depth.shape
    geometry = _geometry(prediction, normal, height, width, kind, alignment, frame)
    values = _stored(geometry, truth.depth, "prediction", truth.lens.is_flat)
    predicted = PredictedView(
        geometry.kind,
        geometry.alignment,
        as_doubles(values[geometry.kind]),
        as_doubles(values["normal"]) if "normal" in values else None,
        geometry.fov_y_degrees,
        as_doubles(values["confidence"]) if "confidence" in values else None,
    )
    view = TrueView(
        truth.depth,
        truth.normal,
        truth.object_id,
        truth.lens,
        truth.world_from_camera,
        truth.truth.get("room/size"),
    )
    if not view.lens.is_flat:
        return score_panorama(predicted, view, non_finite == "penalise") | baselines_of(view)
    reference = reference_of(view, row=truth.index)
    scores = score_prediction(predicted, view, reference, non_finite=non_finite).scores
    own = {name: value for name, value in scores.items() if not name.startswith(OTHER_SCENE)}
    return own | reference.floors


def evaluate(
    predictions: Iterable[Any],
    rooms: str | Path | RoomsFile,
    *,
    items: Sequence[int] | None = None,
    kind: str = "depth",
    alignment: Alignment | None = None,
    normals: Iterable[Any] | None = None,
    frame: Frame = "opencv",
    method: str = "in memory",
    settings: Settings | None = None,
) -> ScoreFile:
    """Score predictions for the rooms of a file, and return the content of a score file.

    `result.metrics["relief_iou"]` has a value and its interval; `score_file.write_scores` writes
    the result. This process does all of the work.

    Args:
        predictions: one per row, in order, each as for `evaluate_room`: an array (N, H, W), or a
            generator.
        rooms: the file, or an open one.
        items: the predicted rows; all by default. Scores of a subset are not comparable.
        kind, alignment, frame: as for `evaluate_room`.
        normals: one per prediction, (N, H, W, 3), if predictions are arrays.
        settings: None for the defaults of `bench score`.

    Raises as `evaluate_room`; OSError and FileFormatError for the file; SpecError where there are
    more or fewer predictions than rows.
    """
    chosen = settings or Settings()
    with ExitStack() as stack:
        truth = rooms if isinstance(rooms, RoomsFile) else stack.enter_context(RoomsFile(rooms))
        rows = np.arange(len(truth)) if items is None else np.array(items, np.int64)
        if (
            not len(rows)
            or len(np.unique(rows)) < len(rows)
            or not ((rows >= 0) & (rows < len(truth))).all()
        ):
            raise SpecError("items", f"{list(rows[:8])}", f"rows of {truth.path}, each once")
        content = _content(
            predictions, normals, rows, truth, kind=kind, alignment=alignment, frame=frame
        )
        content.texts |= {"method": method, "truth_fingerprint": truth.fingerprint}
        run = replace(
            chosen,
            processes=1,
            cluster=None,
            allow_partial=chosen.allow_partial or items is not None,
        )
        return score_rooms(RoomRuns([_InMemory(content)], truth, True), run, lambda done: None)


class _InMemory(RoomPredictions):
    """Predictions that lie in no file."""

    def __init__(self, content: Inspection) -> None:
        """Take arrays of usable rows."""
        super().__init__(PLACE, content, None, identity=(0, 0, 0, 0))

    @property
    def sha256(self) -> str:
        """SHA-256 of the rows and the values, as hex."""
        digest = hashlib.sha256()
        for array in (self.rows, *self._arrays.values()):
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()


def _content(
    predictions: Iterable[Any],
    normals: Iterable[Any] | None,
    rows: Array,
    truth: RoomsFile,
    **how: Any,
) -> Inspection:
    """Return predictions as an opened file has them."""
    height, width = truth.spec.height, truth.spec.width
    arrays: dict[str, list[Array]] = {}
    first: Geometry | None = None
    given = iter(predictions)
    given_normals = None if normals is None else iter(normals)
    for row in rows.tolist():
        try:
            prediction = next(given)
            normal = None if given_normals is None else next(given_normals)
        except StopIteration:
            found = f"{len(arrays.get(first.kind, ())) if first else 0}"
            raise SpecError("predictions", found, f"{len(rows)}, one for each row") from None
        try:
            geometry = _geometry(prediction, normal, height, width, **how)
        except OutputError as error:
            raise error.inside(f"row {row}") from error
        values = _stored(geometry, truth.read("depth", row), f"row {row}", is_flat(truth))
        first = first or geometry
        if (geometry.kind, geometry.alignment) != (first.kind, first.alignment) or (
            arrays and values.keys() != arrays.keys()
        ):
            found = f"{', '.join(values)} under {geometry.alignment}"
            raise OutputError(f"row {row}", found, "the same as in the first row")
        for name, value in values.items():
            arrays.setdefault(name, []).append(value)
    if next(given, None) is not None:
        raise SpecError("predictions", f"more than {len(rows)}", "one for each row")
    assert first is not None, "there is a row"
    stacked = {name: np.stack(values) for name, values in arrays.items()}
    return Inspection("rooms", {"alignment": first.alignment}, stacked, rows)


def _geometry(
    prediction: Any,
    normal: Any,
    height: int,
    width: int,
    kind: str,
    alignment: Alignment | None,
    frame: Frame,
) -> Geometry:
    if isinstance(prediction, Mapping):
        return read_output(prediction, height, width, frame=frame)
    if kind not in KINDS or kind == "layers":
        raise SpecError("kind", repr(kind), "depth, disparity or points")
    alignment = alignment or KINDS[kind][0]  # type: ignore[assignment]
    if alignment not in KINDS[kind]:
        raise SpecError("alignment", repr(alignment), f"{' or '.join(KINDS[kind])}, for {kind}")
    image = image_of(prediction, kind, vectors=kind == "points")
    normal = None if normal is None else image_of(normal, "normal", vectors=True)
    geometry = Geometry(kind, alignment, image, normal)
    return fitted_to(geometry, height, width, frame=frame, missing="refuse")


def _stored(geometry: Geometry, true_depth: Array, where: str, flat: bool) -> dict[str, Array]:
    """Return the values in the precision of a submission. Raises PredictionError as its writer."""
    with np.errstate(over="ignore"):
        values = {
            name: np.asarray(value, np.float64 if name == "fov_y_degrees" else np.float32)
            for name, value in geometry.values.items()
        }
    kind, alignment = geometry.kind, geometry.alignment
    if flat or kind != "points":
        refuse_behind_camera(where, kind, alignment, values[kind], np.isfinite(true_depth))
    return values

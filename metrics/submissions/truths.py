"""The truth of a submission: where it lies, whether the submission answers it, and its views.

What is wrong with a truth is an error: left alone, it would change which pixels are scored.
"""

import os
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.measured.reader import Images, MeasuredFile, open_images, padded_size
from metrics.submissions.layout import ID_NAMES
from metrics.submissions.problems import Problem, first_ids
from metrics.submissions.reader import Predictions, QuestionPredictions, RoomPredictions
from metrics.submissions.rules import Against, as_doubles, value_problems
from scenegen.camera import Lens
from scenegen.common.errors import FileFormatError
from scenegen.files import trial
from scenegen.files.rows import RowFile
from scenegen.files.sets.shards import OpenFile
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.withheld import truth_beside, truth_path

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile, QuestionsFile

Array = NDArray[Any]
UNIT_TOLERANCE = 1e-3  # by which the squared length of a normal may differ from 1
RIGID_TOLERANCE = 1e-6  # by which R^T R may differ from the identity, R being a camera's rotation


@dataclass(frozen=True)
class FoundTruth:
    """Where a truth lies, and who chose it: the person who scores, or the submission."""

    path: Path
    source: Literal["given", "submission"]


@dataclass(frozen=True, eq=False)
class TrueView:
    """The true depth, normals and objects of one image, as stored.

    Attributes:
        depth: planar depth, (H, W), scene units, in panoramas the distance; the pixels where it is
            finite are scored.
        normal: (H, W, 3), camera frame, unit, facing the viewer.
        object_id: (H, W).
        lens: of the camera.
        world_from_camera: (4, 4), rigid.
        room_size: of a closed room, (3,); None for the paper's room.
    """

    depth: Array
    normal: Array
    object_id: Array
    lens: Lens
    world_from_camera: Array
    room_size: Array | None = None

    @property
    def mask(self) -> Array:
        """The scored pixels, (H, W) bool."""
        return np.isfinite(self.depth)


def open_data(
    data: "str | Path | Images | QuestionsFile",
) -> "AbstractContextManager[Images | QuestionsFile]":
    """Open a file that models predict: rooms, measured truth or questions. An open one stays open.

    Raises as the readers of these files.
    """
    from iqtt.files.reader import QuestionsFile, holds_questions

    if isinstance(data, RowFile):
        return nullcontext(data)
    opened = OpenFile(data, "file of rooms or questions")
    return QuestionsFile(opened) if holds_questions(opened) else open_images(opened)


def find_truth(predictions: Predictions, named: str | Path | None = None) -> FoundTruth:
    """Return where the truth of a submission lies.

    That is `named`, or else the path recorded in the submission, taken from the submission's folder
    and then from the working directory; a file of a stranger's choice is tried in another process.
    Only a regular file, or a link to one, is a truth. For a test file without answers it is the
    file of answers beside it (iqtt-test-answers.h5), for rooms without truth rooms-truth.h5. Where
    `named` is there, nothing that the submission names is looked at.

    Raises FileFormatError where nothing lies there, with the places that were looked at, and as
    `trial.try_file`.
    """
    advice = "give it with --truth" if named is None else ""
    if named is None and not predictions.truth_path:
        raise FileFormatError(predictions.path, "no path of a ground truth file", "a path", advice)
    recorded = Path(predictions.truth_path)
    places = [predictions.path.parent / recorded, recorded] if named is None else [Path(named)]
    for place in places:
        if not os.path.isfile(place):  # so neither a pipe nor a device is ever opened
            continue
        truth = place
        if predictions.task == "iqtt":
            from iqtt.files.reader import answers_beside

            truth = answers_beside(place) or place
        elif predictions.task == "rooms" and os.path.isfile(truth_path(place)):
            if named is None:
                trial.try_file(place)
            truth = truth_beside(place) or place
        if named is None:  # whoever made the submission may have chosen the file
            trial.try_file(truth)
        return FoundTruth(truth, "submission" if named is None else "given")
    looked = " and ".join(dict.fromkeys(str(place) for place in places))
    raise FileFormatError(
        f"{predictions.path}: truth", f"no file at {looked}", "the file that is predicted", advice
    )


def match_problems(
    predictions: Predictions, truth: "Images | AnswersFile | QuestionsFile"
) -> list[Problem]:
    """Return why a submission does not answer an open truth: another one, other sizes, rows.

    If the fingerprints differ, that is the only problem returned. For a submission without
    fingerprint (JSON, or one for the released 3D-IQTT) only the rows and sizes are compared.
    """
    fingerprint, count = predictions.truth_fingerprint, len(truth)
    if fingerprint not in (None, truth.fingerprint):
        found = f"predictions for ground truth with recipe hash {fingerprint:.12}"
        expected = f"{(truth.fingerprint or 'none'):.12}, the recipe hash of {truth.path}"
        return [Problem("truth_fingerprint", "match", expected, found)]
    problems = []
    if isinstance(truth, RoomsFile) and not truth.has_truth:
        expected = f"the file with ground truth, such as {truth_path(truth.path).name}"
        return [Problem("truth", "present", expected, f"{truth.path}, rooms without ground truth")]
    if isinstance(predictions, RoomPredictions) and isinstance(truth, Images):
        height, width = padded_size(truth)
        if (predictions.height, predictions.width) != (height, width):
            found = f"images of {predictions.height}x{predictions.width}"
            problems.append(
                Problem(predictions.kind, "shape", f"{height}x{width}, as the ground truth", found)
            )
    layered = isinstance(truth, RoomsFile) and "layers" in truth.spec.truth
    if isinstance(predictions, RoomPredictions) and predictions.kind == "layers" and not layered:
        expected = "ground truth with layers, by scenegen render --with layers"
        problems.append(Problem("layers", "match", expected, f"{truth.path}, which has none"))
    name, rows = ID_NAMES[predictions.task], predictions.rows
    problems += [
        problem
        for problem in value_problems(name, rows, rows, Against(count))
        if problem.rule == "known"
    ]
    missing = np.setdiff1d(np.arange(count), rows)
    if len(missing):
        found = f"{len(missing)} of {count} missing"
        problems.append(Problem(name, "complete", "every one", found, first_ids(missing)))
    if isinstance(predictions, QuestionPredictions) and not isinstance(truth, Images):
        problems += _answer_problems(predictions, truth.answers)
    return problems


def _answer_problems(predictions: QuestionPredictions, offered: int) -> list[Problem]:
    """Return whether a submission chooses among another number of answers than is offered."""
    if predictions.candidates not in (None, offered):
        expected = f"(M, {offered}), because each question has {offered} options"
        return [Problem("scores", "shape", expected, f"shape (M, {predictions.candidates})")]
    against = Against(answers=offered)
    return value_problems("answer", predictions.answers, predictions.rows, against)


def read_true_view(truth: RoomsFile, row: int) -> TrueView:
    """Read the truth of one row.

    Raises FileFormatError, naming file, dataset and row, where it is damaged or impossible: a depth
    that is not above 0 where an object id is stored, any depth where none is, a normal that is not
    unit where there is depth, an image without any surface, an impossible camera.
    """
    view = TrueView(
        truth.read("depth", row),
        truth.read("normal", row),
        truth.read("object_id", row),
        truth.lens(row),
        truth.read("camera/world_from_camera", row),
        truth.room_size(row),
    )
    depth, surface = view.depth, view.object_id >= 0
    normal = as_doubles(view.normal)
    not_unit = ~(np.abs(np.einsum("ijk,ijk->ij", normal, normal) - 1.0) <= UNIT_TOLERANCE)
    pixels = (
        ("depth", surface & ~((depth > 0) & np.isfinite(depth)), "above 0 where an object is seen"),
        ("depth", ~surface & ~np.isnan(depth), "NaN where no object is seen"),
        ("normal", surface & not_unit, "vectors of length 1 where an object is seen"),
    )
    for name, wrong, expected in pixels:
        if wrong.any():
            first = tuple(np.argwhere(wrong)[0].tolist())
            value = np.asarray(getattr(view, name)[first]).tolist()
            found = f"{value} at pixel {first}, one of {np.count_nonzero(wrong)}"
            raise FileFormatError(truth.place(name, row), found, expected)
    if not surface.any():
        raise FileFormatError(truth.place("object_id", row), "no surface", "a pixel to be scored")
    if view.lens.is_flat and not 0.0 < view.lens.fov_y_degrees < 180.0:
        where = truth.place("camera/fov_y_degrees", row)
        raise FileFormatError(where, view.lens.fov_y_degrees, "between 0 and 180")
    if not _is_rigid(view.world_from_camera):
        found = "a matrix that is no rotation and shift"
        where = truth.place("camera/world_from_camera", row)
        raise FileFormatError(where, found, "a rigid transform")
    return view


def surface_of(truth: Images, row: int) -> Array:
    """Return the pixels (H, W) of a row whose depth is known. Raises FileFormatError."""
    if isinstance(truth, MeasuredFile):
        return truth.view(row).mask
    return read_true_view(truth, row).mask


def _is_rigid(matrix: Array) -> bool:
    rotation = np.clip(matrix[:3, :3], -2.0, 2.0)  # beyond which it is none, and squares overflow
    return bool(
        np.isfinite(matrix).all()
        and (matrix[3] == (0.0, 0.0, 0.0, 1.0)).all()
        and (np.abs(rotation.T @ rotation - np.eye(3)) <= RIGID_TOLERANCE).all()
        and np.linalg.det(rotation) > 0.0
    )

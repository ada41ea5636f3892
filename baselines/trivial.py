"""Trivial submissions, which any model should beat, and the oracle, which none can.

`constant` and `mean-depth` take their means from a training file and never see the test file's
truth; `empty-room` is told the test file's cameras and the room's exact walls, but no objects.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.files.reader import open_questions
from metrics.measures.relief import empty_room
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.submissions.layout import Shown
from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
ROOM_BASELINES = ("constant", "mean-depth", "empty-room", "oracle")
Progress = Callable[[int, int], Any]  # rows done since the last call, in all


def write_room_baseline(
    name: str,
    data: str | Path,
    out: str | Path,
    *,
    train: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write the submission of a baseline for a rooms file.

    - constant: one depth at every pixel, the mean of all depths of the training file.
    - mean-depth: at each pixel the mean of the training file's depths there.
    - empty-room: depth and normals of the room without objects, computed from the known camera.
    - oracle: the truth itself, which must score perfectly.

    Raises SpecError for an unknown name, and where a training file is missing, not used by the
    baseline, of another image size, or made with the test file's seed; else as `RoomsFile`.
    """
    learns = name in ("constant", "mean-depth")
    check_choice("baseline", name, ROOM_BASELINES)
    if learns and train is None:
        expected = f"rooms to learn from, as {name} predicts their mean depth"
        hint = "such as those of: scenegen render --n 1000 --seed 1 --out train.h5"
        raise SpecError("train", "none", expected, hint)
    if not learns and train is not None:
        raise SpecError("train", train, "none", f"{name} learns nothing")
    with RoomsFile(data) as rooms:
        learned = _mean_depth(rooms, train) if train is not None else np.empty(0)
        if name == "constant":
            learned = np.full_like(learned, learned.mean())
        shown: Shown = "scored_view" if name == "oracle" else "no_view"
        with RoomPredictionWriter(
            out, data, method=name, shown=shown, overwrite=overwrite
        ) as submission:
            for row in range(len(rooms)):
                if learns:
                    submission.add(row, learned)
                elif name == "oracle":
                    submission.add(row, rooms.read("depth", row), rooms.read("normal", row))
                else:
                    matrix = rooms.read("camera/world_from_camera", row)
                    fov = float(rooms.read("camera/fov_y_degrees", row))
                    size = rooms.spec.height, rooms.spec.width
                    submission.add(row, *empty_room(matrix, fov, *size, rooms.room_size(row)))
                progress(1, len(rooms))


def write_chance(data: str | Path, out: str | Path, seed: int = 0, overwrite: bool = False) -> None:
    """Write random answers to the questions of a file; each answer is equally likely."""
    with open_questions(data) as questions:
        count, offered = len(questions), questions.answers
    answers = item_rng(seed, 0, Purpose.ANSWERS).integers(offered, size=count)
    write_answers(out, data, method="chance", answer=answers, overwrite=overwrite)


def _mean_depth(rooms: RoomsFile, train: str | Path) -> Array:
    """Return the training file's mean depth at each pixel, (H, W), scene units.

    A pixel that never shows a surface gets the mean of all pixels.
    """
    with RoomsFile(train) as training:
        same_rooms = training.fingerprint == rooms.fingerprint
        if same_rooms or training.spec.seed == rooms.spec.seed:
            message = f"the test file's seed, {rooms.spec.seed}, and so its cameras and places"
            hint = "scenegen render --seed makes others"
            raise SpecError("train", message, "another seed", hint)
        sizes = [f"images of {file.spec.height}x{file.spec.width}" for file in (training, rooms)]
        if sizes[0] != sizes[1]:
            raise SpecError("train", sizes[0], f"{sizes[1]}, as in the test file")
        shape = training.spec.height, training.spec.width
        total, count = np.zeros(shape), np.zeros(shape)
        for row in range(len(training)):
            depth = training.read("depth", row)
            surface = np.isfinite(depth)
            total += np.where(surface, depth, 0.0)
            count += surface
    overall = total.sum() / max(count.sum(), 1.0)
    return np.where(count > 0, total / np.maximum(count, 1.0), overall)

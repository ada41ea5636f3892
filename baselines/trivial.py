"""Trivial submissions, which any model should beat, and the oracle, which none can.

Those of rooms have no 3D, and all but the oracle know nothing of objects but what `cut_outs` says.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines import cut_outs
from iqtt.files.reader import open_questions
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.submissions.layout import Shown
from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.threads import one_thread
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
Predict = Callable[[RoomsFile, int], tuple[Array, ...]]  # depth, perhaps normals, of a row
MEANS = ("constant", "mean-depth")
LEARNING = (*MEANS, *cut_outs.LEARNING)
ROOM_BASELINES = (*MEANS, "empty-room", "oracle", *cut_outs.WITHOUT_TRAINING, *cut_outs.LEARNING)
SHOWN: dict[str, Shown] = {
    **dict.fromkeys((*MEANS, "empty-room"), "no_view"),
    "balls": "first_view",
}
Progress = Callable[[int, int], Any]  # rows done since the last call, in all


@one_thread()
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
    - those of `cut_outs`.

    Raises SpecError for an unknown name, and where a training file is missing, not used by the
    baseline, of another image size, or made with the test file's seed; else as `RoomsFile`.
    """
    check_choice("baseline", name, ROOM_BASELINES)
    if (name in LEARNING) != (train is not None):
        expected = "rooms to learn from" if name in LEARNING else f"none, as {name} learns nothing"
        hint = "such as those of: scenegen render --n 1000 --seed 1 --out train.h5"
        raise SpecError("train", train or "none", expected, "" if train else hint)
    with RoomsFile(data) as rooms:
        predict = _untaught(name) if train is None else _learned(name, rooms, train)
        how: dict[str, Any] = {"shown": SHOWN.get(name, "scored_view"), "overwrite": overwrite}
        with RoomPredictionWriter(out, data, method=name, **how) as submission:
            for row in range(len(rooms)):
                submission.add(row, *predict(rooms, row))
                progress(1, len(rooms))


def write_chance(data: str | Path, out: str | Path, seed: int = 0, overwrite: bool = False) -> None:
    """Write random answers to the questions of a file; each answer is equally likely."""
    with open_questions(data) as questions:
        count, offered = len(questions), questions.answers
    answers = item_rng(seed, 0, Purpose.ANSWERS).integers(offered, size=count)
    write_answers(out, data, method="chance", answer=answers, overwrite=overwrite)


def _untaught(name: str) -> Predict:
    if name == "oracle":
        return lambda rooms, row: (rooms.read("depth", row), rooms.read("normal", row))
    if name == "empty-room":
        return cut_outs.empty
    depth_of = cut_outs.WITHOUT_TRAINING[name]
    return lambda rooms, row: (depth_of(rooms, row),)


def _learned(name: str, rooms: RoomsFile, train: str | Path) -> Predict:
    """Return what a baseline of LEARNING predicts after it has seen training rooms."""
    with RoomsFile(train) as training:
        if training.fingerprint == rooms.fingerprint or training.spec.seed == rooms.spec.seed:
            message = f"the test file's seed, {rooms.spec.seed}, and so its cameras and places"
            hint = "scenegen render --seed makes others"
            raise SpecError("train", message, "another seed", hint)
        sizes = [f"images of {file.spec.height}x{file.spec.width}" for file in (training, rooms)]
        if sizes[0] != sizes[1] and name in (*MEANS, "nearest"):
            raise SpecError("train", sizes[0], f"{sizes[1]}, as in the test file")
        if name in MEANS:
            mean = _mean_depth(training)
            mean = np.full_like(mean, mean.mean()) if name == "constant" else mean
            return lambda rooms, row: (mean,)
        depth_of = cut_outs.learned(name, training)
    return lambda rooms, row: (depth_of(rooms, row),)


def _mean_depth(training: RoomsFile) -> Array:
    """Return the mean depth at each pixel, (H, W), scene units.

    A pixel that never shows a surface gets the mean of all pixels.
    """
    shape = training.spec.height, training.spec.width
    total, count = np.zeros(shape), np.zeros(shape)
    for row in range(len(training)):
        depth = training.read("depth", row)
        surface = np.isfinite(depth)
        total += np.where(surface, depth, 0.0)
        count += surface
    overall = total.sum() / max(count.sum(), 1.0)
    return np.where(count > 0, total / np.maximum(count, 1.0), overall)

"""Submissions that any model has to beat, and the one that none can: no learning, few lines.

`constant` and `mean_depth` learn from a training file and never see the test file's truth.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.files.reader import open_questions
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from scenegen.camera import pixel_directions
from scenegen.common.errors import SpecError
from scenegen.common.seeding import Purpose, item_rng
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
ROOM_BASELINES = ("constant", "mean-depth", "empty-room", "oracle")
QUESTION_BASELINES = ("chance",)
Progress = Callable[[int], Any]


def write_room_baseline(
    name: str,
    data: str | Path,
    out: str | Path,
    *,
    train: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = lambda done: None,
) -> None:
    """Write the submission of a baseline for a rooms file.

    - constant: the mean of all depths of the training file, at every pixel.
    - mean-depth: the training file's mean depth of each pixel.
    - empty-room: depth and normals of the room without objects, from the known camera.
    - oracle: the truth itself, which must score perfectly.

    Raises SpecError for an unknown name, and where a training file is missing, not wanted, of
    another image size, or the test file itself.
    """
    learns = name in ("constant", "mean-depth")
    if name not in ROOM_BASELINES:
        raise SpecError(f"baseline: found {name!r}, expected one of {', '.join(ROOM_BASELINES)}")
    if learns and train is None:
        raise SpecError(f"train: {name} learns its means from a training file; name one")
    if not learns and train is not None:
        raise SpecError(f"train: {name} learns nothing; leave the training file out")
    with RoomsFile(data) as rooms:
        learned = _mean_depth(rooms, train) if train is not None else np.empty(0)
        if name == "constant":
            learned = np.full_like(learned, learned.mean())
        with RoomPredictionWriter(out, data, method=name, overwrite=overwrite) as submission:
            for row in range(len(rooms)):
                if learns:
                    submission.add(row, learned)
                elif name == "oracle":
                    submission.add(row, rooms.read("depth", row), rooms.read("normal", row))
                else:
                    submission.add(row, *empty_room(rooms, row))
                progress(1)


def write_chance(data: str | Path, out: str | Path, seed: int = 0, overwrite: bool = False) -> None:
    """Write answers to the questions of a file, drawn by chance."""
    with open_questions(data) as questions:
        count = len(questions)
    answers = item_rng(seed, 0, Purpose.ANSWERS).integers(3, size=count)
    write_answers(out, data, method="chance", answer=answers, overwrite=overwrite)


def empty_room(rooms: RoomsFile, row: int) -> tuple[Array, Array]:
    """Return planar depth, (H, W), and normals, (H, W, 3), of the room's three planes.

    They go on beyond the room's edges, so that there is a depth wherever an object may be.
    """
    world_from_camera = rooms.read("camera/world_from_camera", row)
    size = rooms.spec.height, rooms.spec.width
    rays = pixel_directions(*size, float(rooms.read("camera/fov_y_degrees", row)))
    directions, origin = rays @ world_from_camera[:3, :3].T, world_from_camera[:3, 3]
    with np.errstate(divide="ignore"):
        reach = np.where(directions < 0, -origin / directions, np.inf)
    depth = reach.min(axis=-1)
    depth = np.where(np.isfinite(depth), depth, depth[np.isfinite(depth)].max(initial=1.0))
    return depth, np.eye(3)[reach.argmin(axis=-1)] @ world_from_camera[:3, :3]


def _mean_depth(rooms: RoomsFile, train: str | Path) -> Array:
    """Return the training file's mean depth of each pixel, (H, W); of all where none is known."""
    with RoomsFile(train) as training:
        if training.fingerprint == rooms.fingerprint:
            raise SpecError(f"train: {train} holds the test file's own rooms; render others")
        if training.spec.seed == rooms.spec.seed:
            raise SpecError(
                f"train: {train} has the test file's seed, {rooms.spec.seed}: its cameras and"
                f" places are the same, whatever the preset; render with another --seed"
            )
        sizes = [(one.spec.height, one.spec.width) for one in (training, rooms)]
        if sizes[0] != sizes[1]:
            raise SpecError(f"train: found images of {sizes[0]}, the test file's are {sizes[1]}")
        total, count = np.zeros(sizes[0]), np.zeros(sizes[0])
        for depth in _depths(training):
            known = np.isfinite(depth)
            total += np.where(known, depth, 0.0)
            count += known
    overall = total.sum() / max(count.sum(), 1.0)
    return np.where(count > 0, total / np.maximum(count, 1.0), overall)


def _depths(rooms: RoomsFile) -> Iterator[Array]:
    return (rooms.read("depth", row) for row in range(len(rooms)))

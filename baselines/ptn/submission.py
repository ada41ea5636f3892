"""`write_submission`: depth and normals of rooms, or answers to questions.

A room's volume comes from one image, and every view of the room is drawn from it: an object is
where the occupancy along a pixel's ray first exceeds a half; elsewhere the empty room shows, which
the method is told, as its volume holds objects alone.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from baselines.checkpoints import load_weights
from baselines.pix2shape.data.rooms import channels_first, check_reducible, is_question_file
from baselines.ptn.card import RECIPE, Card
from baselines.ptn.matching import features
from baselines.ptn.network import Ptn
from baselines.ptn.projection import first_hit, outward
from baselines.ptn.rooms import SWAPPED, RoomImages
from iqtt.files.reader import QuestionsFile, open_questions, parts
from metrics.measures.empty_room import empty_room
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
FILES = Path(__file__).with_name("files")
SAMPLES = 96  # places along each ray, closer than in training
AT_ONCE = 16  # questions
COMPARED = {"volumes": (1.0, 0.0), "codes": (0.0, 1.0)}  # weights of `matching.FEATURES`
Progress = Callable[[int, int], Any]  # rows done since the last call, rows in all


def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    compare: str | None = None,
    run: str = "",
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write a submission for rooms or questions.

    Args:
        weights: a file that `train` wrote; by default the one of the package that suits the data.
        compare: for questions, "volumes" or "codes" of images; by default what the labels of
            training weigh, or volumes where there were none.

    Raises SpecError where weights and data do not fit; OSError, FileFormatError.
    """
    task = "questions" if is_question_file(data) else "rooms"
    if weights is None:
        weights = FILES / f"{task}.safetensors"
        if not weights.is_file():
            hint = "train some with `bench train ptn` and name them with --weights"
            raise SpecError("weights", "none", f"some of ptn for {task}", hint)
    state = load_weights(weights, RECIPE)
    model, card = state.network, state.card
    if card.config.task != task:
        raise SpecError(weights, f"weights for {card.config.task}", f"some for {task}")
    check_writable(Path(out), overwrite)
    if task == "rooms":
        if compare is not None:
            raise SpecError("compare", repr(compare), "none, as rooms ask no questions")
        _predict_rooms(model, data, out, run, overwrite, progress)
        return
    if compare is not None and compare not in COMPARED:
        raise SpecError("compare", repr(compare), " or ".join(COMPARED))
    head = COMPARED[compare] if compare else card.head or COMPARED["volumes"]
    found = []
    with open_test_questions(data, card) as questions:
        count = len(questions)
        for some in feature_batches(model, questions, count):
            found.append((some.double() @ torch.tensor(head, dtype=torch.double)).numpy())
            progress(len(some), count)
    method = f"ptn {compare}" if compare else "ptn"
    scores = np.concatenate(found)
    write_answers(out, data, method=method, scores=scores, run=run, overwrite=overwrite)


def open_test_questions(data: str | Path, card: Card) -> QuestionsFile:
    """Open questions to answer. Raises as `QuestionsFile`, and SpecError for training questions."""
    if len(parts(data)) > 1:
        raise SpecError(data, "training questions", "questions to answer, such as iqtt-test.h5")
    questions = open_questions(data)
    try:
        check_reducible(data, questions.height, questions.width, card.config.size)
    except BaseException:
        questions.close()
        raise
    return questions


def feature_batches(model: Ptn, questions: QuestionsFile, count: int) -> Iterator[Tensor]:
    """Yield `matching.features` of the first questions of a table, batch after batch."""
    size = model.config.size
    for first in range(0, count, AT_ONCE):
        stored = decode_image(
            questions.read("questions", slice(first, min(first + AT_ONCE, count)))
        )
        images = np.stack([[channels_first(one, size) for one in question] for question in stored])
        yield features(model, torch.from_numpy(images))


@torch.inference_mode()
def _predict_rooms(
    model: Ptn, data: str | Path, out: str | Path, run: str, overwrite: bool, progress: Progress
) -> None:
    method = "ptn" if model.config.silhouettes == "image" else "ptn, silhouettes from ids"
    with RoomsFile(data) as rooms:
        images = RoomImages(rooms, model.config.size)
        how: dict[str, Any] = {"method": method, "run": run, "overwrite": overwrite}
        with RoomPredictionWriter(out, data, **how) as file:
            for rows in images.rows_of:
                source = int(rows[0])
                image = torch.from_numpy(images.image(source))[None]
                place = torch.from_numpy(images.camera(source).astype(np.float32))[None]
                volume = model(image, place)
                for row in rows.tolist():
                    file.add(row, *seen(model, volume, images, row, bool(images.mirrored[source])))
                    progress(1, len(rooms))


def seen(
    model: Ptn, volume: Tensor, images: RoomImages, row: int, mirrored: bool
) -> tuple[Array, Array]:
    """Return planar depth, (H, W), and normals, (H, W, 3), of a volume in a row's view.

    Args:
        volume: (1, D, D, D).
        mirrored: whether it is that of a mirrored image.
    """
    depth, normal = empty_room(images.poses[row], images.fov_y_degrees[row], *images.shape)
    world = images.rays(row)
    rays = torch.from_numpy((world[..., [*SWAPPED]] if mirrored else world).astype(np.float32))
    origin, direction = rays[:, None]
    hit = first_hit(volume, model.box, origin, direction, SAMPLES)
    points = torch.nan_to_num(origin + hit[..., None] * direction)
    facing = outward(volume, model.box, points)[0].double().numpy()
    away = (facing * direction[0].numpy()).sum(axis=1, keepdims=True) >= 0
    back = -direction[0].double().numpy()
    facing = np.where(away, back / np.linalg.norm(back, axis=1, keepdims=True), facing)
    facing = facing[:, [*SWAPPED]] if mirrored else facing
    reach = hit[0].double().numpy().reshape(depth.shape)
    before = reach < depth  # False where there is no hit
    turned = (facing @ images.poses[row, :3, :3]).reshape(normal.shape)
    return np.where(before, reach, depth), np.where(before[..., None], turned, normal)

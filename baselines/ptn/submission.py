"""`write_submission`: depth and normals of rooms, or answers to questions.

A room's volume comes from one image, and every view of the room is drawn from it: an object is
where the occupancy along a pixel's ray first exceeds a half; elsewhere the empty room shows, which
the method is told, as its volume holds objects alone.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.ptn.matching import features
from baselines.ptn.network import METHOD, Ptn
from baselines.ptn.projection import first_hit, outward
from baselines.ptn.rooms import SWAPPED, RoomImages
from baselines.training.checkpoint import bundled, load_weights
from baselines.training.images import Array
from baselines.training.questions import Progress, each_question, is_question_file, open_test
from metrics.measures.relief import empty_room
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable

FILES = Path(__file__).with_name("files")
SAMPLES = 96  # places along each ray, closer than in training
AT_ONCE = 16  # questions
VOLUMES_ALONE = (1.0, 0.0)  # weights of `matching.FEATURES`


def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write a submission for rooms or questions, as `baselines.training` says.

    Answers are scored by what the labels of training weigh, or by volumes where there were none.
    """
    task = "questions" if is_question_file(data) else "rooms"
    model, card = load_weights(weights or bundled(FILES, METHOD, f"ptn-{task}"), METHOD)
    if card.task != task:
        raise SpecError(weights, f"weights for {card.task}", f"some for {task}")
    check_writable(Path(out), overwrite)
    if task == "rooms":
        _predict_rooms(model, data, out, overwrite, progress)
        return
    head = torch.tensor(card.head or VOLUMES_ALONE, dtype=torch.double)

    def scores(images: Tensor) -> Tensor:
        return features(model, images).double() @ head

    with open_test(data, card.settings.size) as questions:
        values = each_question(questions, card.settings.size, scores, AT_ONCE, progress=progress)
    write_answers(out, data, method="ptn", scores=values.numpy(), overwrite=overwrite)


@torch.inference_mode()
def _predict_rooms(
    model: Ptn, data: str | Path, out: str | Path, overwrite: bool, progress: Progress
) -> None:
    method = "ptn" if model.settings.silhouettes == "image" else "ptn, silhouettes from ids"
    with open_rooms(data) as rooms:
        images = RoomImages(rooms, model.settings.size)
        how: dict[str, Any] = {"method": method, "shown": "first_view", "overwrite": overwrite}
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

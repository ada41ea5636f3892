"""What the networks predict: depth and normals of rooms, or answers to questions.

A room's volume comes from one image, and every view of the room is drawn from it: an object is
where the occupancy along a pixel's ray first exceeds a half; elsewhere the empty room shows, which
the method is told, as its volume holds objects alone.
"""

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor

from baselines.ptn.matching import features
from baselines.ptn.network import Card, Ptn
from baselines.ptn.projection import first_hit, outward
from baselines.ptn.rooms import SWAPPED, RoomImages
from baselines.training.baseline import Answers, Views
from baselines.training.images import Array
from iqtt import QuestionsFile
from metrics.measures.relief import empty_room
from scenegen.common.records import check
from scenegen.rooms.reader import RoomsFile

SAMPLES = 96  # places along each ray, closer than in training
AT_ONCE = 16  # questions
VOLUMES_ALONE = (1.0, 0.0)  # weights of `matching.FEATURES`


def answers_of(model: Ptn, card: Card, _questions: QuestionsFile) -> Answers:
    """Return how a model answers questions.

    Answers are scored by what the labels of training weigh, or by volumes where there were none.
    Raises SpecError for weights that learned from rooms.
    """
    check(card.task == "questions", "weights", f"some for {card.task}", "weights for questions")
    head = torch.tensor(card.head or VOLUMES_ALONE, dtype=torch.double)
    return Answers(lambda images: features(model, images).double() @ head, AT_ONCE)


def views_of(model: Ptn, card: Card, rooms: RoomsFile) -> Views:
    """Return what a model predicts of rooms. Raises SpecError for weights of questions."""
    check(card.task == "rooms", "weights", f"some for {card.task}", "weights for rooms")
    method = "ptn" if model.settings.silhouettes == "image" else "ptn, silhouettes from ids"
    return Views(_predicted(model, RoomImages(rooms, model.settings.size)), "first_view", method)


def _predicted(model: Ptn, images: RoomImages) -> Iterator[tuple[Array, Array, Array]]:
    """Yield rows, depth and normals, scene by scene."""
    for rows in images.rows_of:
        source = int(rows[0])
        image = torch.from_numpy(images.image(source))[None]
        place = torch.from_numpy(images.camera(source).astype(np.float32))[None]
        volume, mirrored = model(image, place), bool(images.mirrored[source])
        views = [seen(model, volume, images, row, mirrored) for row in rows.tolist()]
        depths, normals = zip(*views, strict=True)
        yield rows, np.stack(depths), np.stack(normals)


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

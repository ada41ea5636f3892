"""What networks learn: the projection loss, and what batches are drawn from; what they predict.

The loss is the projection loss of Yan et al. (NeurIPS 2016): the mean squared difference of the
volume's silhouettes from the true ones, over the views of each image. There is no loss on volumes.

At prediction a room's volume comes from one image, and every view of the room is drawn from it: an
object is where the occupancy along a pixel's ray first exceeds a half; elsewhere the empty room
shows, which the method is told, as its volume holds objects alone.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.ptn import projection
from baselines.ptn.matching import features, fitted_head
from baselines.ptn.network import METHOD, Card, Ptn, Settings
from baselines.ptn.projection import Batch, first_hit, outward
from baselines.ptn.questions import BOX, TrainingShapes
from baselines.ptn.rooms import SWAPPED, RoomImages, TrainingRooms, room_box
from baselines.training.baseline import Answers, Baseline, Lesson, Run, Views
from baselines.training.checkpoint import State, load_weights
from baselines.training.data import only
from baselines.training.fit import Loss
from baselines.training.images import Array, check_reducible
from baselines.training.questions import (
    LABELED,
    UNLABELED,
    check_labels,
    each_question,
    training_answers,
)
from iqtt import QuestionsFile
from metrics.measures.relief import empty_room
from scenegen.common.random.seeding import Purpose, item_rng
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


def _predicted(model: Ptn, images: RoomImages) -> Iterator[tuple[Array, dict[str, Array]]]:
    """Yield rows, depth and normals, scene by scene."""
    for rows in images.rows_of:
        source = int(rows[0])
        image = torch.from_numpy(images.image(source))[None]
        place = torch.from_numpy(images.camera(source).astype(np.float32))[None]
        volume, mirrored = model(image, place), bool(images.mirrored[source])
        views = [seen(model, volume, images, row, mirrored) for row in rows.tolist()]
        depths, normals = zip(*views, strict=True)
        yield rows, {"depth": np.stack(depths), "normal": np.stack(normals)}


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


def lesson(run: Run, *, labels: int = 0, networks: str | None = None) -> Lesson:
    """Return what a run learns from a file of rooms of several views, or of questions.

    Args:
        labels: how many answers to learn from, the first ones; they weigh what tells answers apart
            (`matching.FEATURES`) and do not change the networks.
        networks: weights of another run, whose networks are taken as they are: only `labels` are
            learnt from then.
    """
    model = None
    if run.earlier is not None:
        card = run.earlier
    elif networks is not None:
        alone = replace(run.settings, seed=0) == Settings()
        check(alone, "networks", networks, "no other settings: they have their own")
        model, card = load_weights(networks, METHOD)
        card = replace(card, labels=labels, head=())
    else:
        card = Card(run.method, run.settings, labels=labels)
    source: TrainingShapes | TrainingRooms
    if run.data.hold_questions:
        unlabelled = only(run.data.questions(UNLABELED), run.method)
        source, task, box = TrainingShapes(unlabelled, card.settings), "questions", BOX
    else:
        check(card.labels == 0, "labels", card.labels, "0 for rooms, which have no labels")
        rooms = only(run.data.rooms(), run.method)
        source, task, box = TrainingRooms(rooms, card.settings), "rooms", room_box(rooms.spec)
    trained = run.earlier is not None or model is not None
    check(not trained or card.task == task, "data", task, f"{card.task}, as the run began with")
    labelled = None
    if card.labels:  # looked at before hours of training
        labelled = only(run.data.questions(LABELED), run.method)
        check_labels(labelled, card.labels)
        check_reducible(run.data.where, labelled.height, labelled.width, card.settings.size)
    if model is None:
        told = {"data": source.data, "fingerprint": source.fingerprint}
        card = replace(card, task=task, low=box[0], high=box[1], **told)
    batches = partial(_batches, source, card.settings.seed)
    return Lesson(card, batches, _loss, network=model, finish=partial(_with_head, labelled))


def _loss(state: State[Card, Ptn], batch: Batch, _number: int) -> Loss:
    loss = projection_loss(state.network, batch)
    return Loss(loss, {"loss": loss})


def _batches(source: TrainingShapes | TrainingRooms, seed: int, first: int) -> Iterator[Batch]:
    """Yield the batches of iteration `first` and of those after it, without end."""
    for number in itertools.count(first):
        yield source.batch(item_rng(seed, number, Purpose.TRAINING))


def _with_head(labelled: QuestionsFile | None, model: Ptn, card: Card) -> Card:
    """Return the card with the weights of features of answers, by what the first answers tell."""
    if labelled is None:
        return card
    model.cpu().eval()
    values = each_question(
        labelled, model.settings.size, lambda images: features(model, images), AT_ONCE, card.labels
    )
    return replace(card, head=fitted_head(values, training_answers(labelled, card.labels)))


def projection_loss(model: Ptn, batch: Batch) -> Tensor:
    """Return the mean squared difference of silhouettes over a batch's rays, ()."""
    volume = model(batch.image, batch.camera)
    rays = batch.origin, batch.direction
    shown = projection.silhouettes(volume, model.box, *rays, model.settings.samples)
    return torch.mean((shown - batch.silhouette) ** 2)


BASELINE = Baseline(
    METHOD,
    Settings,
    Path(__file__).with_name("files"),
    lesson,
    options=("labels", "networks"),
    answers=answers_of,
    views=views_of,
)

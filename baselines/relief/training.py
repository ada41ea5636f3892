"""How relief networks learn, on any targets, and what they predict of rooms."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.pix2shape.predict import enlarged_views
from baselines.relief.network import Card, Relief, Settings, predicted_depth
from baselines.training.baseline import Lesson, Run, Views
from baselines.training.checkpoint import State
from baselines.training.data import requests
from baselines.training.fit import Loss
from baselines.training.images import Array, Draws, check_reducible
from baselines.training.rooms import (
    Rooms,
    camera_poses,
    input_views,
    read_rooms,
    room_images,
    room_sizes,
)
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.rooms.reader import RoomsFile

WARM_UP = 200  # iterations
SLOPE = 2.0  # weight of differences between neighbours, in the loss of shape
WHOLE = 0.2  # of training, its end: whole images are shown; before that, windows around objects
FILES = Path(__file__).with_name("files")
TOLD = "given as input: the camera, and ground and walls of the empty room"
FROM = "each view is predicted from its own image"
FROM_FIRST = "each view is predicted from the image of the scene's first one"


@dataclass(frozen=True, eq=False)
class Lessons:
    """What a network learns.

    Attributes:
        rows: of the rooms to train on, (M,).
        target: the relief of some rows, in edges of their rooms, and how much each pixel counts,
            (B, S, S) each.
        views: for each row, the rows whose cameras may be asked for; None for its own alone.
        inside: the object that each pixel of the rooms lies inside, or 0, (N, S, S), to learn the
            shape of; None to learn relief alone.
    """

    rows: Tensor
    target: Callable[[Tensor], tuple[Tensor, Tensor]]
    views: list[Tensor] | None = None
    inside: Tensor | None = None


def cameras_of(rooms: Rooms, rows: Tensor) -> Cameras:
    """Return the cameras of some rows."""
    return Cameras(rooms.world_from_camera[rows], rooms.fov_of(rows), rooms.room_size[rows])


Teach = Callable[[Rooms, Settings, Path, Callable[[int, int], None]], Lessons]


@dataclass(frozen=True, eq=False)
class Batch:
    """B images, and what is to be learned of each.

    Attributes:
        image: linear radiance, (B, 3, S, S), float16.
        cameras: of the images.
        target_pose: of the cameras asked for, if they are others, (B, 4, 4).
        target, weight: relief, and how much each pixel counts, (B, S, S).
        inside: the object that each pixel lies inside, or 0, (B, S, S); None to learn relief alone.
        place: where windows lie, from 0 to 1, among the pixels that are inside objects, (B,).
    """

    image: Tensor
    cameras: Cameras
    target_pose: Tensor | None
    target: Tensor
    weight: Tensor
    inside: Tensor | None
    place: Tensor


def lesson(
    teach: Teach,
    run: Run,
    *,
    with_depth: bool = False,
    read: Callable[[Sequence[RoomsFile], int], Rooms] | None = None,
    shape: bool = True,
    prepare: Callable[[Any], Any] = lambda network: None,
) -> Lesson:
    """Return what a run of a relief network learns, of files of rooms.

    The loss is the mean absolute difference of relief: in contrast to the squared one it lets a
    pixel be either floor or object, rather than something between them. `shape_loss` is added
    where object ids are read.

    Args:
        teach: finds the relief to learn; it gets the rooms, the settings, the run's folder and a
            function to call with the images done and in all.
        with_depth: whether the rooms' depth and objects are read.
        read: reads the rooms of files; by default `read_rooms`.
        shape: whether `shape_loss` is added where object ids are read.
        prepare: is given the network of a new run.
    """
    settings, files = run.settings, run.data.rooms()
    rooms = (read or partial(read_rooms, depth=with_depth))(files, settings.size)

    def batches(first: int) -> Iterator[Batch]:
        def matched(done: int, total: int) -> None:
            share = {"share of images matched": done / total}
            run.progress(first, settings.iterations, share)

        return batches_of(rooms, teach(rooms, settings, run.folder, matched), settings, first)

    def prepared(network: Any) -> None:
        if run.earlier is None:
            prepare(network)
        network.to(memory_format=torch.channels_last)  # faster

    def loss_of(state: State[Card, Relief], batch: Batch, number: int) -> Loss:
        windows_only = number < (1 - WHOLE) * state.card.settings.iterations
        loss = _loss(state.network, batch, windows_only, shape)
        return Loss(loss, {"loss": loss})

    card = Card(run.method, settings, **requests(files))
    return Lesson(card, batches, loss_of, learning_rate, prepare=prepared)


def learning_rate(settings: Settings, iteration: int) -> float:
    """Return the learning rate of an iteration, counted from 0."""
    falling = 0.5 + 0.5 * math.cos(math.pi * iteration / settings.iterations)
    return settings.learning_rate * min(1.0, (iteration + 1) / WARM_UP) * falling


def batches_of(rooms: Rooms, lessons: Lessons, settings: Settings, first: int) -> Iterator[Batch]:
    """Yield the batches of iteration `first` and of those after it, without end."""
    draws = Draws(len(lessons.rows), settings.batch, settings.seed, first)
    for number, drawn in enumerate(draws, first):
        rows = seen = lessons.rows[torch.tensor(drawn)]
        rng = item_rng(settings.seed, number, Purpose.TRAINING)
        if lessons.views is not None:
            share = rng.random(len(rows))
            views = [lessons.views[row] for row in rows.tolist()]
            chosen = zip(views, share, strict=True)
            seen = torch.stack([others[int(place * len(others))] for others, place in chosen])
        target, weight = lessons.target(seen)
        yield Batch(
            rooms.image[rows],
            cameras_of(rooms, rows),
            None if lessons.views is None else rooms.world_from_camera[seen],
            target,
            weight,
            None if lessons.inside is None else lessons.inside[seen],
            torch.from_numpy(rng.random(len(rows))),
        )


def _loss(network: Relief, batch: Batch, windows_only: bool, shape: bool) -> Tensor:
    """Return the loss of a batch; where object ids are read, of windows around them or of all."""
    cameras = target_cameras = batch.cameras
    if batch.target_pose is not None:
        target_cameras = replace(cameras, world_from_camera=batch.target_pose)
    channels = network.channels(batch.image.float(), cameras, target_cameras)
    target, weight, inside = batch.target, batch.weight, batch.inside
    if inside is not None and windows_only:
        maps = (channels, target, weight, inside)
        side = channels.shape[-1] // 2
        channels, target, weight, inside = windows(maps, inside > 0, side, batch.place)
    errors = (network.relief(channels) - target) * weight
    loss = errors.abs().sum() / weight.sum().clamp(min=1)
    return loss + shape_loss(errors, inside) if shape and inside is not None else loss


def shape_loss(errors: Tensor, inside: Tensor) -> Tensor:
    """Return mean |e - its object's mean e| + SLOPE * mean |e - its neighbour's e|.

    These are errors of relief inside objects that no shift of a whole object explains.

    The first is what `shape_error` scores (with medians); the second teaches normals. Neighbours
    are the pixels below and to the right, where they lie inside the same object.

    Args:
        errors: of relief, (B, S, S).
        inside: the object that each pixel lies inside, (B, S, S), int; 0 for none.
    """
    image = torch.arange(len(inside), device=inside.device)[:, None, None]
    place = inside > 0
    own = errors[place]
    objects = (inside + image * (1 + int(inside.max())))[place]
    objects = torch.unique(objects, return_inverse=True)[1]
    pixels = torch.bincount(objects)
    means = own.new_zeros(len(pixels)).index_add(0, objects, own) / pixels
    slopes = []
    for axis in (1, 2):
        first, second = (inside.narrow(axis, i, inside.shape[axis] - 1) for i in (0, 1))
        slopes.append(errors.diff(dim=axis)[(first == second) & (first > 0)])
    return _mean_size(own - means[objects]) + SLOPE * _mean_size(torch.cat(slopes))


def _mean_size(values: Tensor) -> Tensor:
    return values.abs().sum() / max(1, len(values))


def windows(maps: Sequence[Tensor], shown: Tensor, side: int, place: Tensor) -> list[Tensor]:
    """Return of each image the same window of all maps (B, ..., S, S), (B, ..., side, side).

    Args:
        shown: the pixels that a window may lie around, (B, S, S); where an image has none, all.
        place: which of them each lies around, from 0 for the first to 1 for the last, (B,) float64.
    """
    size = shown.shape[-1]
    flat = (shown | ~shown.flatten(1).any(dim=1)[:, None, None]).flatten(1)
    order = flat.cumsum(dim=1)
    drawn = (place * order[:, -1]).long() + 1  # the first pixel that completes so many
    middle = torch.searchsorted(order, drawn[:, None])
    offsets = torch.arange(side, device=shown.device)
    row, column = (
        (axis - side // 2).clamp(0, size - side) + offsets
        for axis in (middle // size, middle % size)
    )
    images = torch.arange(len(shown), device=shown.device)[:, None, None]
    cut = []
    for each in maps:
        channels_last = each.movedim(1, -1) if each.dim() == 4 else each
        window = channels_last[images, row[:, :, None], column[:, None]]
        cut.append(window.movedim(-1, 1) if each.dim() == 4 else window)
    return cut


def views_of(told_in_training: str, network: Relief, card: Card, rooms: RoomsFile) -> Views:
    """Return what a network predicts of every view of a file of rooms.

    It predicts each view from its own image, or each scene from one image alone, view 0 or the
    first that the file holds. The submission's notes say it, too.
    """
    size, from_first = card.settings.size, network.from_first_view
    check_reducible(rooms.path, rooms.spec.height, rooms.spec.width, size)
    poses = torch.from_numpy(camera_poses(rooms, closed=True).astype(np.float32))
    fov = rooms.read("camera/fov_y_degrees", slice(None))
    sizes = room_sizes(rooms) if rooms.spec.interior else None
    source = np.arange(len(rooms))
    if from_first:
        inputs, place = input_views(rooms)
        source = inputs[place]

    def depth(rows: Array) -> Tensor:
        image = room_images(rooms, source[rows], size)
        own = float(fov[rows[0]]), None if sizes is None else sizes[rows]
        cameras = target_cameras = Cameras(poses[source[rows]], *own)
        if from_first:
            target_cameras = Cameras(poses[rows], *own)
        return predicted_depth(network, image, cameras, target_cameras)

    notes = f"{FROM_FIRST if from_first else FROM}; {TOLD}{told_in_training}"
    shown = "first_view" if from_first else "scored_view"
    return Views(enlarged_views(rooms, depth), shown, card.method, notes)

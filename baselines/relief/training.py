"""How relief networks learn, on any targets."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from numpy.random import Generator
from torch import Tensor

from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.relief.network import Card, Relief, Settings
from baselines.relief.shape_loss import shape_loss
from baselines.training.checkpoint import WEIGHTS, Method
from baselines.training.fit import Loss, Progress, fit
from baselines.training.images import Draws
from baselines.training.rooms import Rooms, read_rooms
from baselines.training.run_folder import alone_in, begun, earlier_state
from scenegen import open_rooms
from scenegen.common.random.seeding import Purpose, item_rng

EVERY = 100  # iterations between checkpoints
WARM_UP = 200  # iterations
WHOLE = 0.2  # of training, its end: whole images are shown; before that, windows around objects


@dataclass(frozen=True, eq=False)
class Lessons:
    """What a network learns.

    Attributes:
        rows: of the rooms to train on, (M,).
        target: the relief of some rows, and how much each pixel counts, (B, S, S) each.
        views: for each row, the rows whose cameras may be asked for; None for its own alone.
        inside: the object that each pixel of the rooms lies inside, or 0, (N, S, S), to learn the
            shape of; None to learn relief alone.
    """

    rows: Tensor
    target: Callable[[Tensor], tuple[Tensor, Tensor]]
    views: list[Tensor] | None = None
    inside: Tensor | None = None


Teach = Callable[[Rooms, Settings, Path, Callable[[int, int], None]], Lessons]


def train(
    method: Method[Card, Any],
    teach: Teach,
    with_depth: bool,
    data: str | Path,
    run_folder: str | Path,
    settings: Settings = Settings(),  # noqa: B008 (it is frozen)
    *,
    begin: Callable[[Any], Any] = lambda network: None,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
) -> Path:
    """Train a relief network on a file of rooms, as `baselines.training` says.

    The loss is the mean absolute difference of relief: in contrast to the squared one it lets a
    pixel be either floor or object, rather than something between them. `shape_loss` is added
    where objects are told.

    Args:
        teach: finds the relief to learn; it gets the rooms, the settings, the run's folder and a
            function to call with the images done and in all.
        with_depth: whether the rooms' depth and objects are read.
        begin: is given the network of a new run.
    """
    folder = Path(run_folder)
    with alone_in(folder), open_rooms(data) as file:
        earlier = earlier_state(folder, method, resume)
        settings = settings if earlier is None else earlier.card.settings
        rooms = read_rooms(file, settings.size, depth=with_depth)
        card = Card(method.name, settings, data=rooms.data, fingerprint=rooms.fingerprint)
        state = begun(method, card, earlier, data)
        if earlier is None:
            begin(state.network)
        at, last = state.card.iteration, settings.iterations
        lessons = teach(
            rooms,
            settings,
            folder,
            lambda done, total: progress(at, last, {"share of images matched": done / total}),
        )
        state.network.to(memory_format=torch.channels_last)  # faster
        draws = iter(Draws(len(lessons.rows), settings.batch, settings.seed, at))

        def losses(number: int) -> Iterator[Loss]:
            rows = lessons.rows[torch.tensor(next(draws))]
            loss = _loss(state.network, rooms, rows, lessons, settings, number)
            yield Loss(loss, {"loss": loss})

        fit(folder, method, state, losses, learning_rate, every=EVERY, progress=progress)
    return folder / WEIGHTS


def learning_rate(settings: Settings, iteration: int) -> float:
    """Return the learning rate of an iteration, counted from 0."""
    falling = 0.5 + 0.5 * math.cos(math.pi * iteration / settings.iterations)
    return settings.learning_rate * min(1.0, (iteration + 1) / WARM_UP) * falling


def _loss(
    network: Relief, rooms: Rooms, rows: Tensor, lessons: Lessons, settings: Settings, number: int
) -> Tensor:
    fov, image = rooms.fov_y_degrees, rooms.image[rows].float()
    cameras = target_cameras = Cameras(rooms.world_from_camera[rows], fov)
    rng = item_rng(settings.seed, number, Purpose.TRAINING)
    if lessons.views is not None:
        share = rng.random(len(rows))
        views = [lessons.views[row] for row in rows.tolist()]
        chosen = zip(views, share, strict=True)
        rows = torch.stack([others[int(place * len(others))] for others, place in chosen])
        target_cameras = Cameras(rooms.world_from_camera[rows], fov)
    channels = network.channels(image, cameras, target_cameras)
    target, weight = lessons.target(rows)
    inside = None if lessons.inside is None else lessons.inside[rows]
    if inside is not None and number < (1 - WHOLE) * settings.iterations:
        maps = (channels, target, weight, inside)
        channels, target, weight, inside = windows(maps, inside > 0, settings.size // 2, rng)
    errors = (network.relief(channels) - target) * weight
    loss = errors.abs().sum() / weight.sum().clamp(min=1)
    return loss if inside is None else loss + shape_loss(errors, inside)


def windows(maps: Sequence[Tensor], shown: Tensor, side: int, rng: Generator) -> list[Tensor]:
    """Return of each image the same window of all maps (B, ..., S, S), (B, ..., side, side).

    Each lies around a random pixel of those that are to be `shown`, (B, S, S), where there are any.
    """
    corners = []
    for image in shown:
        pixels = image.nonzero() if image.any() else torch.ones_like(image).nonzero()
        middle = pixels[int(rng.random() * len(pixels))]
        corners.append((middle - side // 2).clamp(0, image.shape[0] - side).tolist())
    return [
        torch.stack(
            [m[..., i : i + side, j : j + side] for m, (i, j) in zip(all_of, corners, strict=True)]
        )
        for all_of in maps
    ]

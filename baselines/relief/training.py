"""How relief networks learn, on any targets."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.relief.network import Card, Settings, relief_network
from baselines.training.checkpoint import WEIGHTS, Method
from baselines.training.fit import Loss, Progress, fit
from baselines.training.images import Draws
from baselines.training.rooms import Rooms, read_rooms
from baselines.training.run_folder import alone_in, begun, earlier_state
from scenegen import open_rooms
from scenegen.common.random.seeding import Purpose, item_rng

EVERY = 100  # iterations between checkpoints
WARM_UP = 200  # iterations


@dataclass(frozen=True, eq=False)
class Lessons:
    """What a network learns.

    Attributes:
        rows: of the rooms to train on, (M,).
        target: the relief of some rows, and how much each pixel counts, (B, S, S) each.
        views: for each row, the rows whose cameras may be asked for; None for its own alone.
    """

    rows: Tensor
    target: Callable[[Tensor], tuple[Tensor, Tensor]]
    views: list[Tensor] | None = None


Teach = Callable[[Rooms, Settings, Path, Callable[[int, int], None]], Lessons]


def train(
    name: str,
    teach: Teach,
    with_depth: bool,
    data: str | Path,
    run_folder: str | Path,
    settings: Settings = Settings(),  # noqa: B008 (it is frozen)
    *,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
) -> Path:
    """Train a relief network on a file of rooms, as `baselines.training` says.

    The loss is the mean absolute difference of relief: in contrast to the squared one it lets a
    pixel be either floor or object, rather than something between them.

    Args:
        name: of the method.
        teach: finds the relief to learn; it gets the rooms, the settings, the run's folder and a
            function to call with the images done and in all.
        with_depth: whether the rooms' depth is read.
    """
    folder, method = Path(run_folder), Method(name, Card, relief_network)
    with alone_in(folder), open_rooms(data) as file:
        earlier = earlier_state(folder, method, resume)
        settings = settings if earlier is None else earlier.card.settings
        rooms = read_rooms(file, settings.size, depth=with_depth)
        card = Card(name, settings, data=rooms.data, fingerprint=rooms.fingerprint)
        state = begun(method, card, earlier, data)
        at, last = state.card.iteration, settings.iterations
        lessons = teach(
            rooms,
            settings,
            folder,
            lambda done, total: progress(at, last, {"share of images matched": done / total}),
        )
        state.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # faster
        draws = iter(Draws(len(lessons.rows), settings.batch, settings.seed, at))

        def losses(number: int) -> Iterator[Loss]:
            rows = lessons.rows[torch.tensor(next(draws))]
            loss = _loss(state.network, rooms, rows, lessons, settings.seed, number)
            yield Loss(loss, {"loss": loss})

        fit(folder, method, state, losses, learning_rate, every=EVERY, progress=progress)
    return folder / WEIGHTS


def learning_rate(settings: Settings, iteration: int) -> float:
    """Return the learning rate of an iteration, counted from 0."""
    falling = 0.5 + 0.5 * math.cos(math.pi * iteration / settings.iterations)
    return settings.learning_rate * min(1.0, (iteration + 1) / WARM_UP) * falling


def _loss(
    network: nn.Module, rooms: Rooms, rows: Tensor, lessons: Lessons, seed: int, number: int
) -> Tensor:
    fov, image = rooms.fov_y_degrees, rooms.image[rows]
    cameras = target_cameras = Cameras(rooms.world_from_camera[rows], fov)
    if lessons.views is not None:
        share = item_rng(seed, number, Purpose.TRAINING).random(len(rows))
        views = [lessons.views[row] for row in rows.tolist()]
        chosen = zip(views, share, strict=True)
        rows = torch.stack([others[int(place * len(others))] for others, place in chosen])
        target_cameras = Cameras(rooms.world_from_camera[rows], fov)
    with torch.autocast(image.device.type, torch.bfloat16):  # twice as fast
        relief = network(image.float(), cameras, target_cameras)
    target, weight = lessons.target(rows)
    differences = (relief.float() - target).abs() * weight
    return differences.sum() / weight.sum().clamp(min=1)

"""`train` from true depth, and `fit`, the iterations of every relief network, on any targets.

Everything random in an iteration derives from the seed and the iteration's number, so that training
goes on after a kill as if it had never stopped.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines import checkpoints
from baselines.depth_supervised.card import Card, State, recipe
from baselines.depth_supervised.network import ReliefSpec
from baselines.pix2shape.data.in_memory import Rooms, read_rooms
from baselines.pix2shape.data.rooms import Draws
from baselines.pix2shape.network.empty_rooms import Cameras, empty_rooms
from scenegen.common.errors import SceneGenError
from scenegen.common.random.seeding import Purpose, item_rng

METHOD = "depth-supervised"
EVERY = 100  # iterations between checkpoints
WARM_UP = 200  # iterations
Progress = Callable[[int, int, Mapping[str, float]], Any]  # iterations done, in all, losses


@dataclass(frozen=True, eq=False)
class Target:
    """What relief is compared with: (B, S, S) each; `weight` says how much each pixel counts."""

    relief: Tensor
    weight: Tensor


@checkpoints.one_at_a_time
def train(
    data: str | Path,
    run_folder: str | Path,
    *,
    seed: int = 0,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
    iterations: int = 1200,
    batch: int = 16,
    learning_rate: float = 0.003,
    network: str = "unet",
    size: int = 64,
    width: float = 1.0,
) -> Path:
    """Train a network with the true depth of rooms; return the path of the weights.

    Args:
        data: rooms. The network "code" learns to predict each scene's other views, too, if there
            are any.
        run_folder: gets checkpoint and weights.
        resume: go on from the folder's checkpoint, with its settings and seed.
        progress: called after each iteration with its number, how many there will be, and losses.
        iterations, batch, learning_rate: as in `Card`.
        network, size, width: as in `ReliefSpec`, where the network's name is its kind.

    Raises SpecError where settings and data do not fit; FileExistsError where a new run finds a
    checkpoint; SceneGenError where a loss is not finite; OSError, FileFormatError.
    """
    spec = ReliefSpec(network, size, width)
    card = Card(METHOD, spec, seed, iterations, batch, learning_rate)
    state, rooms = begun(data, run_folder, card, resume, depth=True)
    size = state.card.network.size  # a resumed run has its own

    def target(rows: Tensor) -> Target:
        assert rooms.depth is not None, "it was asked for"
        cameras = rooms.cameras(rows)
        walls, _, _ = empty_rooms(cameras.world_from_camera, cameras.fov_y_degrees, size)
        depth = rooms.depth[rows]
        known = depth.isfinite()
        return Target(torch.where(known, walls - depth, 0), known.float())

    others = views_of_scenes(rooms) if state.card.network.kind == "code" else None
    return fit(state, rooms, run_folder, target, progress, others=others)


def begun(
    data: str | Path, run_folder: str | Path, card: Card, resume: bool, *, depth: bool = False
) -> tuple[State, Rooms]:
    """Return the state of a new run, or that of the folder's checkpoint, and the rooms.

    Raises FileExistsError where a new run finds a checkpoint; SpecError where a run began on other
    rooms; OSError, FileFormatError.
    """
    folder, made = Path(run_folder), recipe(card.method)
    if resume:
        state = checkpoints.load_checkpoint(folder, made)
    else:
        checkpoints.check_new(folder)
        state = checkpoints.new_state(made, card)
    rooms = read_rooms(data, state.card.network.size, depth=depth)
    if resume:
        checkpoints.check_data(data, rooms.fingerprint, state.card.fingerprint)
    state.card = replace(state.card, data=rooms.data, fingerprint=rooms.fingerprint)
    return state, rooms


def views_of_scenes(rooms: Rooms) -> list[Tensor]:
    """Return for each row the rows that show its scene, itself among them."""
    order = torch.argsort(rooms.scene, stable=True)
    counts = torch.unique_consecutive(rooms.scene[order], return_counts=True)[1]
    found: list[Tensor] = [order] * len(rooms)
    for rows in torch.split(order, counts.tolist()):
        for row in rows.tolist():
            found[row] = rows
    return found


def fit(
    state: State,
    rooms: Rooms,
    run_folder: str | Path,
    target: Callable[[Tensor], Target],
    progress: Progress,
    *,
    allowed: Tensor | None = None,
    others: list[Tensor] | None = None,
) -> Path:
    """Train from the state's iteration to its last one; return the path of the weights.

    The loss is the mean absolute difference of relief: in contrast to the squared one it lets a
    pixel be either floor or object, rather than something between them.

    Args:
        target: of some rows.
        allowed: rows to train on; None for all.
        others: for each row, the rows whose cameras may be asked for; None for its own alone.
    """
    folder = Path(run_folder)
    folder.mkdir(parents=True, exist_ok=True)
    state.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # faster
    allowed = torch.arange(len(rooms)) if allowed is None else allowed
    before, started = state.card.seconds, time.monotonic()
    batches = iter(Draws(len(allowed), state.card.batch, state.card.seed, state.card.iteration))
    for number in range(state.card.iteration, state.card.iterations):
        rows = allowed[torch.tensor(next(batches))]
        own = asked = rooms.cameras(rows)
        goals = rows
        if others is not None:
            goals = _drawn(others, rows, state.card.seed, number)
            asked = rooms.cameras(goals)
        loss = _step(state, rooms.image[rows], own, asked, target(goals))
        if not math.isfinite(loss):
            hint = "begin again with a smaller learning rate"
            raise SceneGenError(f"iteration {number}", "a loss that is not finite", hint=hint)
        seconds = round(before + time.monotonic() - started, 1)
        state.card = replace(state.card, iteration=number + 1, seconds=seconds)
        if state.card.iteration % EVERY == 0 or state.card.iteration == state.card.iterations:
            checkpoints.save_checkpoint(folder, state)
            checkpoints.save_weights(folder / checkpoints.WEIGHTS, state)
        progress(state.card.iteration, state.card.iterations, {"loss": loss})
    return folder / checkpoints.WEIGHTS


def learning_rate(card: Card, iteration: int) -> float:
    """Return the learning rate of an iteration, counted from 0."""
    falling = 0.5 + 0.5 * math.cos(math.pi * iteration / card.iterations)
    return card.learning_rate * min(1.0, (iteration + 1) / WARM_UP) * falling


def _drawn(others: list[Tensor], rows: Tensor, seed: int, number: int) -> Tensor:
    """Return for each row one of those whose cameras may be asked for."""
    share = item_rng(seed, number, Purpose.TRAINING).random(len(rows))
    places = zip(rows.tolist(), share, strict=True)
    return torch.stack([others[row][int(at * len(others[row]))] for row, at in places])


def _step(state: State, image: Tensor, own: Cameras, asked: Cameras, target: Target) -> float:
    """Take one step; return the loss. If that is not finite, nothing is changed."""
    for group in state.optimiser.param_groups:
        group["lr"] = learning_rate(state.card, state.card.iteration)
    state.network.train()
    with torch.autocast(image.device.type, torch.bfloat16):  # twice as fast
        relief = state.network(image.float(), own, asked)
    differences = (relief.float() - target.relief).abs() * target.weight
    loss = differences.sum() / target.weight.sum().clamp(min=1)
    if loss.isfinite():
        state.optimiser.zero_grad()
        loss.backward()
        state.optimiser.step()
    return float(loss.detach())

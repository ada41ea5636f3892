"""The training loop: Pix2Shape (IJCV 2020), Algorithm 1, on any of Lightning Fabric's devices.

Everything random in iteration i derives from (seed, i), so that training goes on after a kill as if
it had never stopped: weights, optimisers and the number of the iteration are all there is to keep.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import torch
from lightning_fabric import Fabric
from torch import Tensor, nn
from torch.optim import Adam
from torch.utils.data import DataLoader

from baselines.pix2shape.config import ModelConfig
from baselines.pix2shape.data import Batch, Draws, RoomImages
from baselines.pix2shape.model import Pix2Shape
from baselines.pix2shape.question_data import QuestionImages
from baselines.pix2shape.steps import Noise, critic_step, draw, generator_step
from baselines.pix2shape.weights import (
    Card,
    load_card,
    load_into,
    load_tensors,
    save_card,
    save_tensors,
)
from scenegen.errors import FileFormatError, SceneGenError
from scenegen.seeding import Purpose, item_seed

Source = RoomImages | QuestionImages
CHECKPOINT = "checkpoint.safetensors"


class TrainingError(SceneGenError):
    """Training cannot go on."""


@dataclass(eq=False)
class State:
    """All that training changes."""

    model: Pix2Shape
    generator: Adam
    critic: Adam
    iteration: int = 0
    seconds: float = 0.0


def new_state(config: ModelConfig) -> State:
    """Return an untrained model and its optimisers; the weights are those of the seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(config.seed, 0, Purpose.WEIGHTS))
        model = Pix2Shape(config)
    return _with_optimisers(model)


def _with_optimisers(model: Pix2Shape) -> State:
    config = model.config
    groups = ((model.encoder, model.decoder), (model.critic, model.statistics))
    first, second = (
        Adam(_parameters(*group), lr=config.learning_rate, betas=config.betas) for group in groups
    )
    return State(model, first, second)


def _parameters(*modules: nn.Module) -> list[nn.Parameter]:
    return [parameter for module in modules for parameter in module.parameters()]


def save_state(folder: Path, state: State, card: Card) -> None:
    """Write the folder's checkpoint; the one before is there until this one is complete."""
    tensors = {f"model.{name}": value for name, value in state.model.state_dict().items()}
    for kind, optimiser in (("generator", state.generator), ("critic", state.critic)):
        for index, values in optimiser.state_dict()["state"].items():
            tensors |= {f"{kind}.{index}.{name}": value for name, value in values.items()}
    notes = {"iteration": str(state.iteration), "seconds": f"{state.seconds:.3f}"}
    save_card(folder / CHECKPOINT, card)
    save_tensors(folder / CHECKPOINT, tensors, notes)


def load_state(folder: Path) -> tuple[State, Card]:
    """Read a folder's checkpoint. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    card = load_card(path)
    tensors, notes = load_tensors(path)
    model = Pix2Shape(card.config)
    own = {k.removeprefix("model."): v for k, v in tensors.items() if k.startswith("model.")}
    load_into(model, own, path)
    state = _with_optimisers(model)
    try:
        for kind, optimiser in (("generator", state.generator), ("critic", state.critic)):
            groups = optimiser.state_dict()["param_groups"]
            optimiser.load_state_dict({"state": _moments(tensors, kind), "param_groups": groups})
        state.iteration, state.seconds = int(notes["iteration"]), float(notes["seconds"])
    except (KeyError, ValueError) as error:
        raise FileFormatError(f"{path}: not a checkpoint of this release: {error!r}") from error
    return state, card


def _moments(tensors: dict[str, Tensor], kind: str) -> dict[int, dict[str, Tensor]]:
    found: dict[int, dict[str, Tensor]] = {}
    for name, value in tensors.items():
        group, _, rest = name.partition(".")
        if group == kind:
            index, _, field = rest.partition(".")
            found.setdefault(int(index), {})[field] = value
    return found


def train(
    state: State,
    source: Source,
    fabric: Fabric,
    *,
    labelled: QuestionImages | None = None,
    labels: int = 0,
    workers: int = 0,
) -> Iterator[tuple[dict[str, float], Batch]]:
    """Train from the state's iteration to the configuration's last, changing the state.

    Yields the losses by name and the last batch, after each iteration.

    Args:
        source: of the images.
        fabric: launched; where several processes train, each takes its share of every batch.
        labelled: questions whose first `labels` answers may be used.
        workers: processes that read.

    Raises TrainingError where a loss or a gradient is not finite; the state is then the last good.
    """
    config, model = state.model.config, state.model
    fabric.to_device(model)
    batches = _batches(source, fabric, state, workers)
    asked: Iterator[tuple[Batch, Tensor]] = iter(())
    if labelled is not None and labels:
        asked = _questions(labelled, labels, fabric, state)
    model.train()
    began = time.monotonic() - state.seconds
    while state.iteration < config.iterations:
        losses: dict[str, float] = {}
        _set_rate(state)
        for turn in range(config.batches_per_iteration):
            batch = next(batches)
            noise = _noise(state, batch, turn, fabric)
            if config.has_critic:
                with fabric.autocast():
                    loss, numbers = critic_step(model, batch, noise)
                _update(fabric, state, state.critic, loss, numbers, losses)
        with fabric.autocast(), _frozen(model.critic, model.statistics):
            loss, numbers = generator_step(model, batch, noise, next(asked, None))
            _update(fabric, state, state.generator, loss, numbers, losses)
        state.iteration += 1
        state.seconds = time.monotonic() - began
        yield losses, batch


def _loaded(
    source: Source,
    rows: int,
    size: int,
    first: int,
    seed: int,
    fabric: Fabric,
    workers: int,
) -> Iterator[dict[str, Tensor]]:
    """Read batch after batch from a number on, for ever; of each, this process's share."""
    share = slice(fabric.global_rank, None, fabric.world_size)
    loader = DataLoader(
        source,
        batch_sampler=Draws(rows, size, seed, first, share),
        num_workers=workers,
        pin_memory=fabric.device.type == "cuda",
    )
    return iter(loader)


def _batches(source: Source, fabric: Fabric, state: State, workers: int) -> Iterator[Batch]:
    config = state.model.config
    size = config.question_batch if isinstance(source, QuestionImages) else config.batch
    first = state.iteration * config.batches_per_iteration
    for items in _loaded(source, len(source), size, first, config.seed, fabric, workers):
        yield source.as_batch(items).to(fabric.device)


def _questions(
    source: QuestionImages, labels: int, fabric: Fabric, state: State
) -> Iterator[tuple[Batch, Tensor]]:
    config = state.model.config
    size = config.question_batch
    for items in _loaded(source, labels, size, state.iteration, config.seed, fabric, 0):
        yield source.as_batch(items).to(fabric.device), items["answer"].to(fabric.device)


@contextmanager
def _frozen(*modules: nn.Module) -> Iterator[None]:
    """Leave out the gradients of weights that are not to change."""
    for module in modules:
        module.requires_grad_(False)
    try:
        yield
    finally:
        for module in modules:
            module.requires_grad_(True)


def _update(
    fabric: Fabric,
    state: State,
    optimiser: Adam,
    loss: Tensor,
    numbers: dict[str, Tensor],
    losses: dict[str, float],
) -> None:
    """Take one step; nothing is changed where the loss or a gradient is not finite."""
    optimiser.zero_grad()
    fabric.backward(loss)
    gradients = [
        p.grad for group in optimiser.param_groups for p in group["params"] if p.grad is not None
    ]
    if fabric.world_size > 1:  # DDP forbids several and double backward passes
        for gradient in gradients:
            gradient.copy_(cast(Tensor, fabric.all_reduce(gradient, reduce_op="mean")))
    losses |= {name: float(value.detach()) for name, value in numbers.items()}
    if not torch.isfinite(torch.nn.utils.get_total_norm(gradients)):
        told = ", ".join(f"{name} {value:.3g}" for name, value in losses.items())
        raise TrainingError(
            f"iteration {state.iteration}: gradients are not finite ({told}); the checkpoint is of"
            " before: go on from it with a smaller learning rate or other weights of the losses"
        )
    optimiser.step()


def _set_rate(state: State) -> None:
    config = state.model.config
    left = 1 - state.iteration / config.iterations
    for optimiser in (state.generator, state.critic):
        for group in optimiser.param_groups:
            group["lr"] = config.learning_rate * (min(1.0, 2 * left) if config.decay else 1.0)


def _noise(state: State, batch: Batch, turn: int, fabric: Fabric) -> Noise:
    config = state.model.config
    number = state.iteration * config.batches_per_iteration + turn
    seed = item_seed(config.seed, number, Purpose.TRAINING, fabric.global_rank)
    return draw(len(batch.image), config.networks.z, seed).to(fabric.device)

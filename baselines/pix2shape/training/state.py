"""The state of training and its checkpoint: weights, optimisers, number of the iteration."""

import errno
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn
from torch.optim import Adam

from baselines.checkpoints import CHECKPOINT
from baselines.optimiser_moments import load_moments, moments_of
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.weights import storage
from baselines.pix2shape.weights.storage import Card
from baselines.tensor_files import load_tensors, save_tensors, whole_number
from scenegen.common.errors import FileFormatError
from scenegen.common.random.seeding import Purpose, item_seed

KINDS = ("generator", "critic")  # the optimisers of a state


@dataclass(eq=False)
class State:
    """Everything that training changes."""

    model: Pix2Shape
    generator: Adam
    critic: Adam
    iteration: int = 0
    seconds: float = 0.0


def new_state(config: ModelConfig) -> State:
    """Return an untrained model, whose weights the seed decides, and its optimisers."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(config.seed, 0, Purpose.WEIGHTS))
        model = Pix2Shape(config)
    return _with_optimisers(model)


def _with_optimisers(model: Pix2Shape) -> State:
    config = model.config
    groups = (model.encoder, model.decoder), (model.critic, model.statistics)
    trained = (nn.ModuleList(group).parameters() for group in groups)
    rate, betas = config.learning_rate, config.betas
    generator, critic = (Adam(weights, lr=rate, betas=betas) for weights in trained)
    return State(model, generator, critic)


def save_state(folder: Path, state: State, card: Card) -> None:
    """Write the folder's checkpoint; the old one stays until this one is complete."""
    own = state.model.state_dict().items()
    tensors = {f"model.{k}": value for k, value in own if k.split(".")[0] in storage.LEARNED}
    notes = {"iteration": str(state.iteration)}
    for kind in KINDS:
        moments, notes[kind] = moments_of(getattr(state, kind))
        tensors |= {f"{kind}.{name}": value for name, value in moments.items()}
    storage.save_card(folder / CHECKPOINT, card)
    save_tensors(folder / CHECKPOINT, tensors, notes)


def load_state(folder: Path) -> tuple[State, Card]:
    """Read a folder's checkpoint. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "holds no checkpoint to resume", str(folder))
    card = storage.load_card(path)
    tensors, notes = load_tensors(path)
    own = {k.removeprefix("model."): v for k, v in tensors.items() if k.startswith("model.")}
    state = _with_optimisers(storage.load_into(card, own, path, storage.LEARNED))
    try:
        state.iteration = whole_number(notes, "iteration")
        _check(state.iteration <= card.config.iterations, f"iteration {state.iteration}")
        state.seconds = card.seconds
        for kind in KINDS:
            start = f"{kind}."
            own = {k.removeprefix(start): v for k, v in tensors.items() if k.startswith(start)}
            load_moments(getattr(state, kind), own, whole_number(notes, kind))
        strange = [name for name in tensors if name.split(".")[0] not in ("model", *KINDS)]
        _check(not strange, f"{', '.join(strange)} not expected")
    except (KeyError, ValueError) as error:
        raise FileFormatError(path, f"{error}", "a checkpoint of this release") from error
    return state, card


def _check(ok: bool, found: str) -> None:
    if not ok:
        raise ValueError(found)

"""Weights and checkpoints as safetensors files, each with its card inside."""

import errno
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor
from torch.optim import Adam

from baselines.optimiser_moments import load_moments, moments_of
from baselines.ptn.network import Ptn, PtnConfig
from baselines.tensor_files import check_tensors, load_tensors, save_tensors, shortened
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check, from_json, normalise, to_json
from scenegen.common.seeding import Purpose, item_seed

CHECKPOINT, WEIGHTS = "checkpoint.safetensors", "weights.safetensors"
FORMAT_VERSION = 1
MODEL, ADAM = "model.", "adam."  # beginnings of names


@dataclass(frozen=True)
class Card:
    """What is stored with weights: where they come from.

    Attributes:
        iteration: number of training iterations done.
        data, fingerprint: request and fingerprint of the training file.
        labels: number of answers that training was told.
        head: how the features of an answer are weighted, for questions (`answers.features`).
        seconds: duration of training.
    """

    config: PtnConfig
    iteration: int = 0
    data: str = ""
    fingerprint: str = ""
    labels: int = 0
    head: tuple[float, ...] = ()
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        version = self.format_version
        check(version == FORMAT_VERSION, "format version", version, str(FORMAT_VERSION))
        check(
            0 <= self.iteration <= self.config.iterations, "iteration", self.iteration, "in reach"
        )


def new_model(config: PtnConfig) -> tuple[Ptn, Adam]:
    """Return an untrained model, whose weights the seed decides, and its optimiser."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(config.seed, 0, Purpose.WEIGHTS))
        model = Ptn(config)
    return model, optimiser_of(model)


def optimiser_of(model: Ptn) -> Adam:
    """Return a new optimiser of a model's weights."""
    config = model.config
    return Adam(model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)


def save_weights(path: str | Path, model: Ptn, card: Card) -> None:
    """Write weights as 16-bit numbers, and the card; the file is replaced when it is complete."""
    save_tensors(path, shortened(model.state_dict()), {"card": to_json(card)})


def load_weights(path: str | Path) -> tuple[Ptn, Card]:
    """Read weights; the model is in evaluation mode. Raises OSError, FileFormatError."""
    tensors, notes = load_tensors(path)
    if any(name.startswith(MODEL) for name in tensors):
        raise FileFormatError(path, "a checkpoint", "weights", "name the weights beside it")
    card = _card(path, notes)
    return _model(path, card.config, tensors).eval(), card


def save_checkpoint(folder: Path, model: Ptn, optimiser: Adam, card: Card) -> None:
    """Write the folder's checkpoint; the old one stays until this one is complete."""
    moments, count = moments_of(optimiser)
    tensors = {MODEL + name: value for name, value in model.state_dict().items()}
    tensors |= {ADAM + name: value for name, value in moments.items()}
    save_tensors(folder / CHECKPOINT, tensors, {"card": to_json(card), "moments": count})


def load_checkpoint(folder: Path) -> tuple[Ptn, Adam, Card]:
    """Read the folder's checkpoint. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "holds no checkpoint to resume", str(folder))
    tensors, notes = load_tensors(path)
    card = _card(path, notes)
    own = {start: _beginning(tensors, start) for start in (MODEL, ADAM)}
    model = _model(path, card.config, own[MODEL])
    optimiser = optimiser_of(model)
    try:
        load_moments(optimiser, own[ADAM], int(notes["moments"]))
        if len(own[MODEL]) + len(own[ADAM]) != len(tensors):
            raise ValueError("tensors that are neither weights nor moments")
    except (KeyError, ValueError) as error:
        raise FileFormatError(path, f"{error}", "a checkpoint of this release") from error
    return model, optimiser, card


def _beginning(tensors: Mapping[str, Tensor], start: str) -> dict[str, Tensor]:
    return {k.removeprefix(start): v for k, v in tensors.items() if k.startswith(start)}


def _card(path: str | Path, notes: Mapping[str, str]) -> Card:
    if "card" not in notes:
        raise FileFormatError(path, "no card", "weights of ptn, as `bench train ptn` writes them")
    try:
        return from_json(Card, notes["card"], "card")
    except SpecError as error:
        wrong = error.inside(path)
        raise FileFormatError(wrong.where, wrong.found, wrong.expected, wrong.hint) from error


def _model(path: str | Path, config: PtnConfig, tensors: Mapping[str, Tensor]) -> Ptn:
    """Return a model with stored weights; a hostile card costs no memory."""
    with torch.device("meta"):
        wanted = Ptn(config).state_dict()
    check_tensors(path, tensors, wanted)
    model = Ptn(config)
    model.load_state_dict({name: tensors[name].to(torch.float32) for name in wanted})
    return model

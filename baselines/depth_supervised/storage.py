"""Weights and checkpoints of relief networks: safetensors files, which also hold their card."""

import errno
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.optim import Adam

from baselines.depth_supervised.network import ReliefSpec, relief_network
from baselines.optimiser_moments import load_moments, moments_of
from baselines.tensor_files import check_tensors, load_tensors, save_tensors, shortened
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check, from_json, normalise, to_json
from scenegen.common.seeding import Purpose, item_seed

CHECKPOINT, WEIGHTS = "checkpoint.safetensors", "weights.safetensors"
FORMAT_VERSION = 1
METHODS = ("depth-supervised", "view-pairs")
MODEL, ADAM = "model.", "adam."  # beginnings of names


@dataclass(frozen=True)
class Card:
    """What is stored with weights: how they were made.

    Attributes:
        method: one of METHODS, which says what the network learned from.
        network: which network, and how large.
        seed: of the first weights and of every random choice of training.
        iterations, batch: length of training, and images in each batch.
        learning_rate: of Adam; it rises over WARM_UP iterations and falls to 0 along a cosine.
        iteration: number of iterations done.
        data, fingerprint: request and fingerprint of the training file.
        seconds: duration of training.
    """

    method: str
    network: ReliefSpec = field(default_factory=ReliefSpec)
    seed: int = 0
    iterations: int = 1200
    batch: int = 16
    learning_rate: float = 0.003
    iteration: int = 0
    data: str = ""
    fingerprint: str = ""
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        check(self.method in METHODS, "method", self.method, " or ".join(METHODS))
        check(self.seed >= 0, "seed", self.seed, "0 or more")
        check(self.iterations >= 1, "iterations", self.iterations, "1 or more")
        check(self.batch >= 2, "batch", self.batch, "2 or more")
        check(self.learning_rate > 0, "learning rate", self.learning_rate, "a positive number")
        done = 0 <= self.iteration <= self.iterations
        check(done, "iteration", self.iteration, f"0 to {self.iterations}")
        check(self.seconds >= 0, "seconds", self.seconds, "0 or more")
        version = self.format_version
        check(version == FORMAT_VERSION, "format version", version, str(FORMAT_VERSION))


@dataclass(eq=False)
class State:
    """Everything that training changes."""

    network: nn.Module
    optimiser: Adam
    card: Card


def new_state(card: Card) -> State:
    """Return an untrained network, whose weights the seed decides, and its optimiser."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(card.seed, 0, Purpose.WEIGHTS))
        network = relief_network(card.network)
    return _with_optimiser(network, card)


def save_weights(path: str | Path, state: State) -> None:
    """Write weights as 16-bit numbers, and the card; the file is replaced when it is complete."""
    save_tensors(path, shortened(state.network.state_dict()), {"card": to_json(state.card)})


def load_weights(path: str | Path, method: str) -> tuple[nn.Module, Card]:
    """Read a method's weights; the network is in evaluation mode. Raises OSError, FileFormatError.

    The card is checked and shapes are compared before anything is allocated.
    """
    tensors, notes = load_tensors(path)
    if any(name.startswith(MODEL) for name in tensors):
        raise FileFormatError(path, "a checkpoint", "weights", "name the weights beside it")
    card = _card(path, notes, method)
    return _network(path, card, tensors).eval(), card


def save_state(folder: Path, state: State) -> None:
    """Write the folder's checkpoint; the old one stays until this one is complete."""
    moments, count = moments_of(state.optimiser)
    tensors = {MODEL + name: value for name, value in state.network.state_dict().items()}
    tensors |= {ADAM + name: value for name, value in moments.items()}
    save_tensors(folder / CHECKPOINT, tensors, {"card": to_json(state.card), "moments": count})


def load_state(folder: Path, method: str) -> State:
    """Read the checkpoint of a method's run. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "holds no checkpoint to resume", str(folder))
    tensors, notes = load_tensors(path)
    card = _card(path, notes, method)
    own = {start: _beginning(tensors, start) for start in (MODEL, ADAM)}
    state = _with_optimiser(_network(path, card, own[MODEL]), card)
    try:
        load_moments(state.optimiser, own[ADAM], int(notes["moments"]))
        if len(own[MODEL]) + len(own[ADAM]) != len(tensors):
            raise ValueError("tensors that are neither weights nor moments")
    except (KeyError, ValueError) as error:
        raise FileFormatError(path, f"{error}", "a checkpoint of this release") from error
    return state


def _with_optimiser(network: nn.Module, card: Card) -> State:
    network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return State(network, Adam(network.parameters(), lr=card.learning_rate), card)


def _beginning(tensors: Mapping[str, Tensor], start: str) -> dict[str, Tensor]:
    return {k.removeprefix(start): v for k, v in tensors.items() if k.startswith(start)}


def _card(path: str | Path, notes: Mapping[str, str], method: str) -> Card:
    if "card" not in notes:
        expected = f"weights of {method}, as `bench train {method}` writes them"
        raise FileFormatError(path, "no card", expected)
    try:
        card = from_json(Card, notes["card"], "card")
    except SpecError as error:
        wrong = error.inside(path)
        raise FileFormatError(wrong.where, wrong.found, wrong.expected, wrong.hint) from error
    if card.method != method:
        raise FileFormatError(path, f"weights of {card.method}", f"those of {method}")
    return card


def _network(path: str | Path, card: Card, tensors: Mapping[str, Tensor]) -> nn.Module:
    """Return a network with stored weights."""
    with torch.device("meta"):
        wanted = relief_network(card.network).state_dict()
    check_tensors(path, tensors, wanted)
    network = relief_network(card.network)
    for name, value in network.state_dict().items():
        value.copy_(tensors[name])
    return network

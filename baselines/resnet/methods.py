"""The settings of a run, and its files: weights, and checkpoints from which training goes on.

A file holds everything: the settings are JSON in its metadata.
"""

import errno
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.optim import Adam

from baselines.optimiser_moments import load_moments, moments_of
from baselines.resnet.architecture import DEPTHS
from baselines.tensor_files import check_tensors, load_tensors, save_tensors, shortened
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check, from_json, normalise, to_json
from scenegen.common.seeding import Purpose, item_seed

CHECKPOINT, WEIGHTS = "checkpoint.safetensors", "weights.safetensors"


@dataclass(frozen=True)
class Card:
    """Settings of a run and what came of it.

    Attributes:
        method: "cnn" or "siamese".
        answers: number of answers of each question.
        labels: number of labelled questions, the first ones of the file.
        seed: of the initial weights and of the order of the questions.
        depth: 18 or 50 layers of the ResNet; 50 in the paper.
        width: channels of its first stage; 64 in the paper.
        size: side of the images that it takes, pixels; 128 in the paper's released files.
        batch: questions in an iteration.
        iterations: number of steps of Adam.
        learning_rate: of the first step; it falls linearly to 0.
        fingerprint: of the labelled part of the training file.
        iteration, seconds: how many steps are done, and how long they took.
        validation: accuracy on iqtt-val.h5 beside the training file; None where there is none.
    """

    method: str
    answers: int
    labels: int
    seed: int = 0
    depth: int = 18
    width: int = 32
    size: int = 64
    batch: int = 16
    iterations: int = 800
    learning_rate: float = 0.001
    fingerprint: str = ""
    iteration: int = 0
    seconds: float = 0.0
    validation: float | None = None

    def __post_init__(self) -> None:
        normalise(self)
        check(self.depth in DEPTHS, "depth", self.depth, " or ".join(map(str, DEPTHS)))
        for name, low, high in (
            ("answers", 2, 16),
            ("labels", 1, 10**8),
            ("seed", 0, 2**63),
            ("width", 4, 256),
            ("size", 16, 1024),
            ("batch", 1, 4096),
            ("iterations", 1, 10**8),
            ("iteration", 0, self.iterations),
        ):
            value = getattr(self, name)
            check(low <= value <= high, name, value, f"{low} to {high}")
        check(0 < self.learning_rate <= 1, "learning rate", self.learning_rate, "above 0, up to 1")


@dataclass(frozen=True)
class Method:
    """A way to answer questions with a ResNet.

    Attributes:
        name: as in `bench baseline NAME`.
        network: makes the network of a card; it takes images of questions, (Q, 1 + K, 3, S, S), the
            reference first, and gives the scores of the K answers, (Q, K), the highest of which
            is its answer.
        loss: of scores, (Q, K), and right answers, (Q,).
        files: folder of the weights that come with the package.
        any_number: whether a network answers questions of another number of answers than it
            was trained on.
    """

    name: str
    network: Callable[[Card], nn.Module]
    loss: Callable[[Tensor, Tensor], Tensor]
    files: Path
    any_number: bool


@dataclass(eq=False)
class State:
    """Everything that training changes."""

    card: Card
    network: nn.Module
    optimiser: Adam = field(init=False)

    def __post_init__(self) -> None:
        self.optimiser = Adam(self.network.parameters(), lr=self.card.learning_rate)


def new_state(method: Method, card: Card) -> State:
    """Return an untrained network, whose weights the seed decides, and its optimiser."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(card.seed, 0, Purpose.WEIGHTS))
        return State(card, method.network(card))


def save_weights(path: Path, state: State) -> None:
    """Write weights and card, as 16-bit numbers; replaces the file."""
    save_tensors(path, shortened(state.network.state_dict()), {"card": to_json(state.card)})


def load_weights(path: str | Path, method: Method) -> tuple[nn.Module, Card]:
    """Read a network, in evaluation mode, and its card.

    Raises OSError; FileFormatError where the file is damaged or holds something else.
    """
    tensors, notes = load_tensors(path)
    if "moments" in notes:
        raise FileFormatError(path, "a checkpoint", "weights", f"name {WEIGHTS} beside it")
    card = _card(path, notes, method)
    return _network(path, card, tensors, method).eval(), card


def save_state(folder: Path, state: State) -> None:
    """Write the folder's checkpoint; the old one stays until this one is complete."""
    tensors = {f"network.{name}": value for name, value in state.network.state_dict().items()}
    moments, count = moments_of(state.optimiser)
    tensors |= {f"moments.{name}": value for name, value in moments.items()}
    save_tensors(folder / CHECKPOINT, tensors, {"card": to_json(state.card), "moments": count})


def load_state(folder: Path, method: Method) -> State:
    """Read a folder's checkpoint. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "holds no checkpoint to resume", str(folder))
    tensors, notes = load_tensors(path)
    card = _card(path, notes, method)
    own: dict[str, dict[str, Tensor]] = {"network": {}, "moments": {}}
    try:
        for name, value in tensors.items():
            kind, _, rest = name.partition(".")
            own[kind][rest] = value
        state = State(card, _network(path, card, own["network"], method))
        load_moments(state.optimiser, own["moments"], int(notes["moments"]))
    except (KeyError, ValueError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(path, f"{error}", "a checkpoint of this release") from error
    return state


def _card(path: str | Path, notes: Mapping[str, str], method: Method) -> Card:
    try:
        card = from_json(Card, notes.get("card", ""), "card")
    except SpecError as error:
        wrong = error.inside(path)
        hint = f"`bench train {method.name}` writes weights"
        raise FileFormatError(wrong.where, wrong.found, wrong.expected, hint) from error
    if card.method != method.name:
        raise FileFormatError(path, f"weights of {card.method!r:.40}", f"those of {method.name}")
    return replace(card, iteration=min(card.iteration, card.iterations))


def _network(
    path: str | Path, card: Card, tensors: Mapping[str, Tensor], method: Method
) -> nn.Module:
    """Return the card's network with these weights; shapes are compared before it is allocated."""
    with torch.device("meta"):
        check_tensors(path, tensors, method.network(card).state_dict())
    network = method.network(card)
    network.load_state_dict(dict(tensors))
    return network

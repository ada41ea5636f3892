"""Weights and checkpoints of networks that Adam trains: safetensors files that hold their card.

A card is a frozen dataclass: the settings of a run, and what came of it. Weights go by the
network's own names for them; in a checkpoint these begin with NETWORK, and Adam's moments with
MOMENTS.
"""

import errno
import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Generic, ParamSpec, Protocol, TypeVar

import torch
from torch import Tensor, nn
from torch.optim import Adam

from baselines.optimiser_moments import load_moments, moments_of
from baselines.tensor_files import (
    check_tensors,
    load_tensors,
    save_tensors,
    shortened,
    whole_number,
)
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.random.seeding import Purpose, item_seed
from scenegen.common.records import from_json, to_json
from scenegen.files.run_lock import run_lock

CHECKPOINT, WEIGHTS = "checkpoint.safetensors", "weights.safetensors"
NETWORK, MOMENTS = "network.", "moments."


class Seeded(Protocol):
    """What is asked of every card."""

    @property
    def seed(self) -> int:
        """Seed of the first weights."""


CardT = TypeVar("CardT", bound=Seeded)
NetworkT = TypeVar("NetworkT", bound=nn.Module)
Given = ParamSpec("Given")


@dataclass(eq=False)
class State(Generic[CardT, NetworkT]):
    """Everything that training changes."""

    card: CardT
    network: NetworkT
    optimiser: Adam


@dataclass(frozen=True)
class Recipe(Generic[CardT, NetworkT]):
    """How a method's cards are read, and what is made of them.

    Attributes:
        method: name, as in `bench train NAME`.
        card: class of the cards.
        network: makes the untrained network of a card.
        optimiser: makes the optimiser of a card's network.
        check: raises SpecError for the card of another method.
    """

    method: str
    card: type[CardT]
    network: Callable[[CardT], NetworkT]
    optimiser: Callable[[CardT, NetworkT], Adam]
    check: Callable[[CardT], None] = lambda card: None


def new_state(recipe: Recipe[CardT, NetworkT], card: CardT) -> State[CardT, NetworkT]:
    """Return an untrained network, whose weights the card's seed decides, and its optimiser."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(card.seed, 0, Purpose.WEIGHTS))
        network = recipe.network(card)
    return State(card, network, recipe.optimiser(card, network))


def save_weights(path: str | Path, state: State[CardT, NetworkT]) -> None:
    """Write weights as 16-bit numbers, and the card; the file is replaced when it is complete."""
    save_tensors(path, shortened(state.network.state_dict()), {"card": to_json(state.card)})


def load_weights(path: str | Path, recipe: Recipe[CardT, NetworkT]) -> State[CardT, NetworkT]:
    """Read weights; the network is in evaluation mode, and the optimiser new.

    Raises OSError; FileFormatError where the file is damaged or holds something else.
    """
    tensors, notes = load_tensors(path)
    if "moments" in notes:
        raise FileFormatError(path, "a checkpoint", "weights", f"name {WEIGHTS} beside it")
    state = _state(path, recipe, notes, tensors)
    state.network.eval()
    return state


def save_checkpoint(folder: Path, state: State[CardT, NetworkT]) -> None:
    """Write the folder's checkpoint; the old one stays until this one is complete."""
    moments, count = moments_of(state.optimiser)
    tensors = {NETWORK + name: value for name, value in state.network.state_dict().items()}
    tensors |= {MOMENTS + name: value for name, value in moments.items()}
    save_tensors(folder / CHECKPOINT, tensors, {"card": to_json(state.card), "moments": count})


def load_checkpoint(folder: Path, recipe: Recipe[CardT, NetworkT]) -> State[CardT, NetworkT]:
    """Read the folder's checkpoint. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "holds no checkpoint to resume", str(folder))
    tensors, notes = load_tensors(path)
    weights, moments = (_beginning(start, tensors) for start in (NETWORK, MOMENTS))
    state = _state(path, recipe, notes, weights)
    try:
        load_moments(state.optimiser, moments, whole_number(notes, "moments"))
        if len(weights) + len(moments) != len(tensors):
            raise ValueError("tensors that are neither weights nor moments")
    except (KeyError, ValueError) as error:
        raise FileFormatError(path, f"{error}", "a checkpoint of this release") from error
    return state


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Make the folder of a run, and keep other runs out of it for the block.

    New folders in which nothing was written are removed. Raises SceneGenError where another run
    trains there, whose checkpoints this one would replace; OSError.
    """
    new = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with run_lock(folder / ".lock", folder, "wait for it, or name another folder"):
            yield
    finally:
        for one in new:
            with suppress(OSError):  # it is not empty
                one.rmdir()


def one_at_a_time(train: Callable[Given, Path]) -> Callable[Given, Path]:
    """Let a function that trains have its `run_folder` to itself, as `alone_in`."""
    signature = inspect.signature(train)

    @wraps(train)
    def alone(*given: Given.args, **settings: Given.kwargs) -> Path:
        folder = signature.bind(*given, **settings).arguments["run_folder"]
        with alone_in(Path(folder)):
            return train(*given, **settings)

    return alone


def check_new(folder: Path) -> None:
    """Raise FileExistsError where a new run would replace a checkpoint or weights."""
    if (folder / CHECKPOINT).exists():
        what = "holds a checkpoint; say --resume, or name another folder"
        raise FileExistsError(errno.EEXIST, what, str(folder))
    if (folder / WEIGHTS).exists():
        what = "is there, and a new run would replace it; name another folder"
        raise FileExistsError(errno.EEXIST, what, str(folder / WEIGHTS))


def check_data(where: object, found: str, trained: str) -> None:
    """Raise SpecError unless data have the fingerprint of those that a run was trained on."""
    if found != trained:
        expected = f"{trained[:12]}, on which the run was trained"
        hint = "resume with the same data"
        raise SpecError(where, f"fingerprint {found[:12]}", expected, hint)


def _beginning(start: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {k.removeprefix(start): v for k, v in tensors.items() if k.startswith(start)}


def _state(
    path: str | Path,
    recipe: Recipe[CardT, NetworkT],
    notes: Mapping[str, str],
    tensors: Mapping[str, Tensor],
) -> State[CardT, NetworkT]:
    """Return the network of a file's card, with the file's weights, and a new optimiser.

    Shapes are compared before anything is allocated, so that a hostile card costs no memory.
    """
    if "card" not in notes:
        name = recipe.method
        raise FileFormatError(path, "no card", f"weights of {name}, as `bench train {name}` writes")
    try:
        card = from_json(recipe.card, notes["card"], "card")
        recipe.check(card)
    except SpecError as error:
        wrong = error.inside(path)
        raise FileFormatError(wrong.where, wrong.found, wrong.expected, wrong.hint) from error
    with torch.device("meta"):
        check_tensors(path, tensors, recipe.network(card).state_dict())
    network = recipe.network(card)
    network.load_state_dict(dict(tensors))
    return State(card, network, recipe.optimiser(card, network))

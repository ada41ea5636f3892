"""Weights and checkpoints: safetensors files that hold their card. Reading them runs no code.

Weights go by the network's own names for them. In a checkpoint these begin with "network.", and the
moments of each optimiser with its name. One run has a folder at a time.
"""

import errno
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn
from torch.optim import Adam

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.random.seeding import Purpose, item_seed
from scenegen.common.records import LARGEST, check, from_json, normalise, to_json
from scenegen.files.input_file import describing
from scenegen.files.new_file import written_beside
from scenegen.files.sets.workspace import run_lock

CHECKPOINT, WEIGHTS = "checkpoint.safetensors", "weights.safetensors"
CONTENTS = ("weights 1", "checkpoint 1")  # by version; one note, as their order is not kept
NETWORK = "network."
MOMENTS = ("exp_avg", "exp_avg_sq", "step")  # of Adam
Ranges = Mapping[str, tuple[float, float]]  # of numbers, by name
OTHER_CARD = "these are weights of another configuration than the card's"
NetworkT = TypeVar("NetworkT", bound=nn.Module)


@dataclass(frozen=True)
class Settings:
    """Settings that networks and training of every baseline have; each adds its own.

    Attributes:
        seed: of the first weights and of every random choice of training.
        size: side of the images that the networks take, pixels.
        iterations, batch: length of training, and images or questions in each batch.
        learning_rate: of Adam, the largest.
    """

    RANGES: ClassVar[Ranges] = {}  # of further numbers, or narrower ones
    seed: int = 0
    size: int = 64
    iterations: int = 1000
    batch: int = 16
    learning_rate: float = 0.001

    def __post_init__(self) -> None:
        ranges = {"seed": (0, 2**63), "learning_rate": (1e-12, 1), "size": (8, 1024)}
        counts = {"iterations": (1, LARGEST), "batch": (1, LARGEST)}
        check_numbers(self, {**ranges, **counts, **self.RANGES})


@dataclass(frozen=True)
class Card:
    """What a file of weights says of itself: settings of the run, and what was done.

    Attributes:
        method: name of the method, as in `bench train NAME`.
        settings: of networks and training, `Settings` or another frozen dataclass with at least
            `seed`, `iterations` and `learning_rate`; each method's card declares its type.
        labels: how many answers of questions training was given.
        data, fingerprint: request and fingerprint of the training file.
        iteration, seconds: how many iterations are done, and how long they took.
    """

    method: str
    settings: Any
    labels: int = 0
    data: str = ""
    fingerprint: str = ""
    iteration: int = 0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        last = self.settings.iterations
        check_numbers(self, {"labels": (0, LARGEST), "iteration": (0, last), "seconds": (0, 1e9)})


def check_numbers(record: Any, ranges: Ranges) -> None:
    """Give a record's fields Python's own types, and raise SpecError for a number out of range."""
    normalise(record)
    for name, (low, high) in ranges.items():
        value = getattr(record, name)
        check(low <= value <= high, name.replace("_", " "), value, f"{low:g} to {high:g}")


CardT = TypeVar("CardT", bound=Card)


def one_adam(_card: Any, network: nn.Module) -> dict[str, Adam]:
    """Return one optimiser of all weights, whose learning rate `fit` sets."""
    return {"adam": Adam(network.parameters())}


@dataclass(frozen=True)
class Method(Generic[CardT, NetworkT]):
    """How the cards of a method are read, and what is made of them.

    Attributes:
        name: as in `bench train NAME`.
        card: class of the cards.
        network: makes the untrained network of a card.
        optimisers: makes the optimisers, by name, of a card's network.
        kept: beginnings of the names that files of weights hold; all by default.
        gone: settings that cards of earlier versions hold and that are no more, as JSON, at the
            values that switched them off; with other values a card is refused.
    """

    name: str
    card: type[CardT]
    network: Callable[[CardT], NetworkT]
    optimisers: Callable[[CardT, NetworkT], dict[str, Adam]] = one_adam
    kept: tuple[str, ...] = ("",)
    gone: tuple[str, ...] = ()


@dataclass(eq=False)
class State(Generic[CardT, NetworkT]):
    """Everything that training changes."""

    card: CardT
    network: NetworkT
    optimisers: dict[str, Adam]

    def to(self, device: torch.device) -> None:
        """Move weights and moments to a device."""
        self.network.to(device)
        for optimiser in self.optimisers.values():
            optimiser.load_state_dict(optimiser.state_dict())


def new_state(method: Method[CardT, NetworkT], card: CardT) -> State[CardT, NetworkT]:
    """Return an untrained network, whose weights the card's seed decides, and its optimisers."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(card.settings.seed, 0, Purpose.WEIGHTS))
        network = method.network(card)
    return State(card, network, method.optimisers(card, network))


def save_weights(
    path: str | Path, method: Method[CardT, NetworkT], network: NetworkT, card: CardT
) -> None:
    """Write weights and their card; the file is replaced when it is complete.

    Numbers are stored as float16; tensors beyond its range keep their type.
    """
    kept = {}
    for name, value in _stored_tensors(method, network.state_dict()).items():
        short = value.half() if value.is_floating_point() else value
        kept[name] = short if torch.isfinite(short).all() else value
    save_tensors(path, kept, {CONTENTS[0]: to_json(card)})


def load_weights(path: str | Path, method: Method[CardT, NetworkT]) -> tuple[NetworkT, CardT]:
    """Read weights; the network is in evaluation mode.

    Raises OSError; FileFormatError where the file is damaged or holds something else.
    """
    tensors, card = _load(path, method, CONTENTS[0])
    with torch.device("meta"):  # so that a hostile card costs no memory
        expected = _stored_tensors(method, method.network(card).state_dict())
    check_tensors(path, tensors, expected)
    network = method.network(card)
    network.load_state_dict(tensors, strict=False)
    return network.eval(), card


def bundled(folder: Path, method: Method[Any, Any], name: str = "") -> Path:
    """Return the weights of a method that come with the package.

    Args:
        name: of the file; by default that of the method.

    Raises SpecError where there are none.
    """
    path = folder / f"{name or method.name}.safetensors"
    hint = f"`bench train {method.name}` makes some for `bench baseline {method.name} --weights`"
    if not path.is_file():
        raise SpecError("weights", f"none of {method.name} in this package", "a file", hint)
    return path


def save_checkpoint(folder: Path, state: State[CardT, NetworkT]) -> None:
    """Write the folder's checkpoint; the old one stays until this one is complete."""
    tensors = {NETWORK + name: value for name, value in state.network.state_dict().items()}
    tensors |= moments_of(state.optimisers)
    save_tensors(folder / CHECKPOINT, tensors, {CONTENTS[1]: to_json(state.card)})


def load_checkpoint(folder: Path, method: Method[CardT, NetworkT]) -> State[CardT, NetworkT]:
    """Read the folder's checkpoint. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "holds no checkpoint to resume", str(folder))
    tensors, card = _load(path, method, CONTENTS[1])
    with torch.device("meta"):
        like = method.network(card)
        expected = {NETWORK + name: value for name, value in like.state_dict().items()}
        expected |= moments_of(method.optimisers(card, like))
    check_tensors(path, tensors, expected)
    network = method.network(card)
    network.load_state_dict({name: tensors[NETWORK + name] for name in network.state_dict()})
    state = State(card, network, method.optimisers(card, network))
    for kind, optimiser in state.optimisers.items():
        numbers = range(len(optimiser.param_groups[0]["params"]))
        moments = {i: {name: tensors[f"{kind}.{i}.{name}"] for name in MOMENTS} for i in numbers}
        optimiser.load_state_dict({**optimiser.state_dict(), "state": moments})
    return state


def moments_of(optimisers: Mapping[str, Adam]) -> dict[str, Tensor]:
    """Return the moments of all parameters by name; zeros where no loss has trained one yet."""
    moments: dict[str, Tensor] = {}
    for kind, optimiser in optimisers.items():
        for number, weights in enumerate(optimiser.param_groups[0]["params"]):
            zeros = torch.zeros_like(weights), torch.zeros_like(weights), torch.zeros(())
            state = optimiser.state.get(weights) or dict(zip(MOMENTS, zeros, strict=True))
            moments |= {f"{kind}.{number}.{name}": state[name] for name in MOMENTS}
    return moments


def save_tensors(path: str | Path, tensors: Mapping[str, Tensor], notes: dict[str, str]) -> None:
    """Write tensors and notes; the file appears, or is replaced, when it is complete."""
    kept = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    with written_beside(path, overwrite=True) as temporary:
        temporary.write_bytes(save(kept, metadata=notes or None))


def load_tensors(path: str | Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Read tensors and notes. Raises OSError, FileFormatError."""
    path = Path(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        raise FileFormatError(path, "a pipe or a device", "a regular file")  # it may have no end
    if not path.exists() and path.suffix != ".safetensors":
        text = "no such file; give a .safetensors file, or leave out --weights for bundled weights"
        raise FileNotFoundError(errno.ENOENT, text, str(path))
    with path.open("rb"):  # raises Python's own errors for a missing file or a folder
        pass
    try:
        with safe_open(path, "pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except SafetensorError as error:
        raise FileFormatError(path, f"not a safetensors file, or damaged ({error})") from error


def check_tensors(
    path: str | Path, tensors: Mapping[str, Tensor], expected: Mapping[str, Tensor]
) -> None:
    """Raise FileFormatError unless the tensors of a file are finite and have the expected shapes.

    Args:
        path: of the file, for messages.
        tensors: what was read.
        expected: made on torch's device "meta", so that a hostile card costs no memory.
    """
    for name in sorted(expected.keys() ^ tensors.keys()):
        pair = ("nothing", "a tensor") if name in expected else ("a tensor", "nothing")
        raise FileFormatError(f"{path}: {name}", *pair, OTHER_CARD)
    for name, like in expected.items():
        value, place = tensors[name], f"{path}: {name}"
        if value.shape != like.shape:
            shape, wanted = (f"shape {tuple(shape)}" for shape in (value.shape, like.shape))
            raise FileFormatError(place, shape, wanted, OTHER_CARD)
        kinds = [(v.is_floating_point(), v.is_complex()) for v in (value, like)]
        if kinds[0] != kinds[1] or (value.element_size() == 1 and like.element_size() > 1):
            raise FileFormatError(place, value.dtype, like.dtype)
        cast = value.to(like.dtype)
        not_negative = name.endswith(("running_var", "exp_avg_sq", "step"))
        if not torch.isfinite(cast).all() or (not_negative and (cast < 0).any()):
            raise FileFormatError(place, "it holds NaN, infinity or invalid negative numbers")


def _stored_tensors(
    method: Method[CardT, NetworkT], tensors: Mapping[str, Tensor]
) -> dict[str, Tensor]:
    return {name: value for name, value in tensors.items() if name.startswith(method.kept)}


def _load(
    path: str | Path, method: Method[CardT, NetworkT], content: str
) -> tuple[dict[str, Tensor], CardT]:
    """Return tensors and card of a file. Raises OSError, FileFormatError."""
    tensors, notes = load_tensors(path)
    if content not in notes:
        hint = f"use {WEIGHTS} next to it" if CONTENTS[1] in notes else ""
        stored = ", ".join(notes) or "no card"
        raise FileFormatError(path, f"{stored:.40}", f"{content} of {method.name}", hint)
    text = notes[content]
    for setting in method.gone:
        text = text.replace(setting, "")
    with describing(str(path)):
        card = from_json(method.card, text, "card")
        check(card.method == method.name, "method", f"{card.method:.40}", method.name)
    return tensors, card


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Make the folder of a run, and keep other runs out of it for the block.

    New folders in which nothing was written are removed. Raises SceneGenError where another run
    trains there, whose checkpoints this one would replace; OSError.
    """
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with run_lock(folder / ".lock", folder, "wait for it, or name another folder"):
            yield
    finally:
        for path in new:
            with suppress(OSError):  # it is not empty
                path.rmdir()


def check_new(folder: Path) -> None:
    """Raise FileExistsError where a new run would replace a checkpoint or weights."""
    for name, hint in ((CHECKPOINT, "use --resume, or another folder"), (WEIGHTS, "name another")):
        if (folder / name).exists():
            raise FileExistsError(errno.EEXIST, f"an earlier run made it; {hint}", folder / name)


def begun(
    method: Method[CardT, NetworkT],
    card: CardT,
    earlier: State[CardT, NetworkT] | None,
    where: object,
) -> State[CardT, NetworkT]:
    """Return the state from which a run goes on: that of its checkpoint, or a new one.

    Args:
        card: of a new run on these data.
        where: the data, for messages.

    Raises SpecError where the earlier state saw other data.
    """
    state = new_state(method, card) if earlier is None else earlier
    trained_on, mark = state.card.fingerprint, card.fingerprint
    if mark != trained_on:
        expected = f"{trained_on[:12]}, on which the run was trained"
        raise SpecError(where, f"recipe hash {mark[:12]}", expected, "resume with the same data")
    return state

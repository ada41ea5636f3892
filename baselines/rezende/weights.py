"""Weights and checkpoints: safetensors files that hold a card, which says where they come from."""

import errno
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor
from torch.optim import Adam

from baselines.optimiser_moments import load_moments, moments_of
from baselines.rezende.network import Model
from baselines.tensor_files import check_tensors, load_tensors, save_tensors, shortened
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import LARGEST, check, from_json, normalise, to_json
from scenegen.common.seeding import Purpose, item_seed

CHECKPOINT, WEIGHTS = "checkpoint.safetensors", "weights.safetensors"
FILES = Path(__file__).with_name("files")
FORMAT_VERSION = 1


@dataclass(frozen=True)
class Card:
    """Settings of model and training, and where the weights come from.

    Attributes:
        size: height and width that images are reduced to, pixels.
        code: length of a code.
        iterations, batch: length of training, and images in each batch.
        pairs: antithetic pairs of meshes that are rendered for each image of a batch.
        width: standard deviation of the meshes' offsets about the decoder's, before smoothing,
            where the sphere has radius 1.
        noise: standard deviation of pixels about the rendered ones, in radiance.
        spread: standard deviation of offsets before anything is seen, about the sphere.
        learning_rate: of Adam; it falls linearly to 0 over the second half of training.
        seed: of the first weights and of every random choice.
        labels: answers that the head was trained on; 0 where it was not.
        fingerprint: of the data.
        iteration, seconds: what has been done.
    """

    size: int = 32
    code: int = 64
    iterations: int = 2_000
    batch: int = 32
    pairs: int = 4
    width: float = 0.2
    noise: float = 0.1
    spread: float = 1.0
    learning_rate: float = 0.001
    seed: int = 0
    labels: int = 0
    fingerprint: str = ""
    iteration: int = 0
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        for name, low, high in (
            ("size", 16, 128), ("code", 2, 1024), ("iterations", 1, LARGEST), ("batch", 1, 1024),
            ("pairs", 1, 256), ("width", 1e-4, 1.0), ("noise", 1e-3, 10.0), ("spread", 1e-3, 1e6),
            ("learning_rate", 1e-8, 1.0), ("seed", 0, LARGEST), ("labels", 0, LARGEST),
            ("iteration", 0, self.iterations), ("format_version", FORMAT_VERSION, FORMAT_VERSION),
        ):  # fmt: skip
            value = getattr(self, name)
            check(low <= value <= high, name.replace("_", " "), value, f"{low:g} to {high:g}")
        check(self.size % 8 == 0, "size", self.size, "a multiple of 8")


@dataclass(eq=False)
class State:
    """Everything that training changes."""

    card: Card
    model: Model
    optimiser: Adam


def new_state(card: Card) -> State:
    """Return an untrained model, whose weights the seed decides, and its optimiser."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(card.seed, 0, Purpose.WEIGHTS))
        return _with_optimiser(card, Model(card.size, card.code))


def _with_optimiser(card: Card, model: Model) -> State:
    learned = [*model.encoder.parameters(), *model.decoder.parameters()]
    return State(card, model, Adam(learned, lr=card.learning_rate))


def save_state(folder: Path, state: State) -> None:
    """Write the folder's checkpoint; the old one stays until this one is complete."""
    moments, count = moments_of(state.optimiser)
    tensors = {f"model.{name}": value for name, value in state.model.state_dict().items()}
    tensors |= {f"moments.{name}": value for name, value in moments.items()}
    notes = {"card": to_json(state.card), "moments": count}
    save_tensors(folder / CHECKPOINT, tensors, notes)


def load_state(folder: Path) -> State:
    """Read a folder's checkpoint. Raises OSError, FileFormatError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "holds no checkpoint to resume", str(folder))
    tensors, notes = load_tensors(path)
    card = _card(path, notes)
    state = _with_optimiser(card, _model(path, card, _own("model.", tensors)))
    moments = _own("moments.", tensors)
    try:
        strange = sorted(set(tensors) - {f"model.{k}" for k in _own("model.", tensors)})
        strange = [name for name in strange if not name.startswith("moments.")]
        if strange:
            raise ValueError(f"{strange[0]}, not expected")
        load_moments(state.optimiser, moments, int(notes["moments"]))
    except (KeyError, ValueError) as error:
        raise FileFormatError(path, f"{error}", "a checkpoint of this release") from error
    return state


def save_weights(path: Path, model: Model, card: Card) -> None:
    """Write weights in half precision, and their card within the file."""
    save_tensors(path, shortened(model.state_dict()), {"card": to_json(card)})


def load_weights(path: str | Path) -> tuple[Model, Card]:
    """Read weights and their card; the model is in evaluation mode.

    Raises OSError; FileFormatError where the file is damaged or is no file of weights.
    """
    tensors, notes = load_tensors(path)
    if any(name.startswith("model.") for name in tensors):
        raise FileFormatError(path, "a checkpoint", "weights", "name the weights beside it")
    card = _card(Path(path), notes)
    return _model(Path(path), card, tensors).eval(), card


def bundled(labels: int = 0) -> Path:
    """Return the weights of the package for questions. Raises SpecError where there are none."""
    path = FILES / f"questions-{labels}.safetensors"
    if not path.is_file():
        hint = "train some with `bench train rezende`"
        raise SpecError("weights", "none bundled", "a .safetensors file", hint)
    return path


def _card(path: Path, notes: dict[str, str]) -> Card:
    try:
        return from_json(Card, notes.get("card", ""), "card")
    except SpecError as error:
        wrong = error.inside(path)
        raise FileFormatError(wrong.where, wrong.found, wrong.expected, wrong.hint) from error


def _own(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}


def _model(path: Path, card: Card, tensors: dict[str, Tensor]) -> Model:
    """Return a model with stored tensors; shapes are compared before memory is allocated."""
    with torch.device("meta"):
        wanted = Model(card.size, card.code).state_dict()
    check_tensors(path, tensors, wanted)
    model = Model(card.size, card.code)
    model.load_state_dict(tensors)
    return model

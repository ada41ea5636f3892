"""Weights and checkpoints: tensors as safetensors, the configuration as JSON beside them.

Reading either runs no code from it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.new_file import written_beside
from scenegen.common.records import check, from_json, normalise

FORMAT_VERSION = 1
KEPT = ("encoder", "decoder", "prior")
PARTS = (*KEPT, "critic", "statistics")
LARGEST_JSON = 1_000_000  # bytes


@dataclass(frozen=True)
class Card:
    """What is told beside weights.

    Attributes:
        config: of the model.
        iteration: how far it was trained.
        data: what it was trained on, the file's spec as JSON.
        fingerprint: of that file.
        labels: how many answers it was given, of questions.
        classes: names of the labels, in order, of a conditional model.
        seconds: of training.
    """

    config: ModelConfig
    iteration: int = 0
    data: str = ""
    fingerprint: str = ""
    labels: int = 0
    classes: tuple[str, ...] = ()
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        version, known = self.format_version, self.config.networks.classes
        check(version == FORMAT_VERSION, "format version", version, str(FORMAT_VERSION))
        told = len(self.classes)
        check(told == known, "classes", told, f"{known}, as the networks have")


def save_weights(
    path: str | Path, model: Pix2Shape, card: Card, dtype: torch.dtype = torch.float16
) -> None:
    """Write what prediction and sampling need, and the card beside; replaces both.

    Args:
        path: ends in .safetensors; the card gets the same name with .json.
        dtype: of the stored numbers; tensors beyond its range keep their own.
    """
    tensors = {
        name: value.to(dtype) if value.is_floating_point() else value
        for name, value in model.state_dict().items()
        if name.split(".")[0] in KEPT
    }
    for name, value in model.state_dict().items():
        if name in tensors and not torch.isfinite(tensors[name]).all():
            tensors[name] = value  # as it is where it is beyond half precision's range
    save_tensors(path, tensors, {})
    save_card(path, card)


def save_tensors(path: str | Path, tensors: Mapping[str, Tensor], notes: dict[str, str]) -> None:
    """Write tensors; the file appears, or is replaced, when it is complete."""
    kept = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    with written_beside(path, overwrite=True) as temporary:
        temporary.write_bytes(save(kept, metadata=notes or None))


def save_card(path: str | Path, card: Card) -> None:
    """Write the JSON beside weights, or replace it."""
    text = json.dumps(card, default=vars, indent=1, sort_keys=True)
    with written_beside(Path(path).with_suffix(".json"), overwrite=True) as temporary:
        temporary.write_text(text + "\n")


def load_card(path: str | Path) -> Card:
    """Read the JSON beside weights. Raises OSError, FileFormatError."""
    beside = Path(path).with_suffix(".json")
    if beside.stat().st_size > LARGEST_JSON:
        raise FileFormatError(f"{beside}: over {LARGEST_JSON} bytes, expected a configuration")
    text = beside.read_bytes()
    try:
        return from_json(Card, text, "card")
    except SpecError as error:
        raise FileFormatError(f"{beside}: {_other_version(text) or error}") from error


def _other_version(text: bytes) -> str | None:
    """Say so where a card is of another version: its fields may have other names."""
    try:
        version = json.loads(text)["format_version"]
    except (ValueError, RecursionError, KeyError, TypeError):
        return None
    told = f"format version {version!r:.20}, this release reads {FORMAT_VERSION}"
    return told if version != FORMAT_VERSION else None


def load_tensors(path: str | Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Read tensors and notes. Raises OSError, FileFormatError."""
    path = Path(path)
    with path.open("rb"):  # so that a missing file or a folder is told as Python tells it
        pass
    try:
        with safe_open(path, "pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except SafetensorError as error:
        raise FileFormatError(f"{path}: not a safetensors file, or damaged: {error}") from error


def load_model(path: str | Path) -> tuple[Pix2Shape, Card]:
    """Read weights and their card: the model in evaluation mode.

    Raises:
        OSError: no such file.
        FileFormatError: damaged, not of the card's configuration, or not finite.
    """
    card = load_card(path)
    tensors, _ = load_tensors(path)
    if any(name.startswith("model.") for name in tensors):
        raise FileFormatError(f"{path}: a checkpoint; name the weights beside it")
    return load_into(card, tensors, path, KEPT).eval(), card


def load_into(
    card: Card, tensors: Mapping[str, Tensor], path: str | Path, parts: tuple[str, ...] = PARTS
) -> Pix2Shape:
    """Return the card's model with stored tensors. Raises FileFormatError unless all parts fit.

    Shapes are compared before anything is allocated.
    """
    with torch.device("meta"):
        own: dict[str, Any] = Pix2Shape(card.config).state_dict()
    wanted = {name: value for name, value in own.items() if name.split(".")[0] in parts}
    missing, unknown = sorted(wanted.keys() - tensors), sorted(tensors.keys() - own)
    if missing or unknown:
        what = f"{missing[0]} is missing" if missing else f"{unknown[0]} is not expected"
        raise FileFormatError(f"{path}: weights of another configuration: {what}")
    for name, value in wanted.items():
        found = tensors[name]
        if found.shape != value.shape:
            raise FileFormatError(
                f"{path}: weights of another configuration: {name} has shape"
                f" {tuple(found.shape)}, expected {tuple(value.shape)}"
            )
        kinds = [(v.is_floating_point(), v.is_complex()) for v in (found, value)]
        if kinds[0] != kinds[1] or (found.element_size() == 1 and value.element_size() > 1):
            raise FileFormatError(f"{path}: {name} is {found.dtype}, expected {value.dtype}")
        cast = found.to(value.dtype)
        if not torch.isfinite(cast).all() or (name.endswith("running_var") and (cast < 0).any()):
            raise FileFormatError(f"{path}: {name} is not finite, or a variance below 0")
    model = Pix2Shape(card.config)
    for name, value in model.state_dict().items():
        if name in wanted:
            value.copy_(tensors[name])
    return model

"""Weights as safetensors files, and a card of the configuration as JSON beside them.

Checkpoints (`training/state.py`) are stored in the same way. Reading runs no code of the files.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.pix2shape.network.config import TAUGHT_DEPTH, ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.tensor_files import check_tensors, load_tensors, refuse_pipe, save_tensors, shortened
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check, from_json, normalise
from scenegen.files.new_file import write_text

FORMAT_VERSION = 1
KEPT = ("encoder", "decoder", "prior")  # the networks that predicting and sampling need
LEARNED = ("encoder", "decoder", "critic", "statistics")  # those of a checkpoint
LARGEST_JSON = 1_000_000  # bytes
PRECISIONS = ("32", "bf16")


@dataclass(frozen=True)
class Card:
    """What is stored beside weights: where they come from.

    Attributes:
        config: configuration of model and training.
        iteration: number of training iterations done.
        data: spec of the training file, as JSON.
        fingerprint: that of the training file.
        labels: number of answers that training on questions was given.
        earlier_labels: as many as the runs were given whose weights this one began from, added up.
        earlier_depth: whether any of those runs learned from true depth maps.
        precision: of the networks in training, one of PRECISIONS.
        classes: names of the object classes, in order, of a conditional model.
        seconds: duration of training.
    """

    config: ModelConfig
    iteration: int = 0
    data: str = ""
    fingerprint: str = ""
    labels: int = 0
    earlier_labels: int = 0
    earlier_depth: bool = False
    precision: str = "32"
    classes: tuple[str, ...] = ()
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        version, known = self.format_version, self.config.networks.classes
        check(version == FORMAT_VERSION, "format version", version, str(FORMAT_VERSION))
        for name in ("iteration", "labels", "earlier_labels", "seconds"):
            count = getattr(self, name)
            check(count >= 0, name.replace("_", " "), count, "0 or more")
        expected = f"one of {', '.join(PRECISIONS)}"
        check(self.precision in PRECISIONS, "precision", self.precision, expected)
        told = len(self.classes)
        check(told == known, "classes", told, f"{known}, as the networks have")

    @property
    def method(self) -> str:
        """The name of its submissions: that of the configuration, unless depth taught it before."""
        return TAUGHT_DEPTH if self.earlier_depth else self.config.method


def save_weights(
    path: str | Path, model: Pix2Shape, card: Card, dtype: torch.dtype = torch.float16
) -> None:
    """Write the networks that predicting and sampling need, and the card; replaces both files.

    Args:
        path: ends in .safetensors; the card gets the same name with .json.
        dtype: type of the stored numbers; tensors beyond its range keep their own.
    """
    kept = {k: v for k, v in model.state_dict().items() if k.split(".")[0] in KEPT}
    save_tensors(path, shortened(kept, dtype), {})
    save_card(path, card)


def save_card(path: str | Path, card: Card) -> None:
    """Write the JSON beside weights, or replace it."""
    text = json.dumps(card, default=vars, indent=1, sort_keys=True)
    write_text(Path(path).with_suffix(".json"), text + "\n", overwrite=True)


def load_card(path: str | Path) -> Card:
    """Read the JSON beside weights. Raises OSError, FileFormatError."""
    beside = Path(path).with_suffix(".json")
    refuse_pipe(beside)
    if beside.stat().st_size > LARGEST_JSON:
        raise FileFormatError(beside, f"over {LARGEST_JSON} bytes", "a card of weights")
    text = beside.read_bytes()
    try:
        return from_json(Card, text, "card")
    except SpecError as error:
        _check_version(beside, text)
        wrong = error.inside(beside)
        raise FileFormatError(wrong.where, wrong.found, wrong.expected, wrong.hint) from error


def _check_version(path: Path, text: bytes) -> None:
    """Raise FileFormatError where a card has another version, whose fields may differ."""
    try:
        version = json.loads(text)["format_version"]
    except (ValueError, RecursionError, KeyError, TypeError):
        return
    if version != FORMAT_VERSION:
        raise FileFormatError(path, f"format version {version!r:.20}", str(FORMAT_VERSION))


def load_model(path: str | Path) -> tuple[Pix2Shape, Card]:
    """Read weights and their card; the model is in evaluation mode.

    Raises:
        OSError: a file is missing.
        FileFormatError: a file is damaged, or the weights are not finite or do not fit the card.
    """
    card = load_card(path)
    tensors, _ = load_tensors(path)
    if any(name.startswith("model.") for name in tensors):
        raise FileFormatError(path, "a checkpoint", "weights", "name the weights beside it")
    return load_into(card, tensors, path, KEPT).eval(), card


def load_into(
    card: Card, tensors: Mapping[str, Tensor], path: str | Path, parts: tuple[str, ...]
) -> Pix2Shape:
    """Return the card's model with stored tensors in some of its networks, `parts`.

    Shapes are compared before anything is allocated, so that a hostile card costs no memory.
    Raises FileFormatError unless every tensor fits.
    """
    with torch.device("meta"):
        own: dict[str, Any] = Pix2Shape(card.config).state_dict()
    wanted = {name: value for name, value in own.items() if name.split(".")[0] in parts}
    check_tensors(path, tensors, wanted, own.keys())
    model = Pix2Shape(card.config)
    for name, value in model.state_dict().items():
        if name in wanted:
            value.copy_(tensors[name])
    return model

"""Weights and checkpoints as safetensors files; reading them runs no code."""

from collections.abc import Collection, Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from scenegen.common.errors import FileFormatError
from scenegen.files.new_file import written_beside


def save_tensors(path: str | Path, tensors: Mapping[str, Tensor], notes: dict[str, str]) -> None:
    """Write tensors and notes; the file appears, or is replaced, when it is complete."""
    kept = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    with written_beside(path, overwrite=True) as temporary:
        temporary.write_bytes(save(kept, metadata=notes or None))


def shortened(
    tensors: Mapping[str, Tensor], dtype: torch.dtype = torch.float16
) -> dict[str, Tensor]:
    """Return floating-point tensors as another type; those beyond its range keep their own."""
    kept: dict[str, Tensor] = {}
    for name, value in tensors.items():
        short = value.to(dtype) if value.is_floating_point() else value
        kept[name] = short if torch.isfinite(short).all() else value
    return kept


def refuse_pipe(path: Path) -> None:
    """Raise FileFormatError for a pipe or a device, which may have no end."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise FileFormatError(path, "a pipe or a device", "a regular file")


def load_tensors(path: str | Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Read tensors and notes. Raises OSError, FileFormatError."""
    path = Path(path)
    refuse_pipe(path)
    with path.open("rb"):  # raises Python's own errors for a missing file or a folder
        pass
    try:
        with safe_open(path, "pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except SafetensorError as error:
        raise FileFormatError(path, f"no safetensors file, or a damaged one ({error})") from error


def whole_number(notes: Mapping[str, str], name: str) -> int:
    """Return a note that is a number from 0. Raises ValueError, which tells what is there."""
    text = notes.get(name, "")
    if not (text.isascii() and text.isdecimal() and len(text) < 19):
        raise ValueError(f"{name} {text!r:.40}")
    return int(text)


def check_tensors(
    path: str | Path,
    tensors: Mapping[str, Tensor],
    wanted: Mapping[str, Tensor],
    known: Collection[str] | None = None,
) -> None:
    """Raise FileFormatError unless the tensors of a file are those of a model.

    Args:
        path: of the file, for messages.
        tensors: what was read.
        wanted: the model's own; make them on torch's device "meta", so that a hostile configuration
            costs no memory.
        known: names that the file may hold; those that are wanted by default.
    """
    known = wanted.keys() if known is None else known
    missing, unknown = sorted(wanted.keys() - tensors), sorted(tensors.keys() - set(known))
    other = "these are weights of another configuration than the card's"
    if missing:
        raise FileFormatError(f"{path}: {missing[0]}", "nothing", "a tensor", other)
    if unknown:
        raise FileFormatError(f"{path}: {unknown[0]}", "a tensor", "nothing", other)
    for name, value in wanted.items():
        found = tensors[name]
        if found.shape != value.shape:
            shape, expected = (f"shape {tuple(one.shape)}" for one in (found, value))
            raise FileFormatError(f"{path}: {name}", shape, expected, other)
        kinds = [(v.is_floating_point(), v.is_complex()) for v in (found, value)]
        if kinds[0] != kinds[1] or (found.element_size() == 1 and value.element_size() > 1):
            raise FileFormatError(f"{path}: {name}", found.dtype, value.dtype)
        cast = found.to(value.dtype)
        if not torch.isfinite(cast).all() or (name.endswith("running_var") and (cast < 0).any()):
            raise FileFormatError(f"{path}: {name}", "NaN, infinity or a variance below 0")

"""The reference model's commands run inside this process, and files for them to work on."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from click.testing import CliRunner
from h5_edits import damaged_chunk
from pix2shape_models import edited, of_questions, origin, tiny, written

import cli


def invoke(group: Any, *arguments: object) -> Any:
    """Run a command inside this process, which raises what the command raises."""
    return CliRunner().invoke(group, [str(a) for a in arguments], catch_exceptions=False)


def pix2shape(*arguments: object) -> Any:
    return invoke(cli.pix2shape, *arguments)


def bench(*arguments: object) -> Any:
    return invoke(cli.bench, *arguments)


def train(*more: object, data: str = "large.h5", out: str = "run") -> Any:
    start = ("train", "--data", data, "--out", out, "--workers", 0, "--device", "cpu")
    return pix2shape(*start, *more)


def prepare(folder: Path, rooms: Path, questions: Path, make_rooms: Callable[..., Path]) -> Path:
    """Put rooms, questions, and weights of all kinds, broken ones too, into a folder."""
    for path in (rooms, *questions.parent.glob("*.h5")):
        shutil.copy(path, folder)
    make_rooms(folder / "large.h5", 3, height=64, width=64)
    edited(folder / "rooms.h5", folder / "damaged.h5", damaged_chunk("image", 5))
    data = origin(rooms)
    written(folder / "rooms.safetensors", tiny(), **data)
    written(folder / "questions.safetensors", of_questions(folder / "iqtt-train.h5"))
    written(folder / "classes.safetensors", tiny(classes=2), classes=("mug", "bowl"), **data)
    (folder / "text.safetensors").write_text("no weights")
    return folder


def linked(prepared: Path, folder: Path) -> Path:
    """Fill a folder with links to prepared files."""
    for path in prepared.iterdir():
        (folder / path.name).symlink_to(path)
    return folder


def files_in(folder: Path) -> dict[str, int]:
    return {str(path): path.lstat().st_size for path in folder.rglob("*")}

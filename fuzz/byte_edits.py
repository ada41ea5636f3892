"""Changes of the bytes of a file, and of what kind of thing a file is."""

import os
import re
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Rng = np.random.Generator
HOSTILE = Path(__file__).parents[1] / "tests" / "support" / "hostile"  # what HDF5 cannot read
SPECIAL = (
    "00000000", "ffffffff", "ffffff7f", "00000080", "01000000", "0000c07f", "0000807f",
    "ffffffffffffffff", "0000000000000000", "ffffffffffffff7f", "0000000000000080",
    "00000000ffffffff", "894844460d0a1a0a", "4f484452", "534e4f44", "54524545", "48454150",
)  # fmt: skip
# Parts of numbers in text: long enough to be dear, or of a kind that few expect.
NUMERALS = ("nan", "inf", "-1", "0", "1e999", "1e-999", "1e30", "9" * 30, "2147483648", "0x10",
            "1_0", "٣", "1/2/3/4", "-0", "1,5", "\x1b[2J", "'")  # fmt: skip
KINDS = ("empty", "text", "zeros", "sparse", "folder", "fifo", "dangling link", "link to itself",
         "link to /dev/zero", "unreadable", "gone", "hangs.h5", "crashes.h5")  # fmt: skip
CHANCES = {"flip": 0.25, "overwrite": 0.25, "insert": 0.1, "cut": 0.15, "repeat": 0.08,
           "splice": 0.07, "become": 0.05, "replace": 0.05}  # fmt: skip


def _where(rng: Rng) -> float:
    """Return a place as a fraction of the file; headers are met more often than pixels."""
    return float(rng.random() ** rng.choice([1, 4, 12]))


def flip(path: Path, *changes: list[Any]) -> None:
    """Change single bytes: pairs of a place and of bits to flip."""
    data = bytearray(path.read_bytes())
    for place, bits in changes:
        if data:
            data[int(place * len(data))] ^= bits
    path.write_bytes(data)


def overwrite(path: Path, place: float, align: int, value: str) -> None:
    """Put some bytes over those at an aligned place."""
    data = bytearray(path.read_bytes())
    start, new = int(place * len(data)) // align * align, bytes.fromhex(value)
    data[start : start + len(new)] = new
    path.write_bytes(data)


def insert(path: Path, place: float, value: str, times: int) -> None:
    """Put some bytes between others."""
    data = path.read_bytes()
    start = int(place * len(data))
    path.write_bytes(data[:start] + bytes.fromhex(value) * times + data[start:])


def cut(path: Path, first: float, last: float) -> None:
    """Take out a part."""
    data = path.read_bytes()
    path.write_bytes(data[: int(first * len(data))] + data[int(last * len(data)) :])


def repeat(path: Path, first: float, last: float, times: int) -> None:
    """Say a part several times; the file stays below 32 MB."""
    data = path.read_bytes()
    part = data[int(first * len(data)) : int(last * len(data))]
    times = min(times, 32_000_000 // max(1, len(part)))
    path.write_bytes(data[: int(first * len(data))] + part * times + data[int(last * len(data)) :])


def splice(path: Path, other: str, place: float) -> None:
    """Go on with the bytes of another file from some place on."""
    data, more = path.read_bytes(), (path.parent / other).read_bytes()
    path.write_bytes(data[: int(place * len(data))] + more[int(place * len(more)) :])


def numeral(path: Path, changes: list[list[Any]]) -> None:
    """Write other numbers into a text: pairs of a place and of the new numeral."""
    data = path.read_bytes()
    for place, new in changes:
        found = list(re.finditer(rb"[-+]?[0-9][0-9.e+-]*", data))
        if found:
            one = found[int(place * len(found))]
            data = data[: one.start()] + new.encode() + data[one.end() :]
    path.write_bytes(data)


def become(path: Path, kind: str) -> None:
    """Put something else in the file's place."""
    old = path.read_bytes()
    path.unlink()
    makers: dict[str, Callable[[], Any]] = {
        "empty": path.touch,
        "text": lambda: path.write_text("depth,1,2,3\n" * 99),
        "zeros": lambda: path.write_bytes(bytes(len(old))),
        "sparse": lambda: (path.write_bytes(old), os.truncate(path, 2**30)),
        "folder": path.mkdir,
        "fifo": lambda: os.mkfifo(path),
        "dangling link": lambda: path.symlink_to("nowhere"),
        "link to itself": lambda: path.symlink_to(path.name),
        "link to /dev/zero": lambda: path.symlink_to("/dev/zero"),
        "unreadable": lambda: (path.write_bytes(old), path.chmod(0)),
        "gone": lambda: None,
        "hangs.h5": lambda: path.write_bytes(_unpacked(kind)),
        "crashes.h5": lambda: path.write_bytes(_unpacked(kind)),
    }
    makers[kind]()


def _unpacked(name: str) -> bytes:
    return zlib.decompress((HOSTILE / f"{name}.z").read_bytes())


def replace(path: Path, other: str) -> None:
    """Put another honest file in this one's place."""
    shutil.copyfile(path.parent / other, path)


def draw(rng: Rng, others: list[str]) -> list[Any]:
    """Draw a change: its name and its arguments. `others` are paths from the file's folder."""
    kind = str(rng.choice(list(CHANCES), p=list(CHANCES.values())))
    first, last = sorted((_where(rng), _where(rng)))
    some = str(rng.choice(SPECIAL))
    arguments: dict[str, Callable[[], list[Any]]] = {
        "flip": lambda: [
            [_where(rng), int(rng.integers(1, 256))] for _ in range(rng.integers(1, 9))
        ],
        "overwrite": lambda: [_where(rng), int(rng.choice([1, 4, 8])), some],
        "insert": lambda: [_where(rng), some, int(rng.choice([1, 3, 1000]))],
        "cut": lambda: [first, float(rng.choice([last, 1.0]))],
        "repeat": lambda: [first, last, int(rng.choice([2, 10, 100_000]))],
        "splice": lambda: [str(rng.choice(others)), _where(rng)],
        "become": lambda: [str(rng.choice(KINDS))],
        "replace": lambda: [str(rng.choice(others))],
    }
    return [kind, *arguments[kind]()]


def draw_numerals(rng: Rng) -> list[Any]:
    """Draw a change of numbers in a text."""
    count = int(rng.choice([1, 2, 20]))
    return ["numeral", [[float(rng.random()), str(rng.choice(NUMERALS))] for _ in range(count)]]


EDITS = {
    f.__name__: f for f in (flip, overwrite, insert, cut, repeat, splice, numeral, become, replace)
}

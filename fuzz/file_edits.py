"""Changes of the bytes of a file, of JSON in it, and of what kind of thing a file is."""

import json
import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py

from fuzz.values import JSON, TEXTS, text_or_number

HOSTILE = Path(__file__).parents[1] / "tests" / "support" / "hostile"  # what HDF5 cannot read
SPECIAL = (
    "00000000", "ffffffff", "ffffff7f", "00000080", "01000000", "0000c07f", "ffffffffffffffff",
    "ffffffffffffff7f", "894844460d0a1a0a", "4f484452", "534e4f44", "54524545", "48454150",
)  # fmt: skip
# Parts of numbers in text: long enough to be dear, or of a kind that few expect.
NUMERALS = ("nan", "inf", "-1", "0", "1e999", "1e-999", "1e30", "9" * 30, "2147483648", "0x10",
            "1_0", "٣", "1/2/3/4", "-0", "1,5", "\x1b[2J", "'")  # fmt: skip
ACTS = ("set", "set", "set", "set", "remove", "rename", "twice", "longer")


def flip(path: Path, place: float, bits: int) -> None:
    """Change bits of a byte. Places are fractions of the file."""
    data = bytearray(path.read_bytes())
    data[int(place * len(data))] ^= bits
    path.write_bytes(data)


def overwrite(path: Path, place: float, align: int, value: str) -> None:
    """Put bytes over those at an aligned place."""
    data = bytearray(path.read_bytes())
    start, new = int(place * len(data)) // align * align, bytes.fromhex(value)
    data[start : start + len(new)] = new
    path.write_bytes(data)


def repeat(path: Path, first: float, length: float, times: int) -> None:
    """Say a part several times, or cut it with 0 times; the file stays below 32 MB."""
    data = path.read_bytes()
    start, end = int(first * len(data)), int(min(1.0, first + length) * len(data))
    times = min(times, 32_000_000 // max(1, end - start))
    path.write_bytes(data[:start] + data[start:end] * times + data[end:])


def splice(path: Path, other: str, place: float) -> None:
    """Go on with the bytes of another file from a place on; 0 puts it in this one's place."""
    data, more = path.read_bytes(), (path.parent / other).read_bytes()
    path.write_bytes(data[: int(place * len(data))] + more[int(place * len(more)) :])


def numeral(path: Path, place: float, new: str) -> None:
    """Write another number into a text."""
    data = path.read_bytes()
    numbers = list(re.finditer(rb"[-+]?[0-9][0-9.e+-]*", data))
    number = numbers[int(place * len(numbers))]
    path.write_bytes(data[: number.start()] + new.encode() + data[number.end() :])


KINDS: dict[str, Callable[[Path, bytes], Any]] = {
    "empty": lambda path, old: path.touch(),
    "text": lambda path, old: path.write_text("depth,1,2,3\n" * 99),
    "zeros": lambda path, old: path.write_bytes(bytes(len(old))),
    "sparse": lambda path, old: (path.write_bytes(old), os.truncate(path, 2**30)),
    "folder": lambda path, old: path.mkdir(),
    "fifo": lambda path, old: os.mkfifo(path),
    "dangling link": lambda path, old: path.symlink_to("nowhere"),
    "link to itself": lambda path, old: path.symlink_to(path.name),
    "link to /dev/zero": lambda path, old: path.symlink_to("/dev/zero"),
    "unreadable": lambda path, old: (path.write_bytes(old), path.chmod(0)),
    "gone": lambda path, old: None,
}


def become(path: Path, kind: str) -> None:
    """Put something else in the file's place."""
    old = path.read_bytes()
    path.unlink()
    KINDS[kind](path, old)


def broken(path: Path, name: str) -> None:
    """Put a file in its place on which HDF5 hangs or crashes."""
    path.write_bytes(zlib.decompress((HOSTILE / f"{name}.z").read_bytes()))


FRAMES: dict[str, Callable[[str], bytes]] = {
    "byte order mark": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "zero bytes": lambda text: text.encode() + bytes(1000),
    "two documents": lambda text: text.encode() * 2,
    "deep": lambda text: b'{"a":' * 100_000,
    "comment": lambda text: b"// mine\n" + text.encode(),
    "spaces": lambda text: b" " * 20_000_000 + text.encode(),
    "not UTF-8": lambda text: text.encode().replace(b"m", b"\xff"),
}


def json_frame(path: Path, frame: str) -> None:
    """Change what stands around a document."""
    path.write_bytes(FRAMES[frame](path.read_text()))


def json_value(path: Path, part: str, act: str, place: float, value: str) -> None:
    """Change a value in JSON.

    Args:
        part: of an HDF5 file, an attribute such as "/@spec" or a data set of texts; else empty. The
            JSON of a safetensors file is its header, whose length is written anew.
        act: of ACTS.
        place: which of the values, as a fraction.
        value: its name in `values`.
    """
    if path.suffix == ".h5":
        where, _, name = part.rpartition("@")
        with h5py.File(path, "r+") as file:
            if name and where:
                old = str(file[where].attrs[name])
                file[where].attrs[name] = _changed(old, act, place, value).replace("\0", "")
            else:
                old = file[part][0].decode()
                file[part][0] = _changed(old, act, place, value).replace("\0", "")
    elif path.suffix == ".safetensors":
        data = path.read_bytes()
        (length,) = struct.unpack("<Q", data[:8])
        header = _changed(data[8 : 8 + length].decode(), act, place, value).encode()
        path.write_bytes(struct.pack("<Q", len(header)) + header + data[8 + length :])
    else:
        path.write_text(_changed(path.read_text(), act, place, value))


def _changed(text: str, act: str, place: float, value: str) -> str:
    """Return a document with one of its values replaced, removed, doubled, or its key renamed."""
    content = json.loads(text)
    ways = list(_ways(content))
    way = ways[int(place * len(ways))]
    mark = "\ue000here\ue000"
    if not way:
        return _written(value)
    owner = content
    for key in way[:-1]:
        owner = owner[key]
    last = way[-1]
    if act == "remove":
        del owner[last]
    elif act == "rename" and isinstance(owner, dict):
        owner[TEXTS.get(value.removeprefix("text: "), "x")] = owner.pop(last)
    elif act == "twice" and isinstance(content, dict):
        return json.dumps(content)[:-1] + f", {json.dumps(way[0])}: {_written(value)}}}"
    elif act == "longer" and isinstance(owner[last], list):
        owner[last] = owner[last] * 2
    else:
        owner[last] = mark
    return json.dumps(content).replace(json.dumps(mark), _written(value))


def _ways(content: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the ways to all values of a document; of long lists the first entries."""
    yield way
    parts = content.items() if isinstance(content, dict) else ()
    parts = list(enumerate(content[:4])) if isinstance(content, list) else parts
    for key, value in parts:
        yield from _ways(value, (*way, key))


def _written(value: str) -> str:
    """Return a value as JSON text, by its name."""
    if value in JSON:
        return JSON[value]
    content = text_or_number(value)
    return str(content) if isinstance(content, int) else json.dumps(content)

"""Changes of JSON: of files, of texts in HDF5 files, and of what safetensors files begin with."""

import json
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fuzz.values import NUMBERS, TEXTS, any_number, any_text

Rng = np.random.Generator
Way = tuple[Any, ...]
ODD = ("null", "true", "[]", "{}", "[[[]]]", '"x"', "[null]", '{"value": 1}', "deep", "wide",
       "NaN", "-Infinity", "1e999", "digits", r'"\ud800"', r'"\u0000"', "[1,2,3]", "[-1]",
       "[0.5]")  # fmt: skip
LONG_ODD = {
    "deep": "[" * 5000 + "]" * 5000,
    "wide": "[" + "0," * 300_000 + "0]",
    "digits": "1" * 5000,
}


def places(content: Any, way: Way = ()) -> Iterator[Way]:
    """Return the ways to all values of a document; of long lists the first entries."""
    yield way
    parts = content.items() if isinstance(content, dict) else ()
    parts = list(enumerate(content[:4])) if isinstance(content, list) else parts
    for key, value in parts:
        yield from places(value, (*way, key))


def changed(text: str, act: str, place: float, value: str) -> str:
    """Return a document with one of its values replaced, removed, doubled, or its key renamed."""
    content = json.loads(text)
    ways = list(places(content))
    way = ways[int(place * len(ways))]
    mark = "\ue000here\ue000"
    if not way:
        return written(value)
    owner = content
    for key in way[:-1]:
        owner = owner[key]
    last = way[-1]
    if act == "remove":
        del owner[last]
    elif act == "rename" and isinstance(owner, dict):
        owner[TEXTS[value.removeprefix("text: ")]() if value in NAMED else "x"] = owner.pop(last)
    elif act == "twice" and isinstance(owner, dict):
        return json.dumps(content)[:-1] + f", {json.dumps(way[0])}: {written(value)}}}"
    elif act == "shuffle" and isinstance(owner[last], list):
        owner[last] = owner[last][::-1]
    elif act == "longer" and isinstance(owner[last], list):
        owner[last] = owner[last] * 2
    else:
        owner[last] = mark
    return json.dumps(content).replace(json.dumps(mark), written(value))


NAMED = {f"text: {name}" for name in TEXTS}


def written(value: str) -> str:
    """Return a value as JSON text, by the name that the case gives it."""
    kind, _, name = value.partition(": ")
    if kind == "text":
        return json.dumps(TEXTS[name]())
    if kind == "number":
        number = NUMBERS[name]
        return str(number) if isinstance(number, int) else json.dumps(number)
    return LONG_ODD.get(value, value)


def json_file(path: Path, act: str, place: float, value: str) -> None:
    """Change a file of JSON."""
    path.write_text(changed(path.read_text(), act, place, value))


def json_frame(path: Path, frame: str) -> None:
    """Change what stands around the document."""
    text = path.read_text()
    frames = {
        "byte order mark": b"\xef\xbb\xbf" + text.encode(),
        "UTF-16": text.encode("utf-16"),
        "zero bytes": text.encode() + bytes(1000),
        "two documents": text.encode() * 2,
        "deep": b'{"a":' * 100_000,
        "comment": b"// mine\n" + text.encode(),
        "spaces": b" " * 20_000_000 + text.encode(),
        "escapes": re.sub(r"[a-z]", lambda c: f"\\u{ord(c[0]):04x}", text, count=50).encode(),
        "not UTF-8": text.encode().replace(b"m", b"\xff"),
    }
    path.write_bytes(frames[frame])


def json_inside(
    path: Path, where: str, name: str, row: float, act: str, place: float, value: str
) -> None:
    """Change a text of JSON in an HDF5 file: an attribute, or without its name a row of texts."""
    with h5py.File(path, "r+") as file:
        if name:
            old = file[where].attrs[name]
            file[where].attrs[name] = changed(str(old), act, place, value).replace("\0", "")
        else:
            texts = file[where]
            index = int(row * texts.shape[0])
            texts[index] = changed(texts[index].decode(), act, place, value).replace("\0", "")


def json_header(path: Path, act: str, place: float, value: str) -> None:
    """Change the JSON that a safetensors file begins with; its length is written anew."""
    data = path.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = changed(data[8 : 8 + length].decode(), act, place, value).encode()
    path.write_bytes(struct.pack("<Q", len(header)) + header + data[8 + length :])


def draw(rng: Rng) -> list[Any]:
    """Draw arguments of `changed`: the act, the place and the value."""
    act = str(rng.choice(["set", "remove", "rename", "twice", "shuffle", "longer"],
                         p=[0.66, 0.1, 0.06, 0.06, 0.06, 0.06]))  # fmt: skip
    value = str(
        rng.choice([f"text: {any_text(rng)}", f"number: {any_number(rng)}", str(rng.choice(ODD))])
    )
    return [act, float(rng.random()), value]


def draw_frame(rng: Rng) -> list[Any]:
    """Draw a change of what stands around the document."""
    frames = ("byte order mark", "UTF-16", "zero bytes", "two documents", "deep", "comment",
              "spaces", "escapes", "not UTF-8")  # fmt: skip
    return ["json_frame", str(rng.choice(frames))]


EDITS = {f.__name__: f for f in (json_file, json_frame, json_inside, json_header)}

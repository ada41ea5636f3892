"""Hostile values by name, so that a case can say in JSON which one it used."""

from collections.abc import Callable
from typing import Any

import h5py
import numpy as np

LONG = 200_000  # characters; beyond 64 kB an HDF5 attribute is stored in another way
TEXTS: dict[str, Callable[[], str]] = {
    "empty": lambda: "",
    "blank": lambda: " \u00a0\u3000",
    "zero": lambda: "0",
    "minus one": lambda: "-1",
    "huge number": lambda: "9" * 400,
    "beyond float": lambda: "1e999",
    "not a number": lambda: "nan",
    "half": lambda: "0.5",
    "escape sequence": lambda: "\x1b[2J\x1b]0;owned\x07mine",
    "carriage return": lambda: "mine\rError: yours",
    "newline": lambda: "mine\nError: yours",
    "controls": lambda: "a\x08\x7f\x85\x9b31m\u2028b",
    "written backwards": lambda: "mine\u202e\u2066.h5\u2069",
    "invisible": lambda: "cham\u200bfer\ufeff",
    "look-alike": lambda: "сhamfer",  # begins with a Cyrillic letter
    "combining": lambda: "a" + "\u0301" * 5000,
    "outside the basic plane": lambda: "\U0001f9ca" * 30,
    "markup": lambda: "<script>alert(1)</script>|`*_$\\input{/etc/passwd}",
    "a way out": lambda: "../../../../etc/passwd",
    "absolute path": lambda: "/dev/zero",
    "home": lambda: "~/x",
    "long": lambda: "m" * LONG,
    "long name": lambda: "n" * 5000,
    "format": lambda: "%s%n{0}{x!r}",
    "JSON": lambda: '{"a": [1, null]}',
    "deep JSON": lambda: "[" * 20_000,
    "fingerprint": lambda: "0" * 64,
}
NUMBERS: dict[str, Any] = {
    "0": 0,
    "-1": -1,
    "1": 1,
    "2**31": 2**31,
    "2**53 + 1": 2**53 + 1,
    "2**63 - 1": 2**63 - 1,
    "2**64": 2**64,
    "10**400": 10**400,
    "0.5": 0.5,
    "-0.0": -0.0,
    "1e-320": 1e-320,
    "9e99": 9e99,
    "1e308": 1e308,
    "-1e308": -1e308,
    "nan": float("nan"),
    "inf": float("inf"),
    "-inf": float("-inf"),
}


def any_text(rng: np.random.Generator) -> str:
    """Return the name of a text."""
    return str(rng.choice(list(TEXTS)))


def any_number(rng: np.random.Generator) -> str:
    """Return the name of a number."""
    return str(rng.choice(list(NUMBERS)))


# What an attribute of HDF5 can be; the file is there for references.
ATTRIBUTES: dict[str, Callable[[h5py.File], Any]] = {
    **{f"text: {name}": lambda _, make=make: _text(make()) for name, make in TEXTS.items()},
    **{f"number: {name}": lambda _, value=value: value for name, value in NUMBERS.items()},
    "nothing": lambda _: h5py.Empty("f4"),
    "no text": lambda _: h5py.Empty(h5py.string_dtype()),
    "bytes that are not UTF-8": lambda _: np.bytes_(b"\xff\xfe\x80"),
    "fixed bytes with zeros": lambda _: np.array(b"ab\0cd", "S9"),
    "true": lambda _: True,
    "complex": lambda _: 1 + 2j,
    "list of texts": lambda _: ["one", "two\x1b[1m"],
    "list of no texts": lambda _: np.array([], h5py.string_dtype()),
    "array": lambda _: np.arange(12.0).reshape(3, 4),
    "array of NaN": lambda _: np.full(3, np.nan),
    "matrix of zeros": lambda _: np.zeros((4, 4)),
    "empty array": lambda _: np.zeros((0, 3)),
    "long array": lambda _: np.zeros(7000),
    "deep array": lambda _: np.zeros((1,) * 32),
    "reference": lambda file: file.ref,
    "null reference": lambda _: h5py.Reference(),
    "compound": lambda _: np.array((1, 2.0), [("a", "i4"), ("b", "f8")]),
    "enumeration": lambda _: np.array(7, h5py.enum_dtype({"a": 0, "b": 7}, "i4")),
    "opaque": lambda _: np.void(b"\x01\x02"),
    "ragged": lambda _: _ragged(),
    "half precision": lambda _: np.float16(0.1),
    "big-endian": lambda _: np.array([1, 2], ">i8"),
}


def _text(text: str) -> Any:
    """Return a text without the zero characters, which HDF5 ends a text at."""
    return text.replace("\0", "")


def _ragged() -> Any:
    values = np.empty(2, h5py.vlen_dtype("i4"))
    values[0], values[1] = np.arange(3), np.arange(1)
    return values


def set_attribute(file: h5py.File, where: str, name: str, value: str) -> None:
    """Give an object of a file an attribute, which may be too large for its usual place."""
    found = ATTRIBUTES[value](file)
    if isinstance(found, int) and not isinstance(found, bool) and not -(2**63) <= found < 2**64:
        found = str(found)
    kind = getattr(found, "dtype", None) if value == "ragged" else None
    file[where].attrs.create(name, found, dtype=kind)

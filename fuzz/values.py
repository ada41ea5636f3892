"""Hostile values by name, so that a case can say in JSON which one it used."""

from typing import Any

import h5py
import numpy as np

LONG = 200_000  # characters; beyond 64 kB an HDF5 attribute is stored in another way
TEXTS = {
    "empty": "",
    "blank": " \u00a0\u3000",
    "minus one": "-1",
    "huge number": "9" * 400,
    "beyond float": "1e999",
    "not a number": "nan",
    "escape sequence": "\x1b[2J\x1b]0;owned\x07mine",
    "carriage return": "mine\rError: yours",
    "newline": "mine\nError: yours",
    "controls": "a\x08\x7f\x85\x9b31m\u2028b",
    "written backwards": "mine\u202e\u2066.h5\u2069",
    "invisible": "cham\u200bfer\ufeff",
    "combining": "a" + "\u0301" * 5000,
    "markup": "<script>alert(1)</script>|`*_$\\input{/etc/passwd}",
    "a way out": "../../../../etc/passwd",
    "absolute path": "/dev/zero",
    "home": "~/x",
    "long": "m" * LONG,
    "format": "%s%n{0}{x!r}",
    "JSON": '{"a": [1, null]}',
    "deep JSON": "[" * 20_000,
    "fingerprint": "0" * 64,
}
NUMBERS: dict[str, Any] = {
    "0": 0, "-1": -1, "1": 1, "2**31": 2**31, "2**53 + 1": 2**53 + 1, "2**64": 2**64,
    "10**400": 10**400, "0.5": 0.5, "-0.0": -0.0, "1e-320": 1e-320, "9e99": 9e99, "1e308": 1e308,
    "-1e308": -1e308, "nan": float("nan"), "inf": float("inf"), "-inf": float("-inf"),
}  # fmt: skip
# JSON text, written as it is.
JSON = {
    **{text: text for text in ("null", "true", "[]", "{}", "[[[]]]", "[null]", '{"value": 1}',
                               "1e999", r'"\ud800"', r'"\u0000"', "[1,2,3]", "[-1]")},
    "deep": "[" * 5000 + "]" * 5000,
    "wide": "[" + "0," * 300_000 + "0]",
    "digits": "1" * 5000,
}  # fmt: skip
# What an attribute of HDF5 can be, beside texts and numbers.
ATTRIBUTES: dict[str, Any] = {
    "nothing": h5py.Empty("f4"),
    "no text": h5py.Empty(h5py.string_dtype()),
    "bytes that are not UTF-8": np.bytes_(b"\xff\xfe\x80"),
    "fixed bytes with zeros": np.array(b"ab\0cd", "S9"),
    "true": True,
    "complex": 1 + 2j,
    "list of texts": ["one", "two\x1b[1m"],
    "list of no texts": np.array([], h5py.string_dtype()),
    "array": np.arange(12.0).reshape(3, 4),
    "array of NaN": np.full(3, np.nan),
    "empty array": np.zeros((0, 3)),
    "long array": np.zeros(7000),
    "deep array": np.zeros((1,) * 32),
    "null reference": h5py.Reference(),
    "compound": np.array((1, 2.0), [("a", "i4"), ("b", "f8")]),
    "enumeration": np.array(7, h5py.enum_dtype({"a": 0, "b": 7}, "i4")),
    "opaque": np.void(b"\x01\x02"),
    "half precision": np.float16(0.1),
    "big-endian": np.array([1, 2], ">i8"),
}
NAMES = (*(f"text: {name}" for name in TEXTS), *(f"number: {name}" for name in NUMBERS))


def text_or_number(name: str) -> Any:
    """Return the value that NAMES has under a name."""
    kind, _, inner = name.partition(": ")
    return TEXTS[inner] if kind == "text" else NUMBERS[inner]


def attribute_value(name: str) -> Any:
    """Return a value for an attribute by its name in NAMES or ATTRIBUTES."""
    if name in ATTRIBUTES:
        return ATTRIBUTES[name]
    value = text_or_number(name)
    if isinstance(value, int) and not -(2**63) <= value < 2**64:
        return str(value)
    return value.replace("\0", "") if isinstance(value, str) else value

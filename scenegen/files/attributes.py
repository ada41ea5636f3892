"""Attributes of HDF5 files: the kind and size of each are checked before it is read."""

import re
from typing import Any

import h5py

from scenegen.common.errors import FileFormatError
from scenegen.common.records import LONGEST_JSON
from scenegen.files.schema import DIGEST, Format

LONGEST = 1_000  # characters of a text, but for these:
LONGER = ("spec", "creation_command")


def read_root(file: h5py.File, place: object, kind: Format) -> dict[str, str]:
    """Return the texts at the root of a file that has a format.

    Raises FileFormatError for a file of another kind or major version, and where a text is missing
    or cannot be true of any file. Other attributes are not read.
    """
    name = read_text(file, "format", place)
    if name != kind.name:
        found = "no attribute 'format'" if name is None else f"format {name!r:.60}"
        raise FileFormatError(f"{place}: not a {kind.kind}", found, repr(kind.name))
    version = read_text(file, "format_version", place, needed=True)
    major = kind.version.partition(".")[0]
    if not re.fullmatch(rf"{major}\.\d+", str(version)):
        where = f"{place}: this release reads format version {major}.x, and the file has {version}"
        raise FileFormatError(where, hint="read it with the release that wrote it")
    texts = {"format": name, "format_version": str(version)}
    for key, pattern in kind.texts.items():
        text = read_text(file, key, place, key not in kind.optional)
        if text is not None:
            good = re.fullmatch(pattern, text, re.DOTALL) is not None
            check_attribute(place, key, text, good, f"a text that matches {pattern:.60}")
            texts[key] = text
    return texts


def read_text(item: Any, name: str, place: object, needed: bool = False) -> str | None:
    """Return an attribute that holds one text; None where there is none and none is needed.

    Raises FileFormatError for another kind of value, and for a text that is too long or, as a
    line, cannot be printed.
    """
    if name not in item.attrs:
        check_attribute(place, name, None, not needed, "a text")
        return None
    most = LONGEST_JSON if name in LONGER else LONGEST
    text = _checked_text(item, name, place, most)
    check_attribute(
        place, name, text, name in LONGER or text.isprintable(), "one line that can be printed"
    )
    return text


def read_digest(item: Any, name: str, place: object, needed: bool = False) -> str | None:
    """Return an attribute that holds a SHA-256, as hex. Raises as `read_text`."""
    text = read_text(item, name, place, needed)
    good = text is None or re.fullmatch(DIGEST, text) is not None
    check_attribute(place, name, text, good, "64 hexadecimal digits")
    return text


def _checked_text(item: Any, name: str, place: object, most: int) -> str:
    """Return an attribute, of which type and size are looked at before it is read."""
    kind = item.attrs.get_id(name)
    is_text = h5py.check_string_dtype(kind.dtype) is not None and kind.dtype.itemsize <= most
    ok = is_text and kind.shape == ()
    check_attribute(place, name, f"{kind.dtype} {kind.shape}", ok, "a text")
    value = item.attrs[name]
    text = value.decode(errors="surrogateescape") if isinstance(value, bytes) else str(value)
    good = len(text) <= most and not re.search("[\ud800-\udfff]", text)
    check_attribute(place, name, "another one", good, f"UTF-8 of at most {most:,} characters")
    return text


def check_attribute(place: object, name: str, found: object, ok: bool, expected: str) -> None:
    """Raise FileFormatError unless an attribute is as it must be; `found` None is none."""
    if not ok:
        shown = "none" if found is None else f"{found!r:.60}"
        raise FileFormatError(f"{place}: attribute {name!r}", shown, expected)

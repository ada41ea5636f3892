"""Attributes of question files: the kind and size of each are checked before it is used."""

import re
from pathlib import Path
from typing import Any

import h5py

from iqtt.files.layout import DIGESTS_SINCE, FORMAT_NAME, FORMAT_VERSION, ROOT_TEXTS
from iqtt.questions.specs import SPLITS, SplitSpec
from scenegen.common.errors import FileFormatError
from scenegen.common.records import LONGEST_JSON
from scenegen.common.row_file import read_spec

LONGEST = 1_000  # characters of a text, but for these:
LONGER = ("spec", "creation_command")
MOST_NAMES = 100  # of kinds of distractors


def read_root(file: h5py.File, path: Path) -> tuple[dict[str, str], SplitSpec | None, str | None]:
    """Return the texts, spec and split of a file of ours; nothing for one without `format`.

    Other attributes are not read; released files have none.
    """
    if "format" not in file.attrs:
        return {}, None, None
    found = {name: read_text(file, name, path) for name in ROOT_TEXTS}
    texts = {name: text for name, text in found.items() if text is not None}
    _check(path, "format", texts["format"], texts["format"] == FORMAT_NAME, repr(FORMAT_NAME))
    spec = read_spec(path, texts, FORMAT_VERSION, SplitSpec.from_json)
    version, split = texts["format_version"], texts.get("split")
    _check(path, "format_version", version, _minor(version).isdecimal(), FORMAT_VERSION)
    _check(path, "split", split, split in SPLITS, f"one of {', '.join(SPLITS)}")
    return texts, spec, split


def has_digests(texts: dict[str, str]) -> bool:
    """Return whether a file of this version has digests of what it holds."""
    return bool(texts) and int(_minor(texts["format_version"])) >= DIGESTS_SINCE


def read_text(item: Any, name: str, place: object, needed: bool = False) -> str | None:
    """Return an attribute that holds one text; None where there is none and none is needed.

    Raises FileFormatError for another kind of value, and for a text that is too long or, as a
    line, cannot be printed.
    """
    if name not in item.attrs:
        _check(place, name, None, not needed, "a text")
        return None
    most = LONGEST_JSON if name in LONGER else LONGEST
    (text,) = _texts(item, name, place, (), most)
    _check(place, name, text, name in LONGER or text.isprintable(), "one line that can be printed")
    return text


def read_digest(item: Any, name: str, place: object, needed: bool = False) -> str | None:
    """Return an attribute that holds a SHA-256, as hex. Raises as `read_text`."""
    text = read_text(item, name, place, needed)
    good = text is None or re.fullmatch("[0-9a-f]{64}", text) is not None
    _check(place, name, text, good, "64 hexadecimal digits")
    return text


def read_names(item: Any, name: str, place: object) -> list[str]:
    """Return an attribute that holds a list of names. Raises as `read_text`."""
    _check(place, name, None, name in item.attrs, "names")
    names = _texts(item, name, place, (slice(None),), LONGEST)
    _check(place, name, names, all(map(str.isprintable, names)), "names that can be printed")
    return names


def _texts(item: Any, name: str, place: object, shape: tuple[Any, ...], most: int) -> list[str]:
    """Return the texts of an attribute that has as many dimensions as `shape`."""
    kind = item.attrs.get_id(name)
    found = f"{kind.dtype} {kind.shape}"
    texts = h5py.check_string_dtype(kind.dtype) is not None and kind.dtype.itemsize <= most
    size = kind.get_space().get_simple_extent_npoints()
    ok = texts and len(kind.shape or ()) == len(shape) and 0 < size <= MOST_NAMES
    _check(place, name, found, ok, "texts" if shape else "a text")
    value = item.attrs[name]
    values = value.reshape(-1).tolist() if shape else [value]
    lines = [v.decode(errors="surrogateescape") if isinstance(v, bytes) else v for v in values]
    good = all(len(line) <= most and _is_unicode(line) for line in lines)
    _check(place, name, "another one", good, f"UTF-8 of at most {most:,} characters")
    return lines


def _is_unicode(text: str) -> bool:
    return not re.search("[\ud800-\udfff]", text)


def _minor(version: str) -> str:
    return version.partition(".")[2]


def _check(place: object, name: str, found: object, ok: bool, expected: str) -> None:
    if not ok:
        shown = "none" if found is None else f"{found!r:.60}"
        raise FileFormatError(f"{place}: attribute {name!r}", shown, expected)

"""JSON read strictly, with errors that say where in the file, what was found, what was expected."""

import json
import math
import stat
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SceneGenError

MOST_BYTES = 256 * 2**20
LARGEST_WHOLE = 2**53


class JsonError(SceneGenError):
    """A JSON file that is not what it should be; one line for a person."""


@dataclass(frozen=True)
class Node:
    """A value of a JSON file, with the place where it was found, such as `meta.seed`."""

    path: Path
    where: str
    value: Any

    def error(self, expected: str, found: str = "") -> JsonError:
        """What to raise about this value."""
        where = f"{self.where}: " if self.where else ""
        text = f"{self.path}: {where}found {found or _shown(self.value)}, expected {expected}"
        line = " ".join(text.split())
        return JsonError("".join(c if c.isprintable() else "\ufffd" for c in line))

    def fields(
        self, required: Collection[str], optional: Collection[str] = ()
    ) -> dict[str, "Node"]:
        """The values of an object that has all required keys, and no others but optional ones."""
        found = dict(self.entries())
        for name in required:
            if name not in found:
                raise self._at(name).error("it to be there", "no such key")
        known = {*required, *optional}
        for name, node in found.items():
            if name not in known:
                raise node.error(f"no key but {', '.join([*required, *optional])}", "this key")
        return found

    def entries(self) -> Iterator[tuple[str, "Node"]]:
        """Keys and values of an object."""
        if not isinstance(self.value, dict):
            raise self.error("an object")
        for name, value in self.value.items():
            yield name, Node(self.path, self._place(name), value)

    def members(self) -> list["Node"]:
        """The values of a list."""
        if not isinstance(self.value, list):
            raise self.error("a list")
        return [Node(self.path, f"{self.where}[{i}]", value) for i, value in enumerate(self.value)]

    def text(self, longest: int = 10_000) -> str:
        """A text that UTF-8 can hold."""
        if not isinstance(self.value, str):
            raise self.error("a text")
        if len(self.value) > longest:
            expected = f"at most {longest}"
            raise self.error(expected, f"a text of {len(self.value)} characters")
        if any("\ud800" <= character <= "\udfff" for character in self.value):
            raise self.error("valid Unicode", "half of a surrogate pair")
        return self.value

    def one_of(self, choices: Collection[str]) -> str:
        """One of some texts."""
        if not isinstance(self.value, str) or self.value not in choices:
            raise self.error(" or ".join(map(repr, choices)))
        return self.value

    def flag(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            raise self.error("true or false")
        return self.value

    def whole(self, least: int = 0, most: int = LARGEST_WHOLE) -> int:
        """A whole number within limits."""
        if type(self.value) is not int or not least <= self.value <= most:
            raise self.error(f"a whole number from {least} to {most}")
        return self.value

    def number(self, least: float = -math.inf, most: float = math.inf) -> float:
        """A finite number within limits."""
        if type(self.value) not in (int, float) or not math.isfinite(_float(self.value)):
            raise self.error("a finite number")
        if not least <= self.value <= most:
            raise self.error(_range(least, most))
        return float(self.value)

    def number_or_null(self, least: float = -math.inf, most: float = math.inf) -> float | None:
        """A finite number within limits, or None."""
        return None if self.value is None else self.number(least, most)

    def whole_column(self, least: int = 0) -> NDArray[np.int64]:
        """A list of whole numbers from `least`."""
        values = self._list_of({int})
        for i, value in enumerate(values):
            if not least <= value <= LARGEST_WHOLE:
                self._member(i).whole(least)
        return np.array(values, np.int64)

    def number_column(
        self, least: float = -math.inf, most: float = math.inf
    ) -> NDArray[np.float64]:
        """A list of finite numbers within limits; null becomes NaN."""
        values = self._list_of({int, float, type(None)})
        column = np.array([math.nan if v is None else _float(v) for v in values], np.float64)
        with np.errstate(invalid="ignore"):
            bad = np.isinf(column) | (column < least) | (column > most)
        if bad.any():
            self._member(int(np.argmax(bad))).number(least, most)
        return column

    def _list_of(self, kinds: set[type]) -> list[Any]:
        values = self.value
        if not isinstance(values, list):
            raise self.error("a list of numbers")
        if set(map(type, values)) - kinds:
            first = next(i for i, value in enumerate(values) if type(value) not in kinds)
            raise self._member(first).error("a number" if float in kinds else "a whole number")
        return values

    def _member(self, i: int) -> "Node":
        return Node(self.path, f"{self.where}[{i}]", self.value[i])

    def _at(self, name: str) -> "Node":
        return Node(self.path, self._place(name), None)

    def _place(self, name: str) -> str:
        return f"{self.where}.{name:.60}".lstrip(".")


def read_json(path: Path) -> Node:
    """Read a whole file.

    Raises:
        OSError: it cannot be read.
        JsonError: it is not a regular file, too large, or no strict JSON in UTF-8.
    """
    root = Node(path, "", None)
    status = path.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(21, "is a folder; name a file in it", str(path))
    if not stat.S_ISREG(status.st_mode):
        raise root.error("a regular file", "something else")
    if status.st_size > MOST_BYTES:
        raise root.error(f"at most {MOST_BYTES}", f"{status.st_size} bytes")
    data = path.read_bytes()
    if data.startswith(b"\x89HDF"):
        raise root.error("JSON, as `bench score --json` writes it", "an HDF5 file")
    return parse_json(data, path)


def parse_json(data: bytes, path: Path) -> Node:
    """Parse strict JSON: UTF-8, no NaN or Infinity, no key twice. Raises JsonError."""
    root = Node(path, "", None)

    def refuse(name: str) -> Any:
        raise root.error("finite numbers, or null", name)

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, value in pairs:
            if name in found:
                raise root.error("each key once", f"the key {name!r:.60} twice")
            found[name] = value
        return found

    try:
        text = data.decode("utf-8-sig")
        value = json.loads(text, parse_constant=refuse, object_pairs_hook=unique)
    except JsonError:
        raise
    except RecursionError as error:
        raise root.error("JSON", "JSON that is nested too deeply") from error
    except ValueError as error:
        kind = "bytes that are not UTF-8" if isinstance(error, UnicodeDecodeError) else "no JSON"
        raise root.error("JSON in UTF-8", f"{kind} ({error!s:.80})") from error
    return Node(path, "", value)


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _range(least: float, most: float) -> str:
    if math.isinf(most):
        return f"a number from {least:g}"
    return f"a number from {least:g} to {most:g}"


def _shown(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, (dict, list)):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and abs(value) > 10**20:
        return "a huge whole number"
    return f"{value!r:.60}"

"""JSON files read strictly: bounded, each key once, no NaN, and every value of the declared type.

This module imports pydantic, so the commands import it only when they run.
"""

import functools
import json
import re
import stat
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from metrics.submissions.problems import JsonError
from scenegen.common.text_table import printable

LONGEST_SHOWN = 200  # characters of each part of an error: a file's keys and texts may be huge
MOST_MEMORY = 5 * 2**28  # bytes that a parsed text may take; 140,000 scored images: 0.8 GB
LARGEST_WHOLE = 2**53  # beyond it, JSON readers that know only doubles change whole numbers
_FOUND = {"missing": "no such key", "unexpected_keyword_argument": "an unknown key"}
_EXPECTED = {
    "missing": "it to be there",
    "unexpected_keyword_argument": "no key of this name",
    "dataclass_type": "an object",
    "dict_type": "an object",
    "tuple_type": "a list",
    "list_type": "a list",
    "string_type": "a text",
    "too_short": "at least one entry",
}  # for the others pydantic's own words will do


_PATTERNS = {
    "^[0-9a-f]{64}$": "64 hexadecimal digits",
    r"\S": "a text that is not blank",
    r"^[^\s].{0,59}$": "a name of 1 to 60 characters",
}
_STRING = re.compile(rb'"(?:[^"\\]++|\\.)*+"?', re.DOTALL)
Kind = TypeVar("Kind")
_adapter: Callable[[Any], TypeAdapter[Any]] = functools.cache(TypeAdapter)


def read_bytes(path: Path, most: int) -> bytes:
    """Read a regular file of bounded size.

    Raises:
        OSError: it cannot be read.
        JsonError: it is not a regular file, or too large.
    """
    status = path.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(21, "is a folder; name a file in it", str(path))
    if not stat.S_ISREG(status.st_mode):
        raise refusal("", "something else", "a regular file")
    if status.st_size > most:
        raise refusal("", f"{status.st_size} bytes", f"at most {most}")
    return path.read_bytes()


def parse_json(data: bytes, most_keys: int, most_memory: int = MOST_MEMORY) -> Any:
    """Parse JSON in UTF-8 without NaN or infinity; no object has a key twice, or too many keys.

    Raises JsonError, also for a text that might take more than so many bytes of memory.
    """

    def refuse(name: str) -> Any:
        raise refusal("", name, "finite numbers")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(pairs) > most_keys:
            raise refusal("", f"an object of {len(pairs)} keys", f"at most {most_keys}")
        members = dict(pairs)
        if len(members) < len(pairs):
            twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
            raise refusal("", f"the key {twice!r:.60} twice", "each key once")
        return members

    if data.startswith(b"\x89HDF"):
        raise refusal("", "an HDF5 file", "JSON, as `bench score --json` makes of a submission")
    memory = memory_needed(data)
    if memory > most_memory:
        found = f"JSON that may take {memory:,} bytes of memory"
        raise refusal("", found, f"at most {most_memory:,}")
    try:
        text = data.decode("utf-8-sig")
        return json.loads(text, parse_constant=refuse, object_pairs_hook=unique)
    except JsonError:
        raise
    except RecursionError as error:
        raise refusal("", "JSON that is nested too deeply", "JSON") from error
    except ValueError as error:
        kind = "bytes that are not UTF-8" if isinstance(error, UnicodeDecodeError) else "no JSON"
        raise refusal("", f"{kind} ({error!s:.80})", "JSON in UTF-8") from error


def memory_needed(data: bytes) -> int:
    """Return an upper bound, in bytes, of what parsing this JSON takes while it is parsed.

    It is made of counts alone, so nothing of the text has been built yet. The weights are at least
    what CPython 3.11 was seen to take for the worst text of each kind.
    """
    wide, escaped = not data.isascii(), b"\\" in data
    # Bytes, text, and strings; a text with one wide character is copied into 4 bytes a character.
    held = 10_000 + len(data) * (7.5 if wide else 3.0)
    weights = {b",": 50, b":": 200, b"{": 130, b"[": 130, b'"': 32}  # a string has two quotes
    held += sum(weight * data.count(piece) for piece, weight in weights.items())
    if wide or escaped:
        held += 6.5 * sum(match.end() - match.start() for match in _STRING.finditer(data))
    return int(held)


def validated(kind: type[Kind] | TypeAdapter[Kind], content: Any) -> Kind:
    """Return parsed JSON as this type. Raises JsonError with the first thing that is wrong."""
    try:
        adapter = kind if isinstance(kind, TypeAdapter) else _adapter(kind)
        record: Kind = adapter.validate_python(content)
        return record
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
    # The part "[key]" only says that the key itself is wrong.
    way = (part for part in first["loc"] if part != "[key]")
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part:.60}" for part in way)
    found = _FOUND.get(first["type"]) or shown(first["input"])
    expected = _EXPECTED.get(first["type"]) or first["msg"].removeprefix("Input should be ")
    pattern = re.search(r"match pattern '(.*)'", expected)
    expected = _PATTERNS.get(pattern[1], expected) if pattern else expected
    expected = expected.replace("Tuple", "List")
    expected = re.sub(r"^(\w+) should", lambda kind: f"a {kind[1].lower()} to", expected)
    raise refusal(place.removeprefix("."), found, expected)


def refusal(place: str, found: str, expected: str) -> JsonError:
    """Return the error about a place in a file; what a file says is made short and printable."""
    fields = (" ".join(field.split()) for field in (place, found, expected))
    return JsonError(*(printable(field)[:LONGEST_SHOWN] for field in fields))


def shown(value: Any) -> str:
    """Return a value of a JSON file in a few words."""
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and abs(value) > 10**20:
        return "a huge whole number"
    return f"{value!r:.60}"

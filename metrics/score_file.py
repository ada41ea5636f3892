"""Score files: `bench score` writes them; `compare`, `leaderboard` and other programs read them.

docs/scores.md describes the format. Numbers that are written here read back to the same bits.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from metrics.scoring.metric_names import in_order
from metrics.scoring.records import (
    FORMAT_NAME,
    FORMAT_VERSION,
    GROUPINGS,
    ID_COLUMNS,
    OBJECT_COLUMNS,
    OPTIONAL_COLUMNS,
    SHAPE_COLUMN,
    Groups,
    Meta,
    Score,
    ScoreFile,
    Skill,
    Submission,
)
from metrics.scoring.schema import parse_scores
from metrics.submissions.problems import JsonError
from metrics.submissions.strict_json import parse_json, read_bytes
from scenegen.common.text_table import by_number
from scenegen.files.new_file import written_beside

MOST_BYTES = 256 * 2**20  # more images than may be parsed, see `strict_json.MOST_MEMORY`
MOST_KEYS = 10_000  # of one object
WITHOUT_JSON = "about 140,000 images fit; --csv writes the scores of any number of them"

__all__ = [
    "FORMAT_NAME",
    "FORMAT_VERSION",
    "JsonError",
    "Meta",
    "Score",
    "ScoreFile",
    "Skill",
    "Submission",
    "read_scores",
    "to_json",
    "write_scores",
]


def read_scores(path: str | Path) -> ScoreFile:
    """Read and check a score file.

    Raises:
        OSError: it cannot be read.
        JsonError: it is no score file, or a broken one.
    """
    path = Path(path)
    with _naming(path):
        return replace(_parsed(read_bytes(path, MOST_BYTES)), path=path)


def write_scores(scores: ScoreFile, path: str | Path, overwrite: bool = False) -> None:
    """Write scores; the file appears when it is complete and has passed the reader's checks.

    Raises:
        OSError: it cannot be written, or exists and may not be overwritten.
        JsonError: the reader would refuse it.
    """
    with written_beside(path, overwrite) as temporary, _naming(path):
        data = to_json(scores).encode("ascii")
        if len(data) > MOST_BYTES:
            raise JsonError("", f"{len(data)} bytes", f"at most {MOST_BYTES}", WITHOUT_JSON)
        _parsed(data)
        temporary.write_bytes(data)


@contextmanager
def _naming(path: str | Path) -> Iterator[None]:
    """Put the path into a JsonError."""
    try:
        yield
    except JsonError as error:
        raise error.inside(path) from error


def _parsed(data: bytes) -> ScoreFile:
    return parse_scores(parse_json(data, MOST_KEYS))


def to_json(scores: ScoreFile) -> str:
    """Return the text of a score file: keys in a fixed order, a line for each column of items."""
    meta = asdict(scores.meta)
    for name in ("versions", "counts", "noise_floors"):
        meta[name] = dict(sorted(meta[name].items()))
    if not scores.meta.noise_floors:
        del meta["noise_floors"]
    head = {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "task": scores.task,
        "method": scores.method,
        "comparable": scores.comparable,
        "alignment": scores.alignment,
        "metrics": _metrics(scores.metrics),
        "skills": _metrics(scores.skills),
        **{name: _groups(getattr(scores, name)) for name in GROUPINGS.get(scores.task, ())},
        "meta": meta,
    }
    # Only ASCII, as one wide character makes the whole text take 4 bytes a character when read.
    text = json.dumps(_plain(head), indent=2, allow_nan=False)
    first = (*ID_COLUMNS.get(scores.task, ()), *OPTIONAL_COLUMNS.get(scores.task, ()))
    tables = _table("items", scores.items, first)
    if scores.objects:
        tables += ",\n" + _table("objects", scores.objects, (*OBJECT_COLUMNS, SHAPE_COLUMN))
    return f"{text[:-2]},\n{tables}\n}}\n"


def _table(key: str, columns: Mapping[str, Any], first: Sequence[str]) -> str:
    names = [name for name in first if name in columns]
    names += in_order(name for name in columns if name not in first)
    lines = [f"    {json.dumps(name)}: {json.dumps(_column(columns[name]))}" for name in names]
    return f'  "{key}": {{\n' + ",\n".join(lines) + "\n  }"


def _metrics(found: Mapping[str, Score | Skill]) -> dict[str, Any]:
    return {name: vars(found[name]) for name in in_order(found)}


def _groups(groups: Groups) -> dict[str, Any]:
    return {key: _metrics(groups[key]) for key in by_number(groups)}


def _column(values: Any) -> list[Any]:
    array = np.asarray(values)
    finite = array.dtype.kind != "f" or np.isfinite(array).all()
    found: list[Any] = array.tolist()
    return found if finite else [value if math.isfinite(value) else None for value in found]


def _plain(value: Any) -> Any:
    """Return the same in Python's own types; numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {key: _plain(member) for key, member in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(member) for member in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value

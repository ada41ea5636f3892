"""Score files: what `bench score` writes, and `compare`, `leaderboard` and others read.

The contract is in docs/scores.md. What is written here reads back to the same bits.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from metrics.scoring.metric_names import in_order
from metrics.scoring.parser import FORMAT_NAME, FORMAT_VERSION, parse_scores
from metrics.scoring.records import (
    GROUPINGS,
    ID_COLUMNS,
    OPTIONAL_COLUMNS,
    Groups,
    Meta,
    Score,
    ScoreFile,
    Submission,
    score,
)
from metrics.submissions.strict_json import JsonError, parse_json, read_json
from scenegen.common.new_file import written_beside

__all__ = [
    "FORMAT_NAME",
    "FORMAT_VERSION",
    "JsonError",
    "Meta",
    "Score",
    "ScoreFile",
    "Submission",
    "read_scores",
    "score",
    "to_json",
    "write_scores",
]


def read_scores(path: str | Path) -> ScoreFile:
    """Read and check a score file.

    Raises:
        OSError: it cannot be read.
        JsonError: it is no score file, or a broken one; says where, what was found and expected.
    """
    return parse_scores(read_json(Path(path)))


def write_scores(scores: ScoreFile, path: str | Path, overwrite: bool = False) -> None:
    """Write scores; the file appears when it is complete and has passed the reader's checks.

    Raises:
        OSError: it cannot be written, or exists and may not be overwritten.
        JsonError: the reader would refuse it.
    """
    path = Path(path)
    with written_beside(path, overwrite) as temporary:
        data = to_json(scores).encode("utf-8", "surrogatepass")  # which the parser refuses
        parse_scores(parse_json(data, path))
        temporary.write_bytes(data)


def to_json(scores: ScoreFile) -> str:
    """The text of a score file: keys in a fixed order, a line for each column of the items."""
    head = {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "task": scores.task,
        "method": scores.method,
        "comparable": scores.comparable,
        "alignment": scores.alignment,
        "metrics": _metrics(scores.metrics),
        **{name: _groups(getattr(scores, name)) for name in GROUPINGS.get(scores.task, ())},
        "meta": _meta(scores.meta),
    }
    text = json.dumps(_plain(head), indent=2, ensure_ascii=False, allow_nan=False)
    lines = [
        f"    {json.dumps(name, ensure_ascii=False)}: {json.dumps(_column(scores.items[name]))}"
        for name in _column_names(scores)
    ]
    return f'{text[:-2]},\n  "items": {{\n' + ",\n".join(lines) + "\n  }\n}\n"


def _metrics(found: Mapping[str, Score]) -> dict[str, Any]:
    return {name: vars(found[name]) for name in in_order(found)}


def _groups(groups: Groups) -> dict[str, Any]:
    """Groups in the order of the numbers that their keys begin with, then by key."""

    def place(key: str) -> tuple[float, str]:
        first = key.partition("-")[0]
        return (float(first) if first.isdecimal() else math.inf, key)

    return {key: _metrics(groups[key]) for key in sorted(groups, key=place)}


def _meta(meta: Meta) -> dict[str, Any]:
    found = dict(vars(meta))
    found["submissions"] = [vars(submission) for submission in meta.submissions]
    for name in ("versions", "counts"):
        found[name] = dict(sorted(found[name].items()))
    if meta.chamfer_floor is None:
        del found["chamfer_floor"]
    return found


def _column_names(scores: ScoreFile) -> list[str]:
    first = (*ID_COLUMNS.get(scores.task, ()), *OPTIONAL_COLUMNS.get(scores.task, ()))
    rest = in_order(name for name in scores.items if name not in first)
    return [name for name in first if name in scores.items] + rest


def _column(values: Any) -> list[Any]:
    array = np.asarray(values)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        return [value if math.isfinite(value) else None for value in array.tolist()]
    found: list[Any] = array.tolist()
    return found


def _plain(value: Any) -> Any:
    """The same in Python's own types; numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {key: _plain(member) for key, member in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(member) for member in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value

"""Checks of files of rows: what one is, how it is told, and those that every kind of file has."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.files.content import ColumnDigest
from scenegen.files.rows import RowBlock, RowFile, content_problems
from scenegen.files.sets.shards import OpenFile

SHOWN = 5  # problems that a check names; of more it gives the number


@dataclass(frozen=True)
class Check:
    """One rule, whether the file keeps it, and what was checked or found wrong (`detail`)."""

    name: str
    ok: bool
    detail: str


def listed_check(name: str, detail: str, problems: Sequence[str]) -> Check:
    """Return the outcome of a check: what was checked, or the first problems."""
    if not problems:
        return Check(name, True, detail)
    more = f" and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
    return Check(name, False, "; ".join(problems[:SHOWN]) + more)


def read_all(
    file: RowFile,
    step: int,
    look: Callable[[RowBlock, int], Iterable[tuple[str, str]]],
    progress: Callable[[int], Any],
) -> tuple[dict[str, str], dict[str, list[str]]]:
    """Read all rows, `step` at a time.

    `look` yields the name of a rule and a sentence for each problem of one row. Returns the
    `content.column_digest` of each column that is whole, by its name, and the problems by rule.
    """
    digests = {name: ColumnDigest() for name in file.fields}
    broken = defaultdict[str, list[str]](list)
    for start in range(0, len(file), step):
        block = RowBlock(file, range(start, min(start + step, len(file))))
        digests = {name: digest for name, digest in digests.items() if name in block.values}
        for name, digest in digests.items():
            digest.update(block.values[name])
        for row in block.rows:
            for rule, problem in look(block, row):
                broken[rule].append(f"row {row}: {problem}")
            progress(1)
    return {name: digest.hex for name, digest in digests.items()}, broken


def content_check(name: str, file: OpenFile, digests: Mapping[str, str]) -> Check:
    """Check that values and attributes are those that were written; `digests` as there."""
    problems = content_problems(file, digests)
    return listed_check(name, "all values and attributes match their SHA-256", problems)


def spread_rows(count: int, items: int) -> list[int]:
    """Return so many rows, or all, spread evenly over a file."""
    rows = np.linspace(0, count - 1, min(items, count)).round().astype(int)
    return [int(row) for row in np.unique(rows)]


def made_elsewhere(stored: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """Return in which versions and settings the maker of a file differs from this machine."""
    return [f"{x} {stored.get(x)}, here {here[x]}" for x in here if stored.get(x) != here[x]]

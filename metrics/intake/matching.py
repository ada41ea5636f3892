"""Which file belongs to which row: by the number in its name, or by the order of names."""

import glob
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from metrics.intake.array_files import READERS
from scenegen.common.errors import SceneGenError

By = Literal["number", "name"]
SHOWN = 3  # files or rows that an error lists
_DIGITS = re.compile("([0-9]+)")


class MatchError(SceneGenError):
    """Files that cannot be matched with the rows of a truth."""


@dataclass(frozen=True)
class Matched:
    """A file for each row, (N,), and in words how they were matched."""

    paths: tuple[Path, ...]
    how: str


def files_of(pattern: str, endings: Collection[str] = READERS) -> list[Path]:
    """Return the files of a pattern such as `out/*.png`, or in a folder, in order of names.

    Raises MatchError where there is none, or one of a folder is of no known format.
    """
    folder = Path(pattern)
    if folder.is_dir():
        paths = [path for path in folder.iterdir() if not path.name.startswith(".")]
        for path in sorted(paths):
            if path.is_file() and path.suffix.lower() not in endings:
                hint = f"name the files with a pattern, such as '{folder}/*.png'"
                expected = f"files that end in {', '.join(endings)}"
                raise MatchError(folder, f"{path.name:.80}", expected, hint)
    else:
        paths = [Path(name) for name in glob.glob(_with_names_escaped(pattern))]
    paths = sorted(path for path in paths if path.is_file())
    if not paths:
        raise MatchError(pattern, "no file", "one for each row")
    return paths


def _with_names_escaped(pattern: str) -> str:
    """Return a pattern in which the names of folders and files that exist mean themselves."""
    place, escaped = Path(), Path()
    for part in Path(pattern).parts:
        place /= part
        escaped /= glob.escape(part) if place.exists() else part
    return str(escaped)


def match_names(paths: Sequence[Path], names: Sequence[str]) -> Matched | None:
    """Return the file of each name, without its ending; None unless each has one."""
    named = {path.stem: path for path in paths}
    if len(named) < len(paths) or named.keys() != set(names) or len(named) < len(names):
        return None
    return Matched(tuple(named[name] for name in names), "by the names of the pictures")


def match_files(
    paths: Sequence[Path], count: int, views: NDArray[Any] | None = None, by: By = "number"
) -> Matched:
    """Return the file of each of the rows 0 to `count` - 1.

    By number: that in the file's name, from 0, or from 1 where 0 is missing and `count` is there.
    Where names differ in two numbers, these are scene and view. By name: in their order.

    Args:
        views: scene and view of each row, (N, 2).

    Raises MatchError, naming files that are missing, extra, or there twice.
    """
    if by == "name":
        if len(paths) != count:
            raise MatchError(paths[0].parent, f"{len(paths)} files", f"{count}, one for each row")
        return Matched(tuple(paths), f"in the order of their names: {paths[0].name} is row 0")
    by_number = numbered(paths)
    two = len(next(iter(by_number))) == 2
    rows = {} if views is None else {tuple(pair): row for row, pair in enumerate(views.tolist())}
    if two and len(rows) == count and 2 * len(rows.keys() & by_number.keys()) > count:
        how = "by scene and view in their names"
    elif two:
        hint = "say --match name to take files in the order of their names"
        found = f"names that differ in two numbers, such as {paths[0].name}"
        raise MatchError(paths[0].parent, found, "in one, the row, or in scene and view", hint)
    else:
        first = 1 if (0,) not in by_number and (count,) in by_number else 0
        rows = {(first + row,): row for row in range(count)}
        how = f"by the number in their names, counted from {first}"
    missing = [key for key in rows if key not in by_number]
    extra = [by_number[key].name for key in by_number if key not in rows]
    folder = paths[0].parent
    if missing:
        shown = ", ".join("-".join(map(str, key)) for key in missing[:SHOWN])
        found = f"no file numbered {shown}" + f" and {len(missing) - SHOWN} more" * (
            len(missing) > SHOWN
        )
        found += f", beside {', '.join(extra[:SHOWN])}" if extra else ""
        raise MatchError(folder, found, f"{count} files, one for each row")
    if extra:
        found = f"{len(paths)} files, also {', '.join(extra[:SHOWN])}"
        raise MatchError(folder, found, f"{count}, one for each row")
    found_paths = tuple(by_number[key] for key in rows)
    return Matched(found_paths, f"{how}: {found_paths[0].name} is row 0")


def numbered(paths: Sequence[Path]) -> Mapping[tuple[int, ...], Path]:
    """Return the files by the numbers that tell them apart, in their order.

    Names that are alike but for numbers are told apart by those that differ; of others the last
    number counts.
    """
    parts = [_DIGITS.split(path.stem) for path in paths]
    for path, words in zip(paths, parts, strict=True):
        if len(words) == 1:
            hint = "say --match name to take files in the order of their names"
            raise MatchError(path, "no number in the name", "the number of a row", hint)
    numbers = [tuple(int(word) for word in words[1::2]) for words in parts]
    alike = len({tuple(words[::2]) for words in parts}) == 1
    places = [-1]
    if alike and len(paths) > 1:
        columns = list(zip(*numbers, strict=True))
        places = [i for i, column in enumerate(columns) if len(set(column)) > 1] or [-1]
        places = places if len(places) < 3 else [-1]
    keys = [tuple(row[place] for place in places) for row in numbers]
    by_key: dict[tuple[int, ...], Path] = {}
    for key, path in zip(keys, paths, strict=True):
        if key in by_key:
            found = f"{by_key[key].name} and {path.name}, both numbered {'-'.join(map(str, key))}"
            raise MatchError(path.parent, found, "each number once")
        by_key[key] = path
    return by_key

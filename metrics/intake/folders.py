"""One reader of folders, for truth and for predictions: which file is that of a row, and its array.

Files belong to rows by name, by the numbers in their names, or in the order of their names.
"""

import glob
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from metrics.intake.array_files import READERS, read_array
from scenegen.common.errors import SceneGenError

Array = NDArray[Any]
By = Literal["number", "name"]
Key = tuple[int, ...]  # the numbers in a name that tell it from others
Keys = Callable[[], Sequence[Sequence[Key]]]
RowReader = Callable[[int], tuple[str, Array]]  # from a row to its place in words, and its array
SHOWN = 3  # files or rows that an error lists
ORDER = "use --match name to assign files in alphabetical order"
_DIGITS = re.compile("([0-9]+)")


class MatchError(SceneGenError):
    """Files that cannot be matched with the rows of a truth."""


def files_of(pattern: str, endings: Collection[str] = READERS) -> list[Path]:
    """Return the files of a pattern such as `out/*.png`, or in a folder, in order of names.

    Raises MatchError where there is none, or one of a folder is of no known format.
    """
    folder = Path(pattern)
    if folder.is_dir():
        paths = [path for path in folder.iterdir() if not path.name.startswith(".")]
        for path in sorted(paths):
            if path.is_file() and path.suffix.lower() not in endings:
                hint = f"give the files as a pattern, such as '{folder}/*.png'"
                expected = f"files that end in {', '.join(endings)}"
                raise MatchError(folder, f"{path.name:.80}", expected, hint)
    else:
        paths = [Path(name) for name in glob.glob(_with_names_escaped(pattern))]
    paths = sorted(path for path in paths if path.is_file())
    if not paths:
        raise MatchError(pattern, "no file", "one for each image")
    return paths


def _with_names_escaped(pattern: str) -> str:
    """Return a pattern in which the names of folders and files that exist mean themselves."""
    place, escaped = Path(), Path()
    for part in Path(pattern).parts:
        place /= part
        escaped /= glob.escape(part) if place.exists() else part
    return str(escaped)


def row_reader(
    pattern: str,
    names: Sequence[str],
    keys: Keys,
    by: By = "number",
    *,
    array: str | None = None,
    vectors: bool = False,
) -> tuple[RowReader, str]:
    """Return what reads the array of each row, and in words how rows have it.

    Args:
        pattern: a folder, a pattern of files, or one NPY or NPZ file with an image for each row.
        names, keys, by: as `match_files`.
        array, vectors: as `read_array`.

    Raises as `files_of` and `match_files`; the reader as `read_array`.
    """
    files, count = files_of(pattern), len(names)
    if len(files) == 1 and files[0].suffix in (".npy", ".npz"):
        stack = read_array(files[0], array, vectors)
        if stack.ndim > (3 if vectors else 2) and len(stack) == count:
            return lambda row: (f"{files[0]}: row {row}", stack[row]), "one file for each image"
    paths, how = match_files(files, names, keys, by)

    def read(row: int) -> tuple[str, Array]:
        return f"{paths[row]} (row {row})", read_array(paths[row], array, vectors)

    return read, f"{count} files {how}"


def match_files(
    paths: Sequence[Path],
    names: Sequence[str],
    keys: Keys,
    by: By = "number",
) -> tuple[list[Path], str]:
    """Return the file of each row, and in words how it was told.

    By number: the file of the row's name, without endings, where each row has one; else that of the
    row's numbers. By name: in the order of names.

    Args:
        paths: in the order of their names.
        names: of the rows, such as those of their pictures.
        keys: returns numbers of each row; of several lists the one that fits most files is meant.

    Raises MatchError, naming files that are missing, extra, or there twice.
    """
    count, folder = len(names), paths[0].parent
    if by == "name":
        if len(paths) != count:
            raise MatchError(folder, f"{len(paths)} files", f"{count}, one for each image")
        return list(paths), f"in the order of their names: {paths[0].name} is row 0"
    stems, named = [Path(name).stem for name in names], {path.stem: path for path in paths}
    if len(named) == len(paths) == count and named.keys() == set(stems):
        return [named[stem] for stem in stems], "by the names of the images"
    by_key = numbered(paths)
    chosen = max(keys(), key=lambda some: len(by_key.keys() & set(some)))
    both = by_key.keys() & set(chosen)
    if len(next(iter(by_key))) == 2 and 2 * len(both) <= count:
        found = f"names that differ in two numbers, such as {paths[0].name}"
        raise MatchError(folder, found, "in one, the row, or in scene and view", ORDER)
    missing = [f"{name} ({_text(key)})" for name, key in zip(names, chosen, strict=True)
               if key not in by_key]  # fmt: skip
    extra = [path.name for key, path in by_key.items() if key not in both]
    if missing or extra:
        parts = (("no file for ", missing), ("also ", extra))
        found = "; ".join(say + _first_of(some) for say, some in parts if some)
        raise MatchError(folder, found, f"{count} files, one for each image")
    how = f"by the number in their names, counted from {_text(chosen[0])}"
    if len(chosen[0]) == 2:
        how = "by scene and view in their names"
    return [by_key[key] for key in chosen], f"{how}: {by_key[chosen[0]].name} is row 0"


def counted(count: int) -> list[list[Key]]:
    """Return the numbers of rows, counted from 0 or from 1, as `match_files` takes them."""
    return [[(first + row,) for row in range(count)] for first in (0, 1)]


def numbered(paths: Sequence[Path]) -> Mapping[Key, Path]:
    """Return the files by the numbers that tell them apart, in their order.

    Names that are alike but for numbers are told apart by those that differ; of others the last
    number counts. Raises MatchError for a name without a number, and a number that comes twice.
    """
    parts = [_DIGITS.split(path.stem) for path in paths]
    for path, words in zip(paths, parts, strict=True):
        if len(words) == 1:
            raise MatchError(path, "no number in the name", "the number of a row", ORDER)
    alike = len({tuple(words[::2]) for words in parts}) == 1
    places = [-1]
    if alike and len(paths) > 1:
        columns = list(zip(*(words[1::2] for words in parts), strict=True))
        places = [i for i, column in enumerate(columns) if len(set(map(int, column))) > 1] or [-1]
        places = places if len(places) < 3 else [-1]
    by_key: dict[Key, Path] = {}
    for path, words in zip(paths, parts, strict=True):
        key = tuple(int(words[1::2][place]) for place in places)
        if key in by_key:
            found = f"{by_key[key].name} and {path.name}, both numbered {_text(key)}"
            raise MatchError(path.parent, found, "each number once", ORDER)
        by_key[key] = path
    return by_key


def _text(key: Key) -> str:
    return "-".join(map(str, key))


def _first_of(names: Sequence[str]) -> str:
    more = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {more} more" if more > 0 else "")

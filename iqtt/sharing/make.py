"""Make the folder of a split's data card: the page, the Croissant file and the index."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from iqtt.sharing.describe import describe_split
from iqtt.sharing.index import write_index
from iqtt.sharing.published import published_split
from scenegen.sharing.description import DataDescription, Publication
from scenegen.sharing.make import write_card


def make_questions_card(
    split: str | Path,
    folder: str | Path,
    publication: Publication,
    *,
    with_answers: bool = False,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write the data card of a split, whole or in shards, to a folder; return its files.

    The same split and the same publication give the same bytes with the same version of pyarrow.

    Args:
        split: the folder, as `iqtt make-split` writes it.
        folder: to make; with `overwrite`, an older card is replaced.
        publication: what only the person who publishes the data knows.
        with_answers: whether the answers of the test questions are handed out too.
        progress: is told the number of questions that were read since the last call.

    Raises as `write_card` and `published_split`; FileFormatError where a file is damaged.
    """
    found = published_split(split, with_answers)

    def describe(index: Path) -> DataDescription:
        tallies = write_index(index, found.tables, progress)
        return describe_split(found, tallies, index, publication)

    return write_card(folder, describe, overwrite)

"""Make the folder of a data card: the page, the Croissant file and the index, all or none."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scenegen.files.new_folder import folder_written_beside
from scenegen.sharing.card import card_markdown
from scenegen.sharing.croissant import croissant_json
from scenegen.sharing.description import DataDescription, Publication
from scenegen.sharing.index import write_index
from scenegen.sharing.rooms import check_names, describe_rooms

CARD, CROISSANT, INDEX = "README.md", "croissant.json", "index.parquet"
NAMES = (CARD, CROISSANT, INDEX)


def make_rooms_card(
    files: Sequence[str | Path],
    folder: str | Path,
    publication: Publication,
    *,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write the data card of some files of rooms, or sets of shards, to a folder; return its files.

    The same files and the same publication give the same bytes with the same version of pyarrow.
    All values of the files are read once, for the digests in the index.

    Args:
        files: each one a file of rooms, or the file of a set of shards.
        folder: to make; with `overwrite`, an older card is replaced.
        publication: what only the person who publishes the data knows.
        progress: is told the number of rows that were read since the last call.

    Raises:
        OSError: as `write_card`, or there is no such file of rooms.
        FileFormatError: a file is not one of rooms, or is damaged.
        SpecError: two files have one name.
    """
    check_names(files, NAMES)

    def describe(index: Path) -> DataDescription:
        tallies = write_index(index, files, progress)
        return describe_rooms(files, tallies, index, publication)

    return write_card(folder, describe, overwrite)


def write_card(
    folder: str | Path, describe: Callable[[Path], DataDescription], overwrite: bool = False
) -> list[Path]:
    """Write a data card, whatever the data, to a folder that appears complete; return its files.

    Args:
        describe: writes the index to a path and returns what is to be told of the data.

    Raises OSError as `folder_written_beside`, and whatever `describe` raises.
    """
    with folder_written_beside(folder, NAMES, overwrite) as made:
        told = describe(made / INDEX)
        (made / CARD).write_text(card_markdown(told), encoding="utf-8")
        (made / CROISSANT).write_text(croissant_json(told), encoding="utf-8")
    return [Path(folder) / name for name in NAMES]

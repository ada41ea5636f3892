"""Make the folder of a data card: the page, the Croissant file and the index, all or none."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scenegen.common.new_folder import folder_written_beside
from scenegen.sharing.card import card_markdown
from scenegen.sharing.croissant import croissant_json
from scenegen.sharing.description import Publication
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
        OSError: as `folder_written_beside`, or there is no such file of rooms.
        FileFormatError: a file is not one of rooms, or is damaged.
        SpecError: two files have one name.
    """
    check_names(files, NAMES)
    with folder_written_beside(folder, NAMES, overwrite) as made:
        tallies = write_index(made / INDEX, files, progress)
        told = describe_rooms(files, tallies, made / INDEX, publication)
        (made / CARD).write_text(card_markdown(told), encoding="utf-8")
        (made / CROISSANT).write_text(croissant_json(told), encoding="utf-8")
    return [Path(folder) / name for name in NAMES]

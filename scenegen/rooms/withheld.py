"""Rooms without their truth, to be handed out as a test set, as questions have files of answers.

`rooms.h5` then holds images, cameras and the numbers of scenes and views. The truth is in
`rooms-truth.h5`, a whole file of rooms, with the same fingerprint.
"""

from dataclasses import replace
from pathlib import Path

import h5py

from scenegen.common.errors import FileFormatError
from scenegen.files.input_file import is_virtual
from scenegen.files.row_file import new_hdf5_file
from scenegen.layout import WITHHELD
from scenegen.rooms.reader import WITHOUT_TRUTH, RoomsFile


def truth_path(path: str | Path) -> Path:
    """Return the name of the file of truth that belongs to a file without it."""
    path = Path(path)
    return path.with_name(f"{path.stem}-truth{path.suffix}")


def truth_beside(path: str | Path) -> Path | None:
    """Return the file of truth beside a rooms file that lacks its own; None if there is none.

    Raises as `RoomsFile`.
    """
    with RoomsFile(path) as rooms:
        lacks = not rooms.has_truth
    beside = truth_path(path)
    return beside if lacks and beside.is_file() else None


def withhold_truth(truth: str | Path, out: str | Path, overwrite: bool = False) -> None:
    """Write images, cameras and row numbers of a rooms file to another file.

    Neither the seed nor the command that made the rooms is in it. Its fingerprint and digests are
    those of the truth; whoever guesses preset and seed can make the truth again.

    Raises OSError as `row_file.new_hdf5_file`, FileFormatError as `RoomsFile`, and where the rooms
    are a set of shards, or lack their truth themselves.
    """
    with RoomsFile(truth) as rooms, new_hdf5_file(out, overwrite) as file:
        source = rooms.opened.file
        if not rooms.has_truth:
            raise FileFormatError(truth, "rooms without ground truth", "a whole file of rooms")
        names = [name for name in WITHOUT_TRUTH if name in source]
        if any(is_virtual(source[name]) for name in names):
            hint = "merge it with `scenegen merge`, or render with a larger --shard-size"
            raise FileFormatError(truth, "a set of shards", "one file", hint)
        for name in names:
            home = file.require_group(str(Path(name).parent)) if "/" in name else file
            source.copy(source[name], home, name.rpartition("/")[2])
        _copy_attributes(source, file, rooms)


def _copy_attributes(source: h5py.File, file: h5py.File, rooms: RoomsFile) -> None:
    """Copy the attributes of the root, without what tells how the rooms were made."""
    for name, value in source.attrs.items():
        file.attrs[name] = value
    file.attrs["spec"] = replace(rooms.spec, seed=0, truth=()).to_json()
    file.attrs["creation_command"] = ""
    file.attrs[WITHHELD] = "truth"

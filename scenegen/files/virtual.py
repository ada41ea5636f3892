"""Write the file of a set of shards: virtual data sets over them, and the list of the shards."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from scenegen.common.errors import FileFormatError
from scenegen.files.axes import name_axes
from scenegen.files.content import CONTENT_DIGEST, SHA256, dataset_digest
from scenegen.files.shards import ROW_DIGESTS, SHARDS, Shard, opened


def write_virtual(
    file: h5py.File, folder: Path, shards: Sequence[Shard], axes: Mapping[str, Any]
) -> None:
    """Write virtual data sets over shards, at least one, of one part of a set.

    Data sets that count an axis are copied from the first shard.

    Args:
        folder: where the shards are now.
        axes: names of the axes of a row, by name of the data set; None where they have no names.
    """
    rows = sum(shard.rows for shard in shards)
    with opened(folder / shards[0].file) as first:
        for name, names in axes.items():
            model = first[name]
            layout = h5py.VirtualLayout((rows, *model.shape[1:]), model.dtype)
            layout.dcpl.set_obj_track_times(False)  # the same bytes at any time
            start = 0
            for shard in shards:
                shape = (shard.rows, *model.shape[1:])
                layout[start : start + shard.rows] = h5py.VirtualSource(shard.file, name, shape)
                start += shard.rows
            fill = np.nan if model.dtype.kind == "f" else None
            dataset = file.create_virtual_dataset(name, layout, fillvalue=fill)
            own = ("DIMENSION_LABELS", "DIMENSION_LIST", SHA256)
            dataset.attrs.update({k: v for k, v in model.attrs.items() if k not in own})
            if names is not None:
                name_axes(file, dataset, ("row", *names))
    for name, digest in _joint_digests(folder, shards).items():
        file[name].attrs[SHA256] = digest.hexdigest()


def write_list(file: h5py.File, shards: Sequence[Shard]) -> None:
    """Write the list of all shards of a set, those of each part in their order."""
    lines = np.array([json.dumps(vars(shard)) for shard in shards], object)
    listed = file.create_dataset(SHARDS, data=lines, dtype=h5py.string_dtype())
    listed.attrs["meaning"] = "the files beside this one that hold the values, in their order"
    listed.attrs[SHA256] = dataset_digest(lines)


def _joint_digests(folder: Path, shards: Iterable[Shard]) -> "dict[str, hashlib._Hash]":
    """Return the `column_digest` of each data set over all shards.

    Raises FileFormatError where a shard is not the one that was recorded.
    """
    found: dict[str, hashlib._Hash] = {}
    for shard in shards:
        with opened(folder / shard.file) as file:
            if file.attrs.get(CONTENT_DIGEST) != shard.content_digest:
                hint = "another run has written it meanwhile; say the command again"
                raise FileFormatError(folder / shard.file, "other content", "that was made", hint)
            digests = file[ROW_DIGESTS]
            values = digests[()]
            for i, name in enumerate(digests.attrs["names"]):
                found.setdefault(name, hashlib.sha256()).update(values[:, i].tobytes())
    return found

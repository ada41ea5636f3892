"""The datasets of an HDF5 submission, opened and checked but for their values.

Nothing here raises on broken content, follows a link, or reads a value.
"""

import itertools
import math
from typing import Any

import h5py
import numpy as np

from metrics.submissions.layout import MOST_ROWS, Dataset
from metrics.submissions.problems import Problem
from metrics.submissions.texts import READ_ERRORS
from scenegen.common.row_file import reason
from scenegen.description.specs import MAX_PIXELS

MOST_BYTES = 256 * 2**20  # to be unpacked for one row
CHUNK_SLOTS = 10_007
LEAST_CACHE = 1 << 20


def open_dataset(
    file: h5py.File, dataset: Dataset, count: int | None
) -> tuple[h5py.Dataset | None, list[Problem]]:
    """Open a dataset that should have `count` rows, any number if None.

    Returns None with what is wrong with it, or without a problem where it is not there and need
    not be.
    """
    try:
        link = file.get(dataset.name, getlink=True)
        if link is None:
            return None, [_missing(file, dataset)] if dataset.required else []
        problems = _link_problems(link, dataset.name)
        if problems:
            return None, problems
        item = file[dataset.name]
        problems = _problems(item, dataset, count)
        if problems:
            return None, problems
        size = _slab_bytes(item)
        del item  # an open dataset keeps the cache that it has
        return _open_with_cache(file, dataset.name, size), []
    except READ_ERRORS as error:
        got = f"cannot be opened ({reason(error)})"
        return None, [Problem(dataset.name, "readable", dataset.kind, got)]


def names(file: h5py.File) -> str:
    """The names of the first few things in a file, for a message."""
    first = [f"{name!r:.40}" for name in itertools.islice(file, 9)]
    return ", ".join(first[:8] + ["..."] * (len(first) > 8)) or "none at all"


def _missing(file: h5py.File, dataset: Dataset) -> Problem:
    expected = f"{dataset.shown_shape} {dataset.kind}"
    got = f"no such dataset; found {names(file)}"
    return Problem(dataset.name, "present", expected, got)


def _link_problems(link: Any, name: str) -> list[Problem]:
    if isinstance(link, h5py.HardLink):
        return []
    where = f" to the file {link.filename!r:.60}" if isinstance(link, h5py.ExternalLink) else ""
    return [Problem(name, "link", "a dataset in the submission itself", f"a link{where}")]


def _problems(item: Any, dataset: Dataset, count: int | None) -> list[Problem]:
    """Say what is wrong with type, shape and storage."""
    name = dataset.name
    if not isinstance(item, h5py.Dataset):
        return [Problem(name, "type", "a dataset", f"a {type(item).__name__.lower()}")]
    problems = []
    if item.dtype.kind not in dataset.kinds:
        problems.append(Problem(name, "type", dataset.kind, f"type {_type_name(item.dtype)}"))
    shape: tuple[int, ...] = item.shape or ()
    if not _fits(shape, dataset):
        problems.append(Problem(name, "shape", dataset.shown_shape, f"shape {item.shape}"))
    elif count is not None and shape[0] != count:
        problems.append(Problem(name, "count", f"{count}, one for each id", f"{shape[0]} rows"))
    elif shape[0] > MOST_ROWS:
        problems.append(Problem(name, "count", f"at most {MOST_ROWS:,}", f"{shape[0]} rows"))
    elif math.prod(shape[1:3]) > MAX_PIXELS:
        got = f"images of {shape[1]}x{shape[2]}"
        problems.append(Problem(name, "shape", f"at most {MAX_PIXELS:,} pixels", got))
    return problems or _storage_problems(item, name)


def _fits(shape: tuple[int, ...], dataset: Dataset) -> bool:
    """Whether a shape has the right axes, none of them empty but perhaps the first."""
    sizes = shape[1:]
    if not shape or len(sizes) != len(dataset.shape) or 0 in sizes:
        return False
    return all(isinstance(e, str) or e == s for e, s in zip(dataset.shape, sizes, strict=True))


def _storage_problems(item: h5py.Dataset, name: str) -> list[Problem]:
    if item.external or item.is_virtual:
        expected = "values in the submission itself"
        return [Problem(name, "link", expected, "values that lie in another file")]
    size = _slab_bytes(item)
    if size > MOST_BYTES:
        got = f"chunks {item.chunks}, so that a row takes {size >> 20} MiB to unpack"
        expected = f"at most {MOST_BYTES >> 20} MiB (store one row to a chunk)"
        return [Problem(name, "chunks", expected, got)]
    if item.size and item.id.get_storage_size() == 0:
        return [Problem(name, "written", "values", f"shape {item.shape}, but nothing was written")]
    return []


def _slab_bytes(item: h5py.Dataset) -> int:
    """Bytes of all chunks that one row touches; 0 of a dataset without chunks."""
    if item.chunks is None:
        return 0
    padded = [-(-s // c) * c for s, c in zip(item.shape[1:], item.chunks[1:], strict=True)]
    return int(item.chunks[0] * math.prod(padded) * item.dtype.itemsize)


def _open_with_cache(file: h5py.File, name: str, size: int) -> h5py.Dataset:
    """Open a dataset so that chunks of many rows are not unpacked anew for each of them."""
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_chunk_cache(CHUNK_SLOTS, max(size, LEAST_CACHE), 1.0)
    return h5py.Dataset(h5py.h5d.open(file.id, name.encode(), access))


def _type_name(dtype: np.dtype[Any]) -> str:
    if h5py.check_string_dtype(dtype) is not None:
        return "text"
    if h5py.check_ref_dtype(dtype) is not None:
        return "reference"
    return "compound" if dtype.names else str(dtype)

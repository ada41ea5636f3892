"""Streams beside the files of the same requests."""

import h5py
import numpy as np


def stored(path, *groups):
    """Return all columns of numbers of a file, by name; of several groups what all of them have."""
    with h5py.File(path) as file:
        found = []
        for group in groups or ("/",):
            columns = {}
            file[group].visititems(
                lambda name, item, columns=columns: (
                    columns.update({name: item[:]})
                    if "meaning" in item.attrs and item.dtype.kind not in "SO"
                    else None
                )
            )
            found.append(columns)
    names = set.intersection(*map(set, found))
    return {name: np.concatenate([part[name] for part in found]) for name in names}


def check_equal(stream, expected):
    """The rows of a stream are those of the columns, and come in batches of the size asked for."""
    batches = list(stream)
    sizes = [len(next(iter(batch.values()))) for batch in batches]
    assert set(sizes[:-1]) <= {stream.batch}
    assert {name for batch in batches for name in batch} == expected.keys()
    for name, values in expected.items():
        rows = np.concatenate([batch[name] for batch in batches])
        assert rows.dtype == values.dtype == stream.columns[name].dtype, name
        np.testing.assert_array_equal(rows, values, err_msg=name)

"""Edits of HDF5 files: each makes a function that changes an open file, to spoil a good one."""

import json

import h5py

from scenegen.files.schema import name_axes


def attribute(name, value):
    return lambda file: file.attrs.update({name: value})


def gone(*names):
    def edit(file):
        for name in names:
            del (file if name in file else file.attrs)[name]

    return edit


def replaced(name, make):
    """Another dataset in place of one, made from its values."""

    def edit(file):
        values = file[name][()]
        del file[name]
        file[name] = make(values)

    return edit


def values(name, change):
    """Other values in the same dataset."""

    def edit(file):
        file[name][...] = change(file[name][()].copy())

    return edit


def put(name, at, value):
    """One other value."""

    def change(array):
        array[at] = value
        return array

    return values(name, change)


def in_all(*edits):
    def edit(file):
        for one in edits:
            one(file)

    return edit


def claims(name, shape, dtype="f4", **options):
    """A dataset that says it is large, and holds nothing."""

    def edit(file):
        del file[name]
        file.create_dataset(name, shape, dtype, **options)

    return edit


def grouped(name):
    def edit(file):
        del file[name]
        file.create_group(name)

    return edit


def linked(name, link):
    def edit(file):
        del file[name]
        file[name] = link

    return edit


def damaged_chunk(name, row):
    """Bytes of a row's chunk, but for the first few, spoiled."""

    def edit(file):
        at = (row, *(0,) * (file[name].ndim - 1))
        _, data = file[name].id.read_direct_chunk(at)
        file[name].id.write_direct_chunk(at, data[:20] + b"\x55" * (len(data) - 20))

    return edit


def edit_scene(row, change):
    """A change of the scene that one row of a file of rooms describes."""

    def edit(file):
        scene = json.loads(file["scene"][row])
        change(scene)
        text = json.dumps(scene, separators=(",", ":")).encode()
        if len(text) > file["scene"].dtype.itemsize:  # HDF5 would cut it
            _lengthen(file, "scene", len(text))
        file["scene"][row] = text

    return edit


def _lengthen(file, name, length):
    """Let a column of texts of one axis hold longer ones."""
    kept = {key: value for key, value in file[name].attrs.items() if "DIMENSION" not in key}
    values = file[name][()].astype(h5py.string_dtype(length=length))
    del file[name]
    dataset = file.create_dataset(name, data=values, chunks=values.shape)
    dataset.attrs.update(kept)
    name_axes(file, dataset, ("row",))


def swap_rows(a, b, *names):
    """Two rows of some datasets, or of all, in each other's place."""

    def edit(file):
        found = []
        rows = lambda x: hasattr(x, "dtype") and not x.is_scale  # noqa: E731
        file.visititems(lambda name, x: found.append(name) if rows(x) else None)
        for name in names or found:
            rows = file[name][:]
            rows[[a, b]] = rows[[b, a]]
            file[name][:] = rows

    return edit


def told_again(file):
    """New digests of what a file of rooms holds now, as if it had been written so."""
    from scenegen.files.content import SHA256, dataset_digest, datasets, seal
    from scenegen.layout import TRUTH_DIGEST
    from scenegen.rooms.reader import truth_digest

    for _, dataset in datasets(file):
        dataset.attrs[SHA256] = dataset_digest(dataset)
    file.attrs[TRUTH_DIGEST] = truth_digest(file)
    seal(file)

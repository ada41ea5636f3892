"""Changes of what an HDF5 file holds: attributes, data sets, links, and how values are stored."""

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fuzz.values import attribute_value

PIXELS = ("nan", "inf", "-inf", "9e99", "1e308", "-1", "0", "1e-320", "127", "-128", "255", "32767",
          "2147483647", "9223372036854775807", "3")  # fmt: skip
NO_ZLIB = b"\x78\x01\x00\xff\x00"  # what zlib cannot inflate


def attribute(path: Path, place: str, value: str) -> None:
    """Give an attribute, such as "depth@unit", another value by name; "gone" removes it."""
    where, _, name = place.rpartition("@")
    with h5py.File(path, "r+", libver="latest") as file:
        if value == "gone":
            del file[where].attrs[name]
        else:
            file[where].attrs.create(name, attribute_value(value))


def pixels(path: Path, where: str, row: float, part: float, value: str) -> None:
    """Give some values of a row, or all with a part of 1, another value."""
    with h5py.File(path, "r+") as file:
        data = file[where]
        index = int(row * len(data))
        values = np.array(data[index])
        flat = values.reshape(-1)
        with np.errstate(over="ignore"):
            flat[: max(1, int(part * flat.size))] = _number(value, data.dtype)
        data[index] = flat.reshape(values.shape)


def _number(value: str, kind: np.dtype[Any]) -> float | str:
    """Return the number nearest to what a text says that the type can hold, or the text."""
    if kind.kind == "f":
        return float(value)
    if kind.kind not in "iu":
        return value
    if value in ("nan", "inf", "-inf"):
        return 0
    limits = np.iinfo(kind)
    return min(max(int(float(value)), int(limits.min)), int(limits.max))


# Other types and shapes: a function of the values.
ARRAYS: dict[str, Callable[[Any], Any]] = {
    **{
        kind: lambda values, kind=kind: values.astype(kind)
        for kind in ("f2", "f4", "f8", ">f4", "g", "i1", "u1", "i4", "i8", "u8", "?", "c8", "S3")
    },
    "text": lambda values: np.full(values.shape, "far", object),
    "compound": lambda values: np.zeros(values.shape, [("z", "f4"), ("s", "S2")]),
    "enumeration": lambda values: np.zeros(values.shape, h5py.enum_dtype({"NO": 0}, "i1")),
    "nothing": lambda values: h5py.Empty("f4"),
    "a scalar": lambda values: values.reshape(-1)[0],
    "no rows": lambda values: values[:0],
    "one row": lambda values: values[:1],
    "twice": lambda values: np.concatenate([values, values]),
    "backwards": lambda values: values[::-1],
    "first axis": lambda values: values[None],
    "no last axis": lambda values: values[..., 0],
    "swapped axes": lambda values: np.moveaxis(values, 0, -1),
    "flat": lambda values: values.reshape(-1),
}


def array(path: Path, where: str, change: str) -> None:
    """Store the values with another type or in another shape."""
    with h5py.File(path, "r+") as file, np.errstate(all="ignore"):
        notes, new = dict(file[where].attrs), ARRAYS[change](np.array(file[where][()]))
        del file[where]
        file.create_dataset(where, data=new).attrs.update(notes)


def remove(path: Path, where: str) -> None:
    """Remove a data set."""
    with h5py.File(path, "r+") as file:
        del file[where]


def _names(file: h5py.File) -> None:
    for name in ("\x1b[2J", "a\nb", "x" * 5000, "\u202egnp"):
        file[name] = np.zeros(3)
        file.attrs[name] = "\x1b[31m"
    h5py.h5g.create(file.id, b"\xff\xfe")


ADDED: dict[str, Callable[[h5py.File], Any]] = {
    "groups": lambda file: [file.create_group(f"more/{i}") for i in range(20_000)],
    "attributes": lambda file: file.attrs.update({f"more{i}": i for i in range(3000)}),
    "depth": lambda file: file.create_group("/".join(["more"] * 1500)),
    "names": _names,
    "bytes": lambda file: file.create_dataset("more", (2000,) * 3, "f8", chunks=(100,) * 3),
}


def add(path: Path, thing: str) -> None:
    """Add what nobody asked for."""
    with h5py.File(path, "r+") as file:
        ADDED[thing](file)


def _fifo(file: h5py.File) -> str:
    """Make a pipe beside a file, and return its name."""
    os.mkfifo(Path(file.filename).parent / "pipe.h5")
    return "pipe.h5"


# Links in the place of an object: a function of the file, the object's name and another's name.
LINKS: dict[str, Callable[[h5py.File, str, str], Any]] = {
    "soft to itself": lambda file, where, other: h5py.SoftLink(where),
    "soft to nothing": lambda file, where, other: h5py.SoftLink("/nowhere"),
    "soft to another": lambda file, where, other: h5py.SoftLink(other),
    "fifo": lambda file, where, other: h5py.ExternalLink(_fifo(file), where),
    "file itself": lambda file, where, other: h5py.ExternalLink(file.filename, where),
    "device": lambda file, where, other: h5py.ExternalLink("/dev/zero", where),
    "hard to the root": lambda file, where, other: file["/"],
    "hard to another": lambda file, where, other: file[other],
}


def link(path: Path, where: str, kind: str, other: str) -> None:
    """Put a link in the place of an object."""
    with h5py.File(path, "r+") as file:
        target = LINKS[kind](file, where, other)
        del file[where]
        file[where] = target


def _raw(file: h5py.File, where: str, values: Any, name: str) -> None:
    """Store values in another file, beginning with its first byte."""
    _replace(file, where, values, external=[(name, 0, values.nbytes)])


def _virtual(file: h5py.File, where: str, values: Any, source: str) -> None:
    """Put a view of another file in the place of values."""
    layout = h5py.VirtualLayout(values.shape, values.dtype)
    layout[...] = h5py.VirtualSource(source, where, values.shape)
    del file[where]
    file.create_virtual_dataset(where, layout)


def _chunk(file: h5py.File, where: str, values: Any, packed: bytes, **options: Any) -> None:
    """Store one chunk, as it is."""
    _replace(file, where, values, **{"chunks": (1, *values.shape[1:]), **options})
    file[where].id.write_direct_chunk((0,) * values.ndim, packed)


def _bomb(file: h5py.File, where: str, values: Any) -> None:
    """Write one chunk of 3 GB of zeros, in 3 MB."""
    rows = 3 * 2**30 // max(1, values[0].nbytes)
    options = {"chunks": (rows, *values.shape[1:]), "maxshape": (None, *values.shape[1:])}
    _chunk(file, where, values, _zeros(rows * values[0].nbytes), compression="gzip", **options)


def _zeros(count: int) -> bytes:
    """Return many zeros, packed by zlib, at no more cost than packing a few."""
    packer, size = zlib.compressobj(9, zlib.DEFLATED, -15), 2**20
    block = packer.compress(bytes(size)) + packer.flush(zlib.Z_FULL_FLUSH)
    rest = zlib.compressobj(9, zlib.DEFLATED, -15)
    last = rest.compress(bytes(count % size)) + rest.flush()
    return b"\x78\xda" + block * (count // size) + last + struct.pack(">HH", count % 65521, 1)


def _unknown_filter(file: h5py.File, where: str, values: Any) -> None:
    del file[where]
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((1, *values.shape[1:]))
    properties.set_filter(300, h5py.h5z.FLAG_OPTIONAL, (1,))
    kind, space = h5py.h5t.py_create(values.dtype), h5py.h5s.create_simple(values.shape)
    h5py.h5d.create(file.id, where.encode(), kind, space, properties)
    file[where].id.write_direct_chunk((0,) * values.ndim, bytes(64))


# Other ways to store values, and other places: a function of file, name and values.
STORES: dict[str, Callable[[h5py.File, str, Any], None]] = {
    "raw secret": lambda file, where, v: _raw(file, where, v, "/etc/passwd"),
    "raw fifo": lambda file, where, v: _raw(file, where, v, _fifo(file)),
    "virtual": lambda file, where, v: _virtual(file, where, v, "other.h5"),
    "virtual itself": lambda file, where, v: _virtual(file, where, v, "."),
    "virtual fifo": lambda file, where, v: _virtual(file, where, v, _fifo(file)),
    "unwritten": lambda file, where, v: _replace(file, where, v, chunks=(1, *v.shape[1:])),
    "fill value": lambda file, where, v: _replace(file, where, v, fillvalue=1),
    "huge shape": lambda file, where, v: _replace(
        file, where, v, shape=(2**40, *v.shape[1:]), chunks=(1, *v.shape[1:])
    ),
    "tiny chunks": lambda file, where, v: _replace(file, where, v, data=v, chunks=(1,) * v.ndim),
    "many filters": lambda file, where, v: _replace(
        file, where, v, data=v, compression="gzip", shuffle=True, fletcher32=True
    ),
    "short chunk": lambda file, where, v: _chunk(file, where, v, b"\x01"),
    "damaged chunk": lambda file, where, v: _chunk(file, where, v, NO_ZLIB, compression="gzip"),
    "bomb": _bomb,
    "unknown filter": _unknown_filter,
}


def store(path: Path, where: str, way: str) -> None:
    """Store the values of a data set in another way, or elsewhere; its attributes stay."""
    with h5py.File(path, "r+") as file:
        notes = dict(file[where].attrs)
        STORES[way](file, where, np.array(file[where][()]))
        file[where].attrs.update(notes)


def _replace(file: h5py.File, where: str, values: Any, **options: Any) -> None:
    del file[where]
    file.create_dataset(where, **{"shape": values.shape, "dtype": values.dtype, **options})

"""Changes of what an HDF5 file holds: attributes, data sets, links, and how values are stored."""

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fuzz.values import ATTRIBUTES, set_attribute

Rng = np.random.Generator
PIXELS = ("nan", "inf", "-inf", "9e99", "1e308", "-1", "0", "1e-320", "127", "-128", "255", "32767",
          "2147483647", "-2147483648", "9223372036854775807", "3")  # fmt: skip
DTYPES = ("f2", "f4", "f8", ">f4", "g", "i1", "u1", "i4", "u2", "i8", "u8", "?", "c8", "text",
          "S3", "V5", "compound", "ragged", "reference", "enumeration")  # fmt: skip
SHAPES = ("()", "nothing", "no rows", "one row", "twice", "first axis", "no last axis", "swapped",
          "flat", "no pixels", "10**6 rows")  # fmt: skip
LINKS = ("soft to itself", "soft to nothing", "soft to another", "file", "fifo", "file itself",
         "device", "hard to the root", "hard to another")  # fmt: skip
STORAGES = ("raw file", "raw secret", "raw fifo", "virtual", "virtual itself", "virtual fifo",
            "unwritten", "fill value", "bomb", "huge chunk", "short chunk", "unknown filter",
            "many filters", "huge shape", "tiny chunks", "compact", "damaged chunk")  # fmt: skip
CHANCES = {"attribute": 0.3, "pixels": 0.16, "retype": 0.1, "reshape": 0.1, "swap": 0.04,
           "remove": 0.04, "add": 0.04, "link": 0.08, "store": 0.14}  # fmt: skip


def attribute(path: Path, where: str, name: str, value: str) -> None:
    """Give an attribute another value, by name; "gone" removes it."""
    with h5py.File(path, "r+", libver="latest") as file:
        if value == "gone":
            del file[where].attrs[name]
        else:
            set_attribute(file, where, name, value)


def pixels(path: Path, where: str, rows: list[float], part: float, value: str) -> None:
    """Give some values of some rows, or all with a part of 1, another value."""
    with h5py.File(path, "r+") as file:
        data = file[where]
        kind = data.dtype
        for row in rows:
            index = int(row * len(data))
            old = np.array(data[index])
            flat = old.reshape(-1)
            with np.errstate(over="ignore"):
                flat[: max(1, int(part * flat.size))] = _number(value, kind)
            data[index] = flat.reshape(old.shape)


def _number(value: str, kind: np.dtype[Any]) -> float | str:
    """Return a number nearest to what a text says that the type can hold, or the text."""
    if kind.kind == "f":
        return float(value)
    if kind.kind not in "iu":
        return value
    if value in ("nan", "inf", "-inf"):
        return 0
    limits = np.iinfo(kind)
    return min(max(int(float(value)), int(limits.min)), int(limits.max))


def retype(path: Path, where: str, dtype: str) -> None:
    """Store the values with another type."""
    with h5py.File(path, "r+") as file:
        old = file[where][()]
        shape = np.shape(old)
        special: dict[str, Callable[[], dict[str, Any]]] = {
            "text": lambda: {"data": np.full(shape, "far", object), "dtype": h5py.string_dtype()},
            "compound": lambda: {"data": np.zeros(shape, [("z", "f4"), ("s", "S2")])},
            "ragged": lambda: {"shape": shape, "dtype": h5py.vlen_dtype("f4")},
            "reference": lambda: {"data": np.full(shape, file.ref, h5py.ref_dtype)},
            "enumeration": lambda: {"data": np.zeros(shape, "i1"),
                                    "dtype": h5py.enum_dtype({"NO": 0, "YES": 1}, "i1")},
        }  # fmt: skip
        if dtype in special:
            how = special[dtype]()
        elif old.dtype.kind == "O" or dtype == "V5":
            how = {"data": np.zeros(shape, dtype)}
        else:
            with np.errstate(all="ignore"):
                how = {"data": old.astype(dtype)}
        _replaced(file, where, **how)


def reshape(path: Path, where: str, shape: str) -> None:
    """Store the values in another shape."""
    changes: dict[str, Callable[[Any], Any]] = {
        "()": lambda v: v.reshape(-1)[0] if v.size else 0,
        "no rows": lambda v: v[:0],
        "one row": lambda v: v[:1],
        "twice": lambda v: np.concatenate([v, v]),
        "first axis": lambda v: v[None],
        "no last axis": lambda v: v[..., 0] if v.ndim > 1 else v,
        "swapped": lambda v: np.moveaxis(v, 0, -1),
        "flat": lambda v: v.reshape(-1),
        "no pixels": lambda v: v[:, :0] if v.ndim > 1 else v[:0],
    }
    with h5py.File(path, "r+") as file:
        old = file[where]
        kind, values = old.dtype, np.array(old[()])
        if shape == "nothing":
            _replaced(file, where, data=h5py.Empty("f4"))
        elif shape == "10**6 rows":  # nothing is stored
            _replaced(file, where, shape=(10**6, *old.shape[1:]), dtype=kind,
                      chunks=(1, *old.shape[1:]))  # fmt: skip
        else:
            _replaced(file, where, data=changes[shape](values), dtype=kind)


def swap(path: Path, where: str, first: float, second: float) -> None:
    """Exchange two rows."""
    with h5py.File(path, "r+") as file:
        data = file[where]
        one, two = int(first * len(data)), int(second * len(data))
        data[one], data[two] = data[two], data[one]


def remove(path: Path, where: str) -> None:
    """Remove an object."""
    with h5py.File(path, "r+") as file:
        del file[where]


def add(path: Path, what: str) -> None:
    """Add what nobody asked for."""
    with h5py.File(path, "r+") as file:
        if what == "groups":
            for i in range(20_000):
                file.create_group(f"more/{i}")
        elif what == "attributes":
            for i in range(3000):
                file.attrs[f"more{i}"] = i
        elif what == "depth":
            file.create_group("/".join(["more"] * 1500))
        elif what == "names":
            for name in ("\x1b[2J", "a\nb", "x" * 5000, "\u202egnp"):
                file[name] = np.zeros(3)
                file.attrs[name] = "\x1b[31m"
        elif what == "raw name":
            h5py.h5g.create(file.id, b"\xff\xfe")
            kind, space = h5py.h5t.NATIVE_INT8, h5py.h5s.create(h5py.h5s.SCALAR)
            h5py.h5a.create(file.id, b"\xff\xfd", kind, space)
        elif what == "named type":
            file["more"] = np.dtype("f4")
        elif what == "bytes":
            file.create_dataset("more", (2000, 2000, 2000), "f8", chunks=(100, 100, 100))


ADDED = ("groups", "attributes", "depth", "names", "raw name", "named type", "bytes")


def link(path: Path, where: str, kind: str, other: str) -> None:
    """Put a link in the place of an object."""
    fifo = path.parent / "pipe.h5"
    with h5py.File(path, "r+") as file:
        makers: dict[str, Callable[[], Any]] = {
            "soft to itself": lambda: h5py.SoftLink(where),
            "soft to nothing": lambda: h5py.SoftLink("/nowhere"),
            "soft to another": lambda: h5py.SoftLink(other),
            "file": lambda: h5py.ExternalLink("secret.h5", where),
            "fifo": lambda: h5py.ExternalLink(fifo.name, where),
            "file itself": lambda: h5py.ExternalLink(path.name, where),
            "device": lambda: h5py.ExternalLink("/dev/zero", where),
            "hard to the root": lambda: file["/"],
            "hard to another": lambda: file[other],
        }
        made = makers[kind]()
        if kind == "fifo" and not fifo.exists():
            os.mkfifo(fifo)
        if kind == "file":
            with h5py.File(path.parent / "secret.h5", "a") as secret:
                secret[where] = file[where][()] if isinstance(file[where], h5py.Dataset) else 1
        del file[where]
        file[where] = made


def store(path: Path, where: str, how: str) -> None:
    """Store the values of a data set in another way, or elsewhere."""
    with h5py.File(path, "r+") as file:
        old = file[where]
        shape, kind, values = old.shape, old.dtype, old[()]
        row = (1, *shape[1:])
        size = int(np.prod(shape)) * kind.itemsize
        if how in ("raw file", "raw secret", "raw fifo"):
            raw = {"raw file": "raw.bin", "raw secret": "/etc/passwd", "raw fifo": "pipe.bin"}[how]
            if how == "raw file":
                (path.parent / raw).write_bytes(np.asarray(values).tobytes())
            elif how == "raw fifo":
                os.mkfifo(path.parent / raw)
            _replaced(file, where, shape=shape, dtype=kind, external=[(raw, 0, size)])
        elif how.startswith("virtual"):
            source = {"virtual": "other.h5", "virtual itself": ".", "virtual fifo": "pipe.h5"}[how]
            if how == "virtual fifo":
                os.mkfifo(path.parent / source)
            layout = h5py.VirtualLayout(shape, kind)
            layout[...] = h5py.VirtualSource(source, where, shape)
            notes = dict(old.attrs)
            del file[where]
            file.create_virtual_dataset(where, layout)
            file[where].attrs.update(notes)
        elif how == "unwritten":
            _replaced(file, where, shape=shape, dtype=kind, chunks=row)
        elif how == "fill value":
            _replaced(file, where, shape=shape, dtype=kind, chunks=row, fillvalue=1)
        elif how == "bomb":  # one chunk of 3 GB of zeros, in 3 MB
            _bomb(file, where, kind, shape, (3 * 2**30 // kind.itemsize, *shape[1:]))
        elif how == "huge chunk":
            _replaced(file, where, shape=shape, dtype=kind, maxshape=(None, *shape[1:]),
                      chunks=(2**31 // max(1, size // shape[0]), *shape[1:]))  # fmt: skip
        elif how == "short chunk":
            _replaced(file, where, shape=shape, dtype=kind, chunks=row)
            for i in range(shape[0]):
                file[where].id.write_direct_chunk((i, *[0] * (len(shape) - 1)), b"\x01")
        elif how == "damaged chunk":
            _replaced(file, where, data=values, dtype=kind, chunks=row, compression="gzip")
            file[where].id.write_direct_chunk((0,) * len(shape), b"\x78\x01\x00\xff\x00")
        elif how == "many filters":
            _replaced(file, where, data=values, dtype=kind, chunks=row, compression="gzip",
                      shuffle=True, fletcher32=True)  # fmt: skip
        elif how == "tiny chunks":
            _replaced(file, where, data=values, dtype=kind, chunks=(1,) * len(shape))
        elif how == "huge shape":
            _replaced(file, where, shape=(2**40, *shape[1:]), dtype=kind, chunks=row)
        elif how == "compact":
            _made(file, where, kind, shape, lambda p: p.set_layout(h5py.h5d.COMPACT))
        elif how == "unknown filter":
            _made(file, where, kind, shape, lambda p: (
                p.set_chunk(row), p.set_filter(300, h5py.h5z.FLAG_OPTIONAL, (1,))))  # fmt: skip
            for i in range(shape[0]):
                file[where].id.write_direct_chunk((i, *[0] * (len(shape) - 1)), bytes(64))


def _replaced(file: h5py.File, where: str, **how: Any) -> None:
    """Write a data set anew; its attributes stay."""
    notes = dict(file[where].attrs)
    del file[where]
    file.create_dataset(where, **how).attrs.update(notes)


def _made(file: h5py.File, where: str, kind: Any, shape: Any, plan: Callable[[Any], Any]) -> None:
    """Write an empty data set with properties that h5py has no words for."""
    notes = dict(file[where].attrs)
    del file[where]
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan(properties)
    space = h5py.h5s.create_simple(shape)
    h5py.h5d.create(file.id, where.encode(), h5py.h5t.py_create(kind), space, properties)
    file[where].attrs.update(notes)


def _bomb(file: h5py.File, where: str, kind: Any, shape: Any, chunk: Any) -> None:
    """Write a chunk that is small when packed."""
    rows = max(1, chunk[0] // max(1, int(np.prod(shape[1:]))))
    chunk = (rows, *shape[1:])
    _replaced(file, where, shape=shape, dtype=kind, chunks=chunk, maxshape=(None, *shape[1:]),
              compression="gzip")  # fmt: skip
    packed = _zeros(int(np.prod(chunk)) * kind.itemsize)
    file[where].id.write_direct_chunk((0,) * len(shape), packed)


def _zeros(count: int) -> bytes:
    """Return many zeros, packed by zlib, at no more cost than packing a few."""
    packer, size = zlib.compressobj(9, zlib.DEFLATED, -15), 2**20
    block = packer.compress(bytes(size)) + packer.flush(zlib.Z_FULL_FLUSH)
    rest = zlib.compressobj(9, zlib.DEFLATED, -15)
    last = rest.compress(bytes(count % size)) + rest.flush()
    return b"\x78\xda" + block * (count // size) + last + struct.pack(">HH", count % 65521, 1)


def objects(path: Path) -> dict[str, list[str]]:
    """Return the names of the attributes of each object, the root among them; data sets first."""
    found: dict[str, list[str]] = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: found.update({name: sorted(item.attrs)}))
        sets = sorted(found, key=lambda name: not isinstance(file[name], h5py.Dataset))
        return {**{name: found[name] for name in sets}, "/": sorted(file.attrs)}


def data_sets(path: Path) -> list[str]:
    """Return the names of the data sets."""
    found: list[str] = []
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None
        )
    return found


def draw(rng: Rng, path: Path) -> list[Any]:
    """Draw a change of an honest file: its name and its arguments."""
    sets = data_sets(path)
    chosen = str(rng.choice(sets))
    kind = str(rng.choice(list(CHANCES), p=list(CHANCES.values())))
    arguments: dict[str, Callable[[], list[Any]]] = {
        "attribute": lambda: _draw_attribute(rng, objects(path)),
        "pixels": lambda: [chosen, [float(rng.random()) for _ in range(rng.integers(1, 4))],
                           float(rng.choice([0.0, 0.3, 1.0])), str(rng.choice(PIXELS))],
        "retype": lambda: [chosen, str(rng.choice(DTYPES))],
        "reshape": lambda: [chosen, str(rng.choice(SHAPES))],
        "swap": lambda: [chosen, float(rng.random()), float(rng.random())],
        "remove": lambda: [chosen],
        "add": lambda: [str(rng.choice(ADDED))],
        "link": lambda: [chosen, str(rng.choice(LINKS)), str(rng.choice(sets))],
        "store": lambda: [chosen, str(rng.choice(STORAGES))],
    }  # fmt: skip
    return [kind, *arguments[kind]()]


def _draw_attribute(rng: Rng, found: dict[str, list[str]]) -> list[Any]:
    where = "/" if rng.random() < 0.7 else str(rng.choice(list(found)))
    names = found[where] or ["unit"]
    value = "gone" if rng.random() < 0.1 else str(rng.choice(list(ATTRIBUTES)))
    return [where, str(rng.choice(names)), value]


EDITS = {
    f.__name__: f for f in (attribute, pixels, retype, reshape, swap, remove, add, link, store)
}

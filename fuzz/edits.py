"""The table of edits: what each does, to which files, how often, how its arguments are drawn."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fuzz import file_edits, hdf5_edits
from fuzz.programs import SUBMISSIONS
from fuzz.values import ATTRIBUTES, JSON, NAMES

Rng = np.random.Generator


@dataclass(frozen=True)
class Suspect:
    """A file that is to be changed.

    Attributes:
        path: where the honest one lies.
        others: paths of other honest files, from its folder.
    """

    path: Path
    others: Sequence[str]

    def names(self) -> list[str]:
        """Return the names of data sets, such as "depth", and of attributes, such as "/@spec"."""
        names: list[str] = []
        with h5py.File(self.path) as file:

            def add(name: str, item: Any) -> None:
                names.extend([name] if isinstance(item, h5py.Dataset) else [])
                names.extend(f"{name}@{key}" for key in item.attrs)

            file.visititems(add)
            names += [f"/@{key}" for key in file.attrs]
        return sorted(names)

    def texts_of_json(self) -> list[str]:
        """Return those of the names whose values are JSON."""
        with h5py.File(self.path) as file:

            def is_json(name: str) -> bool:
                where, _, key = name.rpartition("@")
                if where:
                    value = file[where].attrs[key]
                    return isinstance(value, str) and value.startswith("{")
                return h5py.check_string_dtype(file[name].dtype) is not None

            return [name for name in self.names() if is_json(name)]


Drawer = Callable[[Rng, Suspect], Any]


def one_of(options: Sequence[Any]) -> Drawer:
    """Return a function that draws one of some options."""
    return lambda rng, suspect: options[int(rng.integers(len(options)))]


def any_place(rng: Rng, _: Suspect) -> float:
    """Draw a place as a fraction of the file; headers are met more often than pixels."""
    return float(rng.random() ** rng.choice([1, 4, 12]))


def fraction(rng: Rng, _: Suspect) -> float:
    """Draw a number from 0 to 1."""
    return float(rng.random())


def data_set(rng: Rng, suspect: Suspect) -> str:
    """Draw the name of a data set."""
    return one_of([name for name in suspect.names() if "@" not in name])(rng, suspect)


def attribute(rng: Rng, suspect: Suspect) -> str:
    """Draw an attribute, most often one of the root."""
    names = [name for name in suspect.names() if "@" in name]
    of_root = [name for name in names if name.startswith("/@")]
    return one_of((of_root if rng.random() < 0.7 else names) or ["/@unit"])(rng, suspect)


def part_with_json(rng: Rng, suspect: Suspect) -> str:
    """Draw where an HDF5 file has JSON."""
    names = suspect.texts_of_json() if suspect.path.suffix == ".h5" else [""]
    return one_of(names or ["/@spec"])(rng, suspect)


def another(rng: Rng, suspect: Suspect) -> str:
    """Draw the path of another file."""
    return one_of(suspect.others)(rng, suspect)


@dataclass(frozen=True)
class Edit:
    """What can be done to a file.

    Attributes:
        change: (path, *arguments) -> nothing.
        weight: how often it is drawn.
        kinds: of the files that it suits: their suffixes, and SUBMISSION.
        arguments: how each argument is drawn.
    """

    change: Callable[..., None]
    weight: float
    kinds: tuple[str, ...]
    arguments: tuple[Drawer, ...]


SUBMISSION = "submission"  # an HDF5 file of a stranger, which commands try in another process
HDF5, TREES = (".h5", SUBMISSION), (".json", ".h5", ".safetensors", SUBMISSION)
PLAIN_TEXT = (".obj", ".off", ".ply", ".stl")
# HDF5 may hang or crash on other bytes, so that of its files only those of strangers are changed.
BYTES = (*PLAIN_TEXT, ".glb", ".npz", ".json", ".safetensors", ".db", SUBMISSION)
BITS, TIMES = one_of([1, 8, 128, 255]), one_of([0, 0, 2, 10, 100_000])
EDITS = {
    edit.change.__name__: edit
    for edit in (
        Edit(hdf5_edits.attribute, 20, HDF5,
             (attribute, one_of(["gone", *NAMES, *ATTRIBUTES]))),
        Edit(hdf5_edits.pixels, 12, HDF5,
             (data_set, fraction, one_of([0.0, 0.3, 1.0]), one_of(hdf5_edits.PIXELS))),
        Edit(hdf5_edits.array, 15, HDF5, (data_set, one_of(list(hdf5_edits.ARRAYS)))),
        Edit(hdf5_edits.remove, 3, HDF5, (data_set,)),
        Edit(hdf5_edits.add, 3, HDF5, (one_of(list(hdf5_edits.ADDED)),)),
        Edit(hdf5_edits.link, 6, HDF5, (data_set, one_of(list(hdf5_edits.LINKS)), data_set)),
        Edit(hdf5_edits.store, 10, HDF5, (data_set, one_of(list(hdf5_edits.STORES)))),
        Edit(file_edits.json_value, 20, TREES,
             (part_with_json, one_of(file_edits.ACTS), fraction, one_of([*NAMES, *JSON]))),
        Edit(file_edits.json_frame, 8, (".json",), (one_of(list(file_edits.FRAMES)),)),
        Edit(file_edits.numeral, 20, PLAIN_TEXT, (fraction, one_of(file_edits.NUMERALS))),
        Edit(file_edits.flip, 8, BYTES, (any_place, BITS)),
        Edit(file_edits.overwrite, 8, BYTES,
             (any_place, one_of([1, 4, 8]), one_of(file_edits.SPECIAL))),
        Edit(file_edits.repeat, 8, BYTES, (any_place, any_place, TIMES)),
        Edit(file_edits.splice, 5, BYTES, (another, one_of([0.0, 0.1, 0.5, 0.9]))),
        Edit(file_edits.become, 3, (*BYTES, ".h5"), (one_of(list(file_edits.KINDS)),)),
        Edit(file_edits.broken, 2, (SUBMISSION,), (one_of(["hangs.h5", "crashes.h5"]),)),
    )
}  # fmt: skip


def is_last(name: str) -> bool:
    """Return whether an edit comes after those that need a file that can be read."""
    return EDITS[name].change in vars(file_edits).values() and name != "json_value"


def draw(rng: Rng, honest: Path, path: str, inputs: Sequence[str]) -> list[Any]:
    """Draw a change that suits a file: the name of the edit, and its arguments."""
    others = [os.path.relpath(name, Path(path).parent) for name in inputs if name != path]
    suspect = Suspect(honest / path, others or [Path(path).name])
    kind = SUBMISSION if path in SUBMISSIONS else Path(path).suffix
    suited = [name for name, edit in EDITS.items() if kind in edit.kinds]
    weights = np.array([EDITS[name].weight for name in suited])
    name = str(rng.choice(suited, p=weights / weights.sum()))
    return [name, *(argument(rng, suspect) for argument in EDITS[name].arguments)]

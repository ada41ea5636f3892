"""Sets of both tasks, made and read in one way, for tests of the layer under them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from iqtt.files.make import make_split, merge_questions
from iqtt.files.reader import open_tables
from iqtt.files.split import ALL_FILES
from iqtt.files.verify import verify_split
from iqtt.questions.specs import SplitSpec
from scenegen.description.specs import DatasetSpec
from scenegen.files.sets.making import complete_parts, parts_folder
from scenegen.files.verify import Check
from scenegen.rooms.make import make_dataset, merge_rooms
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.verify import verify_file

SEED = 8_123_456_789_012_345


@dataclass(frozen=True)
class SetTask:
    """How a task makes a set of shards, or whole files, in a folder.

    Attributes:
        spec: the request.
        files: those that readers open.
        rows: number of rows in all files of images.
        size: items of a shard, so that there are at least three.
        run: makes a set, given a folder, a spec and options.
        merge: merges one of the files to another one.
        verify: checks all files of a folder.
    """

    spec: Any
    files: tuple[str, ...]
    rows: int
    size: int
    run: Callable[..., Any]
    merge: Callable[..., Any]
    verify: Callable[[Path], list[Check]]

    def make(self, folder: Path, **options: Any) -> None:
        """Make a set; settings of its spec may be among the options."""
        names = [name for name in options if hasattr(self.spec, name)]
        spec = replace(self.spec, **{name: options.pop(name) for name in names})
        self.run(folder, spec, **{"command": f"tests --seed {SEED}", "batch": 2, **options})

    def shards(self, folder: Path, **options: Any) -> None:
        """Make a set of shards."""
        self.make(folder, **{"shard_size": self.size, **options})

    def parts(self, folder: Path) -> dict[str, Path]:
        """Return the parts of a set that is not complete, by their names."""
        return complete_parts(parts_folder(folder / self.files[0]))


def rooms(**settings: Any) -> SetTask:
    """Return how rooms are made, 11 scenes of them."""
    spec = DatasetSpec(height=32, width=32, min_visible_pixels=3, seed=SEED, **settings)

    def run(folder: Path, spec: DatasetSpec, count: int = 11, **options: Any) -> None:
        folder.mkdir(exist_ok=True)
        make_dataset(folder / "rooms.h5", spec, count, **options)

    def verify(folder: Path) -> list[Check]:
        with RoomsFile(folder / "rooms.h5") as file:
            return verify_file(file, 2)

    def merge(path: Path, out: Path) -> None:
        with RoomsFile(path) as file:
            merge_rooms(file, out)

    rows = 11 * len(spec.views)
    return SetTask(spec, ("rooms.h5",), rows, 4, run, merge, verify)


def questions(**settings: Any) -> SetTask:
    """Return how questions are made, 26 of them."""
    spec = SplitSpec(
        seed=SEED, train=13, labeled=5, val=4, test=9, cubes=(6, 7), height=24, width=32,
        min_cube_pixels=1, lights=(1, 2), with_depth=True,
    )  # fmt: skip
    spec = replace(spec, **settings)

    def merge(path: Path, out: Path) -> None:
        tables = open_tables(path)
        with tables[0]:
            merge_questions(tables, out)

    rows = spec.train + spec.val + spec.test
    return SetTask(spec, ALL_FILES, rows, 4, make_split, merge, verify_split)


def contents(folder: Path) -> dict[str, bytes]:
    """Return the bytes of each HDF5 file of a folder."""
    return {path.name: path.read_bytes() for path in folder.glob("*.h5")}


def everything(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the values of all data sets that plain h5py reads, and the attributes of the root."""
    values: dict[str, Any] = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: values.update({name: item[()]}) if hasattr(item, "dtype") else None
        )
        return values, {k: v for k, v in file.attrs.items() if k != "content_digest"}


def same_values(found: dict[str, Any], expected: dict[str, Any]) -> None:
    """Assert that data sets are equal, but for the list of shards."""
    assert found.keys() - {"shards"} == expected.keys() - {"shards"}
    for name in expected.keys() - {"shards"}:
        np.testing.assert_array_equal(found[name], expected[name], err_msg=name)

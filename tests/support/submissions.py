"""Predictions as tests hand them in: good ones, and good ones spoiled in one way or another.

Everything here that takes a folder and the path of a truth is a `Build`: it writes one file into
the folder, and returns its path. What broken submissions there are is in `broken`.
"""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
from h5_edits import attribute, in_all, linked, replaced

from metrics.prediction_writer import RoomPredictionWriter, write_answers
from scenegen.rooms.reader import RoomsFile

Build = Callable[[Path, Path], Path]


@dataclass(frozen=True)
class Truths:
    """The files that the corpus predicts: 8 rooms of 32 x 32, and 6 questions without answers."""

    rooms: Path
    iqtt: Path

    def of(self, task: str) -> Path:
        return self.iqtt if task == "iqtt" else self.rooms


def make_truths(folder: Path) -> Truths:
    """Render the truths of the corpus."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec
    from scenegen.description.specs import DatasetSpec
    from scenegen.rooms.make import make_dataset

    spec = DatasetSpec(height=32, width=32, min_visible_pixels=3, seed=3)
    make_dataset(folder / "rooms.h5", spec, 8, command="tests")
    split = SplitSpec(
        seed=5, train=6, labeled=3, val=6, test=6, cubes=(8, 9), height=32, width=32,
        min_cube_pixels=2, with_depth=True,
    )  # fmt: skip
    make_split(folder / "iqtt", split, command="tests")
    return Truths(folder / "rooms.h5", folder / "iqtt" / "iqtt-test.h5")


def good_rooms(
    folder: Path, truth: Path, name: str = "predictions.h5", normals: bool = True, **settings
) -> Path:
    """The truth as a submission."""
    settings = {"method": "truth", "run": "seed 0", **settings}
    with RoomsFile(truth) as rooms, RoomPredictionWriter(folder / name, truth, **settings) as out:
        for row in range(len(rooms)):
            normal = rooms.read("normal", row) if normals else None
            out.add(row, rooms.read("depth", row), normal)
    return folder / name


def good_answers(folder: Path, truth: Path, name: str = "answers.h5") -> Path:
    """Answers and scores to the 6 questions."""
    scores = np.eye(3)[[0, 1, 2, 2, 1, 0]]
    write_answers(folder / name, truth, method="guess", answer=scores.argmax(axis=1), scores=scores)
    return folder / name


@cache
def _good_content(good: Build, truth: Path, _changed_ns: int) -> tuple[str, bytes]:
    """Return name and bytes of a good file, which takes ten times longer to write than to copy."""
    with TemporaryDirectory() as folder:
        path = good(Path(folder), truth)
        return path.name, path.read_bytes()


def edited(edit: Callable[[h5py.File], object], good: Build = good_rooms) -> Build:
    """A good file, with `edit` let at it."""

    def build(folder: Path, truth: Path) -> Path:
        name, content = _good_content(good, truth, truth.stat().st_mtime_ns)
        path = folder / name
        path.write_bytes(content)
        with h5py.File(path, "r+") as file:
            edit(file)
        return path

    return build


def answers_edited(edit: Callable[[h5py.File], object]) -> Build:
    return edited(edit, good_answers)


def raw(content: bytes, name: str = "predictions.h5") -> Build:
    def build(folder, truth):
        (folder / name).write_bytes(content)
        return folder / name

    return build


def as_json(content: object, name: str = "answers.json") -> Build:
    text = content if isinstance(content, str) else json.dumps(content)
    return raw(text.encode("utf-8", "surrogatepass"), name)


def truncated(part: float, good: Build = good_rooms) -> Build:
    def build(folder, truth):
        path = good(folder, truth)
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * part)])
        return path

    return build


def missing(folder, truth):
    return folder / "none.h5"


def folder_itself(folder, truth):
    (folder / "predictions.h5").mkdir()
    return folder / "predictions.h5"


def fifo(folder, truth):
    os.mkfifo(folder / "predictions.h5")
    return folder / "predictions.h5"


def truth_itself(folder, truth):
    return truth


def huge_json(folder, truth):
    """40 MB of nothing after a bracket, as a sparse file."""
    with (folder / "answers.json").open("wb") as file:
        file.write(b"[")
        file.truncate(40_000_000)
    return folder / "answers.json"


def linked_to_fifo(folder, truth):
    """Whoever opened what the link names would wait for ever."""
    os.mkfifo(folder / "pipe.h5")
    return edited(linked("depth", h5py.ExternalLink("pipe.h5", "/depth")))(folder, truth)


def elsewhere(folder, truth):
    """Depth that lies in a raw file beside."""
    path = good_rooms(folder, truth)
    with h5py.File(path, "r+") as file:
        data = file["depth"][()]
        (folder / "raw.bin").write_bytes(data.tobytes())
        del file["depth"]
        external = [(str(folder / "raw.bin"), 0, data.nbytes)]
        file.create_dataset("depth", data.shape, "f4", external=external)
    return path


def virtual(file):
    layout = h5py.VirtualLayout(file["depth"].shape, "f4")
    layout[...] = h5py.VirtualSource("other.h5", "depth", file["depth"].shape)
    del file["depth"]
    file.create_virtual_dataset("depth", layout)


def unknown_filter(file):
    """Packed by a filter that nobody has."""
    shape = file["depth"].shape
    del file["depth"]
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((1, *shape[1:]))
    plan.set_filter(300, h5py.h5z.FLAG_OPTIONAL, (1,))
    space = h5py.h5s.create_simple(shape)
    made = h5py.h5d.create(file.id, b"depth", h5py.h5t.IEEE_F32LE, space, plan)
    for row in range(shape[0]):
        made.write_direct_chunk((row, 0, 0), bytes(100))


def referenced(file):
    made = file.create_dataset("held", data=np.arange(3))
    del file["depth"]
    file["depth"] = np.full((8, 32, 32), made.ref, dtype=h5py.ref_dtype)


def compound(file):
    kind = np.dtype([("z", "f4"), ("sigma", "f4")])
    del file["depth"]
    file["depth"] = np.zeros((8, 32, 32), kind)


# Predictions for other rooms of the same number and size.
other_truth = edited(attribute("truth_fingerprint", "0123456789ab" + "0" * 52))


def truth_is_no_rooms_file(folder, truth):
    with h5py.File(folder / "other.h5", "w") as file:
        file["x"] = 1
    return edited(attribute("truth_path", "other.h5"))(folder, truth)


def each(names, change):
    """The same change of several datasets."""
    return in_all(*(replaced(name, change) for name in names))


smaller = each(("depth", "normal"), lambda v: v[:, ::2, ::2])


def rows_kept(count):
    return each(("row", "depth", "normal"), lambda v: v[:count])


def answers_kept(count):
    return each(("question", "answer", "scores"), lambda v: v[:count])


def shuffled(file):
    order = np.random.default_rng(1).permutation(8)
    each(("depth", "normal"), lambda v: v[order])(file)


def halved_precision(depth):
    """Millimetres of far walls, stored as float16."""
    with np.errstate(over="ignore"):
        return (100_000 * depth).astype("f2")

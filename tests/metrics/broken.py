"""A corpus of broken submissions, made in code from good ones.

Each `Case` builds one file. `stage` says what finds the fault:

- "open": opening, without any truth;
- "match": holding it against the truth;
- "values": reading its pixels;
- "hint": nothing, as the file is valid; `validate` gives a hint. Not to be refused by scoring.

`task` says which truth it is made for, `names_truth` whether that is recorded inside (JSON cannot).
All but hints must end with exit code 2 and one line that has all `words`.
"""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from metrics.prediction_writer import RoomPredictionWriter, write_answers
from scenegen.camera import pixel_directions
from scenegen.scene_file import RoomsFile

Build = Callable[[Path, Path], Path]


@dataclass(frozen=True)
class Truths:
    """The files that the corpus predicts: 8 rooms of 32 x 32, and 6 questions without answers."""

    rooms: Path
    iqtt: Path

    def of(self, case: "Case") -> Path:
        return self.iqtt if case.task == "iqtt" else self.rooms


@dataclass(frozen=True)
class Case:
    name: str
    stage: str
    words: tuple[str, ...]
    build: Build
    task: str = "rooms"
    names_truth: bool = True

    def __str__(self) -> str:
        return self.name


def make_truths(folder: Path) -> Truths:
    """Render the truths of the corpus."""
    from iqtt.specs import SplitSpec
    from iqtt.split import make_split
    from scenegen.dataset import make_dataset
    from scenegen.specs import DatasetSpec

    spec = DatasetSpec(height=32, width=32, min_visible_pixels=3, seed=3)
    make_dataset(folder / "rooms.h5", spec, 8, command="tests")
    split = SplitSpec(
        seed=5, train=6, labeled=3, val=6, test=6, cubes=(5, 7), height=32, width=32,
        min_cube_pixels=2,
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


# ---- builders ----


def edited(edit: Callable[[h5py.File], object], good: Build = good_rooms) -> Build:
    """A good file, with `edit` let at it."""

    def build(folder: Path, truth: Path) -> Path:
        path = good(folder, truth)
        with h5py.File(path, "r+") as file:
            edit(file)
        return path

    return build


def answers_edited(edit: Callable[[h5py.File], object]) -> Build:
    return edited(edit, good_answers)


def attribute(name, value):
    return lambda file: file.attrs.update({name: value})


def gone(*names):
    def edit(file):
        for name in names:
            if name in file:
                del file[name]
            else:
                del file.attrs[name]

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


def with_truth(change) -> Build:
    """A good file, changed by a function of the file and the opened truth."""

    def build(folder, truth):
        path = good_rooms(folder, truth)
        with h5py.File(path, "r+") as file, RoomsFile(truth) as rooms:
            change(file, rooms)
        return path

    return build


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


def linked_to_fifo(folder, truth):
    """Whoever opened what the link names would wait for ever."""
    path = good_rooms(folder, truth)
    os.mkfifo(folder / "pipe.h5")
    with h5py.File(path, "r+") as file:
        linked("depth", h5py.ExternalLink("pipe.h5", "/depth"))(file)
    return path


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


def damaged_chunk(name):
    def edit(file):
        at = (3, *(0,) * (file[name].ndim - 1))
        _, data = file[name].id.read_direct_chunk(at)
        file[name].id.write_direct_chunk(at, data[:20] + b"\x55" * (len(data) - 20))

    return edit


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


def other_truth(folder, truth):
    """Predictions for other rooms of the same number and size."""
    path = good_rooms(folder, truth)
    with h5py.File(path, "r+") as file:
        file.attrs["truth_fingerprint"] = "0123456789ab" + "0" * 52
    return path


def truth_is_no_rooms_file(folder, truth):
    path = good_rooms(folder, truth)
    with h5py.File(folder / "other.h5", "w") as file:
        file["x"] = 1
    with h5py.File(path, "r+") as file:
        file.attrs["truth_path"] = "other.h5"
    return path


def smaller(file):
    for name in ("depth", "normal"):
        replaced(name, lambda v: v[:, ::2, ::2])(file)


def rows_kept(count):
    def edit(file):
        for name in ("row", "depth", "normal"):
            replaced(name, lambda v: v[:count])(file)

    return edit


def answers_kept(count):
    def edit(file):
        for name in ("question", "answer", "scores"):
            replaced(name, lambda v: v[:count])(file)

    return edit


# ---- mistakes that leave a file valid: each takes the file and the opened truth ----


def stretch(rooms):
    fov = rooms.read("camera/fov_y_degrees", 0)
    return np.linalg.norm(pixel_directions(32, 32, fov), axis=-1)


def ray_distance(file, rooms):
    file["depth"][...] = file["depth"][()] * stretch(rooms)


def world_normals(file, rooms):
    rotation = rooms.read("camera/world_from_camera", slice(None))[:, :3, :3]
    file["normal"][...] = np.einsum("nij,nhwj->nhwi", rotation, file["normal"][()])


def changed(name, change):
    """A mistake that needs no truth."""
    return with_truth(lambda file, rooms: values(name, change)(file))


def normalised(depth):
    low, high = depth.min((1, 2), keepdims=True), depth.max((1, 2), keepdims=True)
    return (depth - low) / (high - low)


def shuffled(file):
    order = np.random.default_rng(1).permutation(8)
    for name in ("depth", "normal"):
        values(name, lambda v: v[order])(file)


def halved_precision(depth):
    """Millimetres of far walls, stored as float16."""
    with np.errstate(over="ignore"):
        return (100_000 * depth).astype("f2")


OPEN = [
    ("missing", ["no such file"], missing),
    ("folder", ["is a folder"], folder_itself),
    ("fifo", ["not a regular file"], fifo),
    ("empty file", ["not a readable HDF5 file"], raw(b"")),
    ("text file", ["not a readable HDF5 file"], raw(b"depth,1,2,3\n" * 99)),
    ("numpy file", ["not a readable HDF5 file"], raw(b"\x93NUMPY\x01\x00" + bytes(500))),
    ("signature only", ["not a readable HDF5 file"], raw(b"\x89HDF\r\n\x1a\n" + bytes(500))),
    ("truncated early", ["not a readable HDF5 file"], truncated(0.05)),
    ("truncated late", ["not a readable HDF5 file"], truncated(0.95)),
    ("the truth itself", ["a file of rooms, not a submission"], truth_itself),
    ("no attributes", ["format", "no such root attribute"], edited(
        lambda file: [file.attrs.pop(name) for name in list(file.attrs)])),
    ("other format", ["'mine'", "'pix2shape-bench/predictions'"], edited(
        attribute("format", "mine"))),
    ("format is a number", ["format", "expected a text"], edited(attribute("format", 7))),
    ("newer version", ["version '2.0'", "expected 1.x"], edited(
        attribute("format_version", "2.0"))),
    ("no version", ["format_version", "expected 1.x"], edited(gone("format_version"))),
    ("version is a number", ["format_version", "float64"], edited(
        attribute("format_version", 1.0))),
    ("no task", ["task", "no such root attribute"], edited(gone("task"))),
    ("other task", ["task", "'chairs'", "'rooms' or 'iqtt'"], edited(attribute("task", "chairs"))),
    ("task of the other kind", ["question", "no such dataset", "'depth'"], edited(
        attribute("task", "iqtt"))),
    ("no method", ["method", "no such root attribute"], edited(gone("method"))),
    ("empty method", ["method", "empty"], edited(attribute("method", ""))),
    ("blank method", ["method", "empty"], edited(attribute("method", " \u00a0"))),
    ("method with a newline", ["method", r"'\n'"], edited(attribute("method", "a\nb"))),
    ("method that moves the cursor", ["method", r"'\x1b'"], edited(
        attribute("method", "\x1b[2Jmine"))),
    ("method written backwards", ["method", r"'\u202e'"], edited(attribute("method", "a\u202eb"))),
    ("method that is not UTF-8", ["method", "not UTF-8"], edited(
        lambda file: file.attrs.create("method", np.bytes_(b"\xff\xfe")))),
    ("method of great length", ["method", "30000 characters"], edited(
        lambda file: file.attrs.update({"method": "m" * 30_000}))),
    ("method is a list", ["method", "expected a text"], edited(
        attribute("method", ["one", "two"]))),
    ("run is a number", ["run", "expected a text"], edited(attribute("run", 3))),
    ("unknown alignment", ["alignment", "'affine'", "'scale_shift'"], edited(
        attribute("alignment", "affine"))),
    ("no fingerprint", ["truth_fingerprint", "no such root attribute"], edited(
        gone("truth_fingerprint"))),
    ("empty fingerprint", ["truth_fingerprint", "empty"], edited(
        attribute("truth_fingerprint", ""))),
    ("no rows", ["row", "no such dataset"], edited(gone("row"))),
    ("no depth", ["depth", "no such dataset", "'normal'"], edited(gone("depth"))),
    ("depth under another name", ["depth", "no such dataset", "'depths'"], edited(
        lambda file: file.move("depth", "depths"))),
    ("depth is a group", ["depth: a group"], edited(grouped("depth"))),
    ("row is a group", ["row: a group"], edited(grouped("row"))),
    ("depth is a named type", ["depth: a datatype"], edited(
        linked("depth", np.dtype("f4")))),
    ("depth is one number", ["depth", "shape ()"], edited(replaced("depth", lambda v: 1.5))),
    ("depth is nothing", ["depth", "shape None"], edited(
        replaced("depth", lambda v: h5py.Empty("f4")))),
    ("depth has a channel", ["depth", "shape (8, 32, 32, 1)"], edited(
        replaced("depth", lambda v: v[..., None]))),
    ("depth is flat", ["depth", "shape (8, 1024)"], edited(
        replaced("depth", lambda v: v.reshape(8, -1)))),
    ("depth without pixels", ["depth", "shape (8, 0, 32)"], edited(
        replaced("depth", lambda v: v[:, :0]))),
    ("depth in whole numbers", ["depth", "uint16", "expected floats"], edited(
        replaced("depth", lambda v: (1000 * v).astype("u2")))),
    ("depth as text", ["depth", "type text"], edited(
        replaced("depth", lambda v: [["far"] * 32] * 8))),
    ("depth is true or false", ["depth", "type bool"], edited(
        replaced("depth", lambda v: v > 1))),
    ("depth is complex", ["depth", "complex64"], edited(
        replaced("depth", lambda v: v.astype("c8")))),
    ("depth is compound", ["depth", "type compound"], edited(compound)),
    ("depth is references", ["depth", "type reference"], edited(referenced)),
    ("fewer depths than rows", ["depth: 5 rows", "expected 8"], edited(
        replaced("depth", lambda v: v[:5]))),
    ("more normals than rows", ["normal: 16 rows", "expected 8"], edited(
        replaced("normal", lambda v: np.tile(v, (2, 1, 1, 1))))),
    ("normals of two components", ["normal", "shape (8, 32, 32, 2)"], edited(
        replaced("normal", lambda v: v[..., :2]))),
    ("normals channels first", ["normal", "shape (8, 3, 32, 32)"], edited(
        replaced("normal", lambda v: np.moveaxis(v, -1, 1)))),
    ("normals as a picture", ["normal", "uint8", "expected floats"], edited(
        replaced("normal", lambda v: np.uint8(127.5 * (v + 1))))),
    ("rows are floats", ["row", "float64", "expected integers"], edited(
        replaced("row", lambda v: v.astype("f8")))),
    ("rows are true or false", ["row", "type bool"], edited(replaced("row", lambda v: v > 3))),
    ("rows are texts", ["row", "type text"], edited(
        replaced("row", lambda v: [str(i) for i in v]))),
    ("rows in two columns", ["row", "shape (8, 1)"], edited(
        replaced("row", lambda v: v[:, None]))),
    ("no row at all", ["row: no rows"], edited(rows_kept(0))),
    ("a row twice", ["row", "more than once", "ids 2)"], edited(put("row", 5, 2))),
    ("all rows the same", ["row", "more than once", "ids 0)"], edited(
        values("row", lambda v: 0 * v))),
    ("a negative row", ["row", "negative", "ids -1)"], edited(put("row", 5, -1))),
    ("a row beyond all numbers", ["row", "18446744073709551615"], edited(
        replaced("row", lambda v: np.full(8, 2**64 - 1, "u8")))),
    ("10^9 rows of nothing", ["1000000000 rows", "10,000,000"], edited(in_all(
        claims("row", (10**9,), "i8", chunks=(1024,)),
        claims("depth", (10**9, 32, 32), chunks=(1, 32, 32))))),
    ("rows that were never written", ["row", "nothing was written"], edited(
        claims("row", (8,), "i8", chunks=(8,)))),
    ("depth that was never written", ["depth", "nothing was written"], edited(
        claims("depth", (8, 32, 32), chunks=(1, 32, 32)))),
    ("images of 10^10 pixels", ["depth", "100000x100000"], edited(
        claims("depth", (8, 10**5, 10**5), chunks=(1, 1000, 1000)))),
    ("chunks of a gigabyte", ["depth", "MiB to unpack"], edited(
        claims("depth", (8, 32, 32), chunks=(250_000, 32, 32), maxshape=(None, 32, 32)))),
    ("an external link", ["depth: a link to the file 'other.h5'"], edited(
        linked("depth", h5py.ExternalLink("other.h5", "/depth")))),
    ("an external link to a fifo", ["depth: a link to the file", "pipe.h5"], linked_to_fifo),
    ("a soft link to nowhere", ["depth: a link"], edited(
        linked("depth", h5py.SoftLink("/nowhere")))),
    ("a soft link to itself", ["depth: a link"], edited(linked("depth", h5py.SoftLink("/depth")))),
    ("values in a raw file", ["depth", "in another file"], elsewhere),
    ("a virtual dataset", ["depth", "in another file"], edited(virtual)),
]  # fmt: skip

MATCH = [
    ("other rooms", ["truth_fingerprint", "0123456789ab"], other_truth),
    ("truth not there", ["truth not found", "gone/rooms.h5", "--truth"], edited(
        attribute("truth_path", "gone/rooms.h5"))),
    ("truth not named", ["names no truth", "--truth"], edited(attribute("truth_path", ""))),
    ("truth is something else", ["other.h5", "not a rooms file"], truth_is_no_rooms_file),
    ("images too small", ["depth", "16x16", "expected 32x32"], edited(smaller)),
    ("rows missing", ["row: 3 of 8 missing", "ids 5, 6, 7)"], edited(rows_kept(5))),
    ("a row unknown", ["row: 1 that the truth does not have", "ids 8)"], edited(put("row", 3, 8))),
    ("counted from 1", ["row", "does not have", "ids 8)"], edited(
        values("row", lambda v: v + 1))),
]  # fmt: skip

VALUES = [
    ("NaN", ["depth", "finite", "3"], edited(put("depth", (3, 5, 7), np.nan))),
    ("all NaN", ["depth", "finite"], edited(values("depth", lambda v: v * np.nan))),
    ("infinity", ["depth", "finite", "7"], edited(put("depth", (7, 0, 0), np.inf))),
    ("minus infinity", ["depth", "finite", "0"], edited(put("depth", (0, 31, 31), -np.inf))),
    ("a signalling NaN", ["depth", "finite", "4"], edited(put(
        "depth", (4, 2, 2), np.array(0x7FA00001, "u4").view("f4")))),
    ("absurd magnitude", ["depth", "finite"], edited(
        replaced("depth", lambda v: v.astype("f8") * 1e200))),
    ("overflow of half precision", ["depth", "finite"], edited(
        replaced("depth", halved_precision))),
    ("NaN in a normal", ["normal", "finite", "2"], edited(put("normal", (2, 5, 7, 1), np.nan))),
    ("normals of length 0", ["normal", "length 0"], edited(put("normal", (6, 5), 0.0))),
    ("a damaged chunk", ["depth", "row 3", "cannot be read"], edited(damaged_chunk("depth"))),
    ("a damaged chunk of normals", ["normal", "cannot be read"], edited(damaged_chunk("normal"))),
    ("an unknown filter", ["depth", "cannot be read"], edited(unknown_filter)),
]  # fmt: skip

HINTS = [
    ("ray distance", ["distance along the ray"], with_truth(ray_distance)),
    ("disparity", ["disparity (1/depth)"], changed("depth", lambda v: 1 / v)),
    ("z instead of depth", ["which is negative"], changed("depth", np.negative)),
    ("millimetres", ["1,000 times", "millimetres"], changed("depth", lambda v: 1000 * v)),
    ("a room of edge 2", ["2 times the truth"], changed("depth", lambda v: 2 * v)),
    ("depth from 0 to 1", ["normalised to 0..1"], changed("depth", normalised)),
    ("upside down", ["upside down"], changed("depth", lambda v: v[:, ::-1])),
    ("mirrored", ["mirrored"], changed("depth", lambda v: v[:, :, ::-1])),
    ("transposed", ["transposed"], changed("depth", lambda v: v.swapaxes(1, 2))),
    ("rows shuffled", ["rows look shuffled"], edited(shuffled)),
    ("flipped normals", ["facing away"], changed("normal", np.negative)),
    ("world normals", ["world frame"], with_truth(world_normals)),
    ("normals of OpenCV", ["OpenCV"], changed("normal", lambda v: v * [1, -1, -1])),
    ("normals with y down", ["y down"], changed("normal", lambda v: v * [1, -1, 1])),
    ("normals from 0 to 1", ["0..1 for -1..1"], changed("normal", lambda v: (v + 1) / 2)),
    ("normals from 0 to 255", ["0..255 for -1..1"], changed(
        "normal", lambda v: np.rint(127.5 * (v + 1)))),
]  # fmt: skip

ANSWERS_OPEN = [
    ("no questions", ["question", "no such dataset"], answers_edited(gone("question"))),
    ("neither answer nor scores", ["answer: neither"], answers_edited(gone("answer", "scores"))),
    ("answer and scores disagree", ["answer", "other than scores say", "ids 2)"], answers_edited(
        put("answer", 2, 0))),
    ("an answer of 3", ["answer", "1 outside -1 to 2, such as 3", "ids 4)"], answers_edited(
        in_all(gone("scores"), put("answer", 4, 3)))),
    ("an answer of -2", ["answer", "such as -2"], answers_edited(
        in_all(gone("scores"), put("answer", 4, -2)))),
    ("answers are floats", ["answer", "float32", "expected integers"], answers_edited(
        replaced("answer", lambda v: v.astype("f4")))),
    ("answers are letters", ["answer", "type text"], answers_edited(
        replaced("answer", lambda v: list("abccba")))),
    ("a score of NaN", ["scores", "NaN", "ids 1)"], answers_edited(
        put("scores", (1, 2), np.nan))),
    ("an infinite score", ["scores", "infinite", "ids 5)"], answers_edited(
        put("scores", (5, 0), np.inf))),
    ("scores for four", ["scores", "shape (6, 4)", "(M, 3)"], answers_edited(
        replaced("scores", lambda v: np.zeros((6, 4))))),
    ("scores are an external link", ["scores: a link"], answers_edited(
        linked("scores", h5py.ExternalLink("other.h5", "/scores")))),
    ("fewer answers than questions", ["answer: 4 rows", "expected 6"], answers_edited(
        replaced("answer", lambda v: v[:4]))),
    ("a question twice", ["question", "more than once"], answers_edited(put("question", 3, 0))),
]  # fmt: skip

ANSWERS_MATCH = [
    ("questions missing", ["question: 2 of 6 missing", "ids 4, 5)"], answers_edited(
        answers_kept(4))),
    ("a question unknown", ["question", "does not have", "ids 77)"], answers_edited(
        put("question", 3, 77))),
    ("other questions", ["truth_fingerprint"], answers_edited(
        attribute("truth_fingerprint", "f" * 64))),
]  # fmt: skip

JSON_OPEN = [
    ("JSON: malformed", ["no JSON"], as_json("[0, 1, 2")),
    ("JSON: empty", ["no JSON"], as_json("")),
    ("JSON: nested deeply", ["nested too deeply"], as_json("[" * 200_000)),
    ("JSON: nested", ["expected 0, 1, 2"], as_json([[0], [1], [2], [0], [1], [2]])),
    ("JSON: NaN", ["NaN"], as_json("[0, 1, NaN, 0, 1, 2]")),
    ("JSON: infinity", ["inf"], as_json("[0, 1, 1e999, 0, 1, 2]")),
    ("JSON: floats", ["1.0", "ids 1)"], as_json("[0, 1.0, 2, 0, 1, 2]")),
    ("JSON: booleans", ["True", "ids 0)"], as_json("[true, 1, 2, 0, 1, 2]")),
    ("JSON: null", ["None"], as_json("[null, 1, 2, 0, 1, 2]")),
    ("JSON: texts", ["'0'", "ids 0, 1"], as_json(["0", "1", "2", "0", "1", "2"])),
    ("JSON: out of range", ["outside -1 to 2, such as 3", "ids 5)"], as_json([0, 1, 2, 0, 1, 3])),
    ("JSON: a huge number", ["ids 0)"], as_json([10**30, 1, 2, 0, 1, 2])),
    ("JSON: a number of 5000 digits", ["no JSON"], as_json("[" + "1" * 5000 + "]")),
    ("JSON: no answers", ["no rows"], as_json([])),
    ("JSON: no answers in an object", ["no rows"], as_json({})),
    ("JSON: a number", ["int, neither a list nor an object"], as_json(7)),
    ("JSON: a key twice", ["the key '1' twice"], as_json('{"0": 1, "1": 2, "1": 0}')),
    ("JSON: a key that is no number", ["the key 'one'"], as_json({"one": 1})),
    ("JSON: a key with zeros", ["the key '01'"], as_json({"01": 1})),
    ("JSON: a negative key", ["the key '-1'"], as_json({"-1": 1})),
    ("JSON: a key beyond all", ["the key '99999999999'"], as_json({"99999999999": 1})),
    ("JSON: an unknown key", ["the key 'model'"], as_json({"answers": [0] * 6, "model": "x"})),
    ("JSON: answers are a text", ["str, neither"], as_json({"answers": "012012"})),
    ("JSON: method is a number", ["method 7"], as_json({"answers": [0] * 6, "method": 7})),
    ("JSON: method is empty", ["method", "empty"], as_json({"answers": [0] * 6, "method": ""})),
    ("JSON: method of half a character", ["method", r"\ud800"], as_json(
        '{"answers": [0, 0, 0, 0, 0, 0], "method": "\\ud800"}')),
    ("JSON: not UTF-8", ["no JSON"], raw(b'["\xff\xfe"]', "answers.json")),
    ("JSON: binary", ["no JSON"], raw(b"\x00\x01\x02" * 100, "answers.json")),
    ("JSON: 40 MB", ["40000000 bytes"], huge_json),
]  # fmt: skip

JSON_MATCH = [
    ("JSON: too few", ["question: 2 of 6 missing", "ids 4, 5)"], as_json([0, 1, 2, 0])),
    ("JSON: too many", ["1 that the truth does not have", "ids 6)"], as_json([0] * 7)),
    ("JSON: a question left out", ["1 of 6 missing", "ids 3)"], as_json(
        {"answers": {"0": 0, "1": 1, "2": 2, "4": -1, "5": 1}, "method": "m"})),
]  # fmt: skip


def _cases(table, stage, task="rooms", names_truth=True):
    return [
        Case(name, stage, tuple(words), build, task, names_truth) for name, words, build in table
    ]


CASES: list[Case] = [
    *_cases(OPEN, "open"),
    *_cases(MATCH, "match"),
    *_cases(VALUES, "values"),
    *_cases(HINTS, "hint"),
    *_cases(ANSWERS_OPEN, "open", "iqtt"),
    *_cases(ANSWERS_MATCH, "match", "iqtt"),
    *_cases(JSON_OPEN, "open", "iqtt", names_truth=False),
    *_cases(JSON_MATCH, "match", "iqtt", names_truth=False),
]

"""Any data set or attribute of a file may hold anything: one clear error, no traceback."""

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from verified import checks_of

from iqtt.audit.audit import audit
from iqtt.files.info import describe
from iqtt.files.make import make_split
from iqtt.files.preview import question_sheet
from iqtt.files.reader import AnswersFile, QuestionsFile, parts
from iqtt.files.verify import verify_split
from iqtt.questions.specs import SplitSpec
from scenegen.common.errors import SceneGenError
from scenegen.rooms import info
from scenegen.rooms.preview import contact_sheet
from scenegen.rooms.reader import RoomsFile

ROOMS = "rooms.h5"
FILES = (ROOMS, "iqtt-val.h5", "iqtt-train.h5", "iqtt-test-answers.h5", "iqtt-test.h5")
TEXTS = h5py.string_dtype()
# What stands in place of an attribute, and of the values of a dataset in its place.
ATTRIBUTES = {
    "numbers": np.arange(3),
    "a number": -1.5,
    "not a number": np.nan,
    "nothing": h5py.Empty("f4"),
    "no text": h5py.Empty(TEXTS),
    "bytes": np.bytes_(b"\xff\xfe\x00x"),
    "no unicode": np.array(b"a\xff", TEXTS),
    "an empty text": "",
    "a long text": "x" * 60_000,
    "deep JSON": "[" * 50_000,
    "control characters": "1.2\x1b[2J\n\r\u202e",
    "texts": ["1.2"] * 3,
    "many texts": np.array(["a"] * 3000, object),
    "a reference": h5py.Reference(),
    "a compound": np.zeros((), [("a", "i4"), ("b", "f8")]),
    "a truth value": np.True_,
}


def typed(kind):
    return lambda values: values.astype(kind)


DATASETS = {
    "a number": lambda values: np.int8(7),
    "nothing": lambda values: h5py.Empty("u1"),
    "no rows": lambda values: values[:0],
    "fewer rows": lambda values: values[:-1],
    "narrower rows": lambda values: values[..., :-1] if values.ndim > 1 else values[:, None],
    "wide integers": typed("i8"),
    "unsigned": typed("u8"),
    "big-endian": lambda values: values.astype(values.dtype.newbyteorder(">")),
    "complex": typed("c16"),
    "bytes": typed("S3"),
    "texts": lambda values: np.full(values.shape, "x", object),
    "a compound": lambda values: np.zeros(values.shape, [("a", "i4"), ("b", "f8")]),
    "references": lambda values: np.full(values.shape, h5py.Reference(), h5py.ref_dtype),
}
VALUES = {
    "zero": lambda values: values * 0,
    "the least": lambda values: _ends(values)[0],
    "the most": lambda values: _ends(values)[1],
    "not a number": lambda values: values * np.nan if values.dtype.kind == "f" else values,
    "infinite": lambda values: values + np.inf if values.dtype.kind == "f" else values,
    "backwards": lambda values: values[::-1],
}


def _ends(values):
    about = np.finfo if values.dtype.kind == "f" else np.iinfo
    ends = about(values.dtype)
    return np.full_like(values, ends.min), np.full_like(values, ends.max)


def places(path):
    """Every dataset, and every attribute that it or a group has."""
    with h5py.File(path) as file:
        found = [("", name) for name in file.attrs]

        def add(name, item):
            found.append((name, None))
            found.extend((name, key) for key in item.attrs)

        file.visititems(add)
    return found


@np.errstate(all="ignore")
def edit(file, where, key, how):
    """Put something else in the place; return whether that can be done."""
    item = file[where or "/"]
    if how == "gone" or (how == "a group" and key is None):
        del (file if key is None else item.attrs)[where if key is None else key]
        if how == "a group":
            file.create_group(where)
    elif key is not None and how in ATTRIBUTES:
        item.attrs[key] = ATTRIBUTES[how]
    elif key is None and isinstance(item, h5py.Dataset) and how in VALUES:
        item[...] = VALUES[how](item[()])
    elif key is None and isinstance(item, h5py.Dataset) and how in DATASETS:
        values, kept = item[()], dict(item.attrs)
        del file[where]
        file[where] = DATASETS[how](values)
        file[where].attrs.update(kept)
    else:
        return False
    return True


def everything(path):
    """Read a file in all the ways there are; errors must be of ours, on one line."""
    answers = path.parent / "iqtt-test-answers.h5" if path.name == "iqtt-test.h5" else None

    def rooms():
        with RoomsFile(path) as file:
            contact_sheet(list(file)[:2])
            [file.read(name, slice(None)) for name in file.fields]

    def questions():
        for part in parts(path):
            with QuestionsFile(path, part, answers) as file:
                rows = list(file)
                [file.read(name, slice(None)) for name in file.fields]
                question_sheet(rows[:2], True)

    def known():
        part = "labeled" if path.name == "iqtt-train.h5" else None
        with AnswersFile(path, part) as file:
            [file.truth(row) for row in range(len(file))]
            file.stored_digests()

    ways = (
        *(questions, known, lambda: describe(path), lambda: audit([path], probed=0)),
        lambda: verify_split(path.parent, 0),
    )
    if path.name == ROOMS:
        ways = (rooms, lambda: info.describe(path), lambda: checks_of(path, 2))
    for way in ways:
        text = ""
        try:
            way()
        except (SceneGenError, OSError) as error:
            text = str(error)
        assert "\n" not in text
        assert len(text) < 1000


@pytest.fixture(scope="module")
def made(make_rooms, tmp_path_factory):
    """Return a folder with a file of rooms and a split with depth."""
    folder = tmp_path_factory.mktemp("made") / "split"
    spec = SplitSpec(
        seed=5, train=4, labeled=2, val=2, test=2, cubes=(5, 7), lights=(1, 2),
        height=32, width=32, min_cube_pixels=2, with_depth=True,
    )  # fmt: skip
    make_split(folder, spec)
    make_rooms(folder / ROOMS, 2, views=(0.0, 20.0))
    return folder


HOW = sorted({"gone", "a group", *ATTRIBUTES, *DATASETS, *VALUES})


@settings(max_examples=10, derandomize=True, deadline=None)
@given(data=st.data())
def test_only_errors_of_ours_come_out(data, made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    for name in FILES:
        (folder / name).write_bytes((made / name).read_bytes())
    path = folder / data.draw(st.sampled_from(FILES))
    where, key = data.draw(st.sampled_from(places(path)))
    with h5py.File(path, "r+") as file:
        edit(file, where, key, data.draw(st.sampled_from(HOW)))
    everything(path)

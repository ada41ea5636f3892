"""Submissions as a stranger writes them, with plain h5py or as JSON."""

import hashlib
import json
import tracemalloc

import h5py
import numpy as np
import pytest
from h5_edits import damaged_chunk, put
from refusals import refused
from submissions import as_json, edited, good_answers

from metrics.submissions.problems import JsonError
from metrics.submissions.reader import QuestionPredictions, RoomPredictions, open_predictions
from metrics.submissions.strict_json import memory_needed, parse_json
from metrics.submissions.truths import match_problems
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile

HEAD = {"format": "pix2shape-bench/predictions", "format_version": "1.0", "method": "mine"}


@pytest.fixture
def by_hand(truths, tmp_path):
    """Write the least that a submission needs; datasets as given."""

    def write(**datasets):
        path = tmp_path / "hand.h5"
        with RoomsFile(truths.rooms) as rooms, h5py.File(path, "w") as file:
            file.attrs.update(HEAD, task="rooms", truth_fingerprint=rooms.fingerprint)
            depth = rooms.read("depth", slice(None))
            for name, values in {"row": np.arange(8), "depth": depth, **datasets}.items():
                file[name] = values
        return path

    return write


def test_the_least_that_is_needed(by_hand, truths):
    with open_predictions(by_hand()) as found, RoomsFile(truths.rooms) as rooms:
        assert isinstance(found, RoomPredictions)
        assert (found.task, found.method, found.alignment) == ("rooms", "mine", "none")
        assert found.run == found.notes == found.truth_path == ""
        assert found.truth_fingerprint == rooms.fingerprint
        assert found.rows.dtype == np.int64
        assert found.rows.tolist() == list(range(8))
        assert len(found) == 8
        assert (found.height, found.width) == (32, 32)
        assert not found.has_normals
        depth = found.depth(3)
        assert (depth.dtype, depth.shape) == (np.float64, (32, 32))
        assert np.array_equal(depth, rooms.read("depth", 3))
        with refused(FileFormatError, "hand.h5: normal"):
            found.normal(0)
        assert match_problems(found, rooms) == []


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", ">f4", ">f8"])
def test_any_floats_and_normals_of_any_length(by_hand, dtype):
    depth = np.linspace(1, 2, 8 * 32 * 32).reshape(8, 32, 32).astype(dtype)
    normal = np.full((8, 32, 32, 3), 7.0, dtype)
    with open_predictions(by_hand(depth=depth, normal=normal)) as found:
        assert found.has_normals
        for read, values in ((found.depth(5), depth[5]), (found.normal(2), normal[2])):
            assert read.dtype == np.float64
            assert np.array_equal(read, values.astype("f8"))


@pytest.mark.parametrize("dtype", ["u1", "i2", ">i4", "u8"])
def test_any_integers_in_any_order(by_hand, dtype):
    rows = np.array([3, 1, 0, 2, 7, 6, 5, 4])
    depth = np.ones((8, 32, 32)) * rows[:, None, None]
    with open_predictions(by_hand(row=rows.astype(dtype), depth=depth)) as found:
        assert found.rows.tolist() == rows.tolist()
        assert [found.depth(i)[0, 0] for i in range(8)] == rows.tolist()


def test_texts_of_any_kind(by_hand):
    path = by_hand()
    with h5py.File(path, "r+") as file:
        file.attrs["method"] = np.bytes_("Größe 大 \U0001f600".encode())  # fixed length
        file.attrs.create("run", "seed 1", dtype=h5py.string_dtype("ascii"))
        file.attrs["notes"] = "two\nlines"
        file.attrs["unknown"] = np.arange(3)
        file["further"] = np.zeros(4)
    with open_predictions(path) as found:
        assert found.method == "Größe 大 \U0001f600"
        assert (found.run, found.notes) == ("seed 1", "two\nlines")


def test_opening_reads_no_pixels(truths, tmp_path):
    path = edited(damaged_chunk("depth", 3))(tmp_path, truths.rooms)
    with open_predictions(path) as found:
        assert np.isfinite(found.depth(2)).all()
        with pytest.raises(FileFormatError) as caught:
            found.depth(3)
        assert caught.value.where.startswith(f"{path}: depth, row 3")


def test_a_refused_file_is_closed(truths, tmp_path):
    path = edited(put("row", 0, 1))(tmp_path, truths.rooms)
    with pytest.raises(FileFormatError):
        open_predictions(path)
    with h5py.File(path, "r+") as file:
        file["row"][0] = 0
    with open_predictions(path) as found:
        found.close()
        found.close()
    with h5py.File(path, "r+"):
        pass


# ---- answers ----


def test_answers_from_scores_abstain_where_tied(truths, tmp_path):
    def edit(file):
        del file["answer"]
        file["scores"][1] = [2.0, 5.0, 5.0]
        file["scores"][2] = [0.0, 0.0, 0.0]

    with open_predictions(edited(edit, good_answers)(tmp_path, truths.iqtt)) as found:
        assert found.answers.tolist() == [0, -1, -1, 2, 1, 0]


@pytest.mark.parametrize("count", [3, 65_536, 70_001])
def test_scores_are_read_in_blocks(count, tmp_path):
    rng = np.random.default_rng(count)
    scores = rng.random((count, 3))
    path = tmp_path / "many.h5"
    with h5py.File(path, "w") as file:
        file.attrs.update(HEAD, task="iqtt", truth_fingerprint="")
        file["question"], file["scores"] = np.arange(count), scores
    with open_predictions(path) as found:
        assert np.array_equal(found.answers, scores.argmax(axis=1))
        assert found.truth_fingerprint is None
    with h5py.File(path, "r+") as file:
        file["scores"][count - 1, 1] = np.nan
    with refused(FileFormatError, f"{path}: scores", found=f"(ids {count - 1})"):
        open_predictions(path)


@pytest.mark.parametrize(
    ("content", "rows", "answers", "method", "run"),
    [
        ([0, 1, 2, -1], [0, 1, 2, 3], [0, 1, 2, -1], "answers", ""),
        ({"3": 1, "0": -1}, [3, 0], [1, -1], "answers", ""),
        ({"answers": [2, 2]}, [0, 1], [2, 2], "answers", ""),
        ({"answers": {"1": 0}, "method": "大", "run": "4"}, [1], [0], "大", "4"),
        ({"method": "m", "notes": "x", "answers": [0]}, [0], [0], "m", ""),
    ],
)
def test_json(tmp_path, content, rows, answers, method, run):
    path = as_json(content)(tmp_path, None)
    with open_predictions(path) as found:
        assert isinstance(found, QuestionPredictions)
        assert (found.rows.tolist(), found.answers.tolist()) == (rows, answers)
        assert (found.method, found.run) == (method, run)
        assert found.truth_fingerprint is None
        assert found.scores is None
        assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("start", ["", "\ufeff", " \n\t"])
@pytest.mark.parametrize("name", ["answers.json", "answers", "answers.h5"])
def test_json_under_any_name(tmp_path, name, start):
    path = tmp_path / name
    path.write_text(start + json.dumps([0, 1]), encoding="utf-8")
    with open_predictions(path) as found:
        assert found.answers.tolist() == [0, 1]


SIZE = 2**17
WIDE = '"\U0001f600"]'.encode()


def filled(piece, end=b"0]", start=b"["):
    return start + piece * (SIZE // len(piece)) + end


def many_keys():
    keys = b"{" + b",".join(b'"%d":0' % i for i in range(SIZE // 12)) + b"}"
    return b"[" + keys + b"]"


TEXTS = {
    "lists": filled(b"[],"),
    "lists in lists": b"[" + filled(b"[[[]]],") + b"]",
    "objects": filled(b"{},"),
    "objects with a key": filled(b'{"a":0},'),
    "keys": many_keys(),
    "short texts": filled(b'"ab",'),
    "short texts beyond ASCII": filled('"\U0001f600",'.encode()),
    "short texts and a wide one": filled(b'"ab",', WIDE),
    "a long text": filled(b"a", b'"]', b'["'),
    "a long text, widened at its end": filled(b"a", '\U0001f600"]'.encode(), b'["'),
    "a long text, widened by an escape": filled(b"a", b'\\ud83d\\ude00"]', b'["'),
    "spaces and a wide character": filled(b" ", WIDE),
    "escapes": filled(b"\\u0041", b'"]', b'["'),
    "small numbers": filled(b"0,"),
    "whole numbers": filled(b"999,"),
    "numbers": filled(b"1.5,"),
    "long numbers": filled(b"9" * 4000 + b","),
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_no_text_takes_more_than_the_bound(text):
    memory_needed(text)
    tracemalloc.start()
    try:
        parse_json(text, 10**6)
        taken = tracemalloc.get_traced_memory()[1] + len(text)
    finally:
        tracemalloc.stop()
    assert taken < memory_needed(text)


def test_what_would_take_too_much_is_not_parsed():
    text = TEXTS["lists"]
    tracemalloc.start()
    try:
        with refused(JsonError, "", "JSON that may take", "at most 1,000"):
            parse_json(text, 10, 1000)
        assert tracemalloc.get_traced_memory()[1] < 2**16
    finally:
        tracemalloc.stop()
    with refused(JsonError, "", "JSON that may take"):
        parse_json(text * 240, 10)


def test_whole_numbers_without_end_are_refused():
    with refused(JsonError, "", "no JSON"):
        parse_json(b"9" * 10**6, 10)

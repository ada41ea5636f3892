"""The writer of rooms: what it writes, and that it writes nothing invalid."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from metrics.prediction_writer import PredictionError, RoomPredictionWriter
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.rooms.reader import RoomsFile

SIZE = (32, 32)
ROOT = Path(__file__).parents[2]


@pytest.fixture
def writer(truths, tmp_path):
    """Make a writer to predictions.h5."""

    def make(**settings):
        settings = {"method": "mine", **settings}
        return RoomPredictionWriter(tmp_path / "predictions.h5", truths.rooms, **settings)

    return make


def noise(seed, *shape):
    return np.random.default_rng(seed).random(shape) + 1.0


def fill(writer, *rows):
    with writer as out:
        for row in rows:
            out.add(*row)


def test_round_trip_in_any_order(writer, truths, tmp_path):
    order = [5, 0, 7, 2, 1, 6, 3, 4]
    depth, normal = noise(1, 8, *SIZE), noise(2, 8, *SIZE, 3)
    settings = {"run": "seed 4", "alignment": "scale", "notes": "a\nb"}
    with writer(**settings) as out:
        for row in order:
            out.add(row, depth[row], normal[row])
    path = tmp_path / "predictions.h5"
    with open_predictions(path) as found:
        assert found.rows.tolist() == order
        for i, row in enumerate(order):
            assert np.array_equal(found.depth(i), depth[row].astype("f4"))
            assert np.array_equal(found.normal(i), normal[row].astype("f4"))
        assert (found.method, found.run, found.alignment) == ("mine", "seed 4", "scale")
        assert found.notes == "a\nb"
        assert found.truth_path == str(truths.rooms)
    assert [problem for problem in validate(path) if not problem.is_hint] == []


def test_what_plain_h5py_sees(writer, truths, tmp_path):
    with writer() as out:
        for row in range(8):
            out.add(np.int64(row), noise(row, *SIZE).astype("f4"), noise(row, *SIZE, 3).tolist())
    with h5py.File(tmp_path / "predictions.h5") as file, RoomsFile(truths.rooms) as rooms:
        root = dict(file.attrs)
        assert root["format"] == "pix2shape-bench/predictions"
        assert (root["format_version"], root["task"], root["run"]) == ("1.0", "rooms", "")
        assert (root["method"], root["alignment"]) == ("mine", "none")
        assert root["truth_fingerprint"] == rooms.fingerprint
        assert root["writer"].startswith("pix2shape-bench ")
        assert set(file) == {"row", "depth", "normal"}
        for name, dtype, unit, frame in (
            ("row", "int64", "1", "-"),
            ("depth", "float32", "scene unit", "camera"),
            ("normal", "float32", "1", "camera"),
        ):
            dataset = file[name]
            assert (dataset.dtype, dataset.compression, dataset.shuffle) == (dtype, "gzip", True)
            assert (dataset.attrs["unit"], dataset.attrs["frame"]) == (unit, frame)
            assert dataset.attrs["shape"].startswith("(M,")
            assert len(dataset.attrs["meaning"]) > 10
        assert file["depth"].chunks == (1, *SIZE)
        assert file["normal"].chunks == (1, *SIZE, 3)


def test_the_same_rows_give_the_same_bytes(truths, tmp_path):
    for name in ("a.h5", "b.h5"):
        with RoomPredictionWriter(tmp_path / name, truths.rooms, method="m") as out:
            for row in range(8):
                out.add(row, noise(row, *SIZE))
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


GOOD_NORMAL = np.ones((*SIZE, 3))


def spoiled(value, at=(3, 4), base=None):
    array = (noise(0, *SIZE) if base is None else base).copy()
    array[at] = value
    return array


REFUSED = {
    "row beyond": ((8, noise(0, *SIZE)), ["found 8", "from 0 to 7"]),
    "negative row": ((-1, noise(0, *SIZE)), ["found -1", "from 0 to 7"]),
    "row is a float": ((1.0, noise(0, *SIZE)), ["found 1.0"]),
    "row is true": ((True, noise(0, *SIZE)), ["found True"]),
    "row is a text": (("1", noise(0, *SIZE)), ["found '1'"]),
    "row given": ((0, noise(0, *SIZE)), ["row 0: given twice", "expected once"]),
    "shape": ((1, noise(0, 16, 16)), ["row 1: depth", "(16, 16)", "expected (32, 32)"]),
    "batch of one": ((1, noise(0, 1, *SIZE)), ["(1, 32, 32)", "expected (32, 32)"]),
    "whole numbers": ((1, np.ones(SIZE, "u2")), ["type uint16", "expected floats"]),
    "objects": ((1, np.full(SIZE, None)), ["type object", "expected floats"]),
    "ragged": ((1, [[1.0, 2.0], [3.0]]), ["row 1: depth", "no array"]),
    "NaN": ((1, spoiled(np.nan)), ["row 1: depth", "NaN", "1 pixels", "(3, 4)", "finite"]),
    "infinite": ((1, spoiled(np.inf)), ["row 1: depth", "(3, 4)", "finite"]),
    "beyond float32": ((1, spoiled(1e39)), ["row 1: depth", "(3, 4)", "finite"]),
    "negative z": ((1, -noise(0, *SIZE)), ["row 1: depth", "at or below 0", "positive"]),
    "all zero": ((1, np.zeros(SIZE)), ["row 1: depth", "at or below 0"]),
    "normal shape": ((1, noise(0, *SIZE), np.ones((3, *SIZE))), ["normal", "(3, 32, 32)"]),
    "normal NaN": (
        (1, noise(0, *SIZE), spoiled(np.nan, (5, 6, 0), GOOD_NORMAL)),
        ["row 1: normal", "NaN", "(5, 6)"],
    ),
    "normal zero": (
        (1, noise(0, *SIZE), spoiled(0.0, (5, 6), GOOD_NORMAL)),
        ["row 1: normal", "length 0", "(5, 6)", "above 0"],
    ),
    "no normal": ((1, noise(0, *SIZE), "none"), ["row 1: normal: found none, expected one"]),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_refused_at_write_time(writer, tmp_path, kind):
    arguments, words = REFUSED[kind]
    if len(arguments) == 2:
        arguments = (*arguments, GOOD_NORMAL)
    arguments = tuple(None if isinstance(a, str) and a == "none" else a for a in arguments)
    with pytest.raises(PredictionError) as error:
        fill(writer(), (0, noise(0, *SIZE), GOOD_NORMAL), arguments)
    line = str(error.value)
    assert isinstance(error.value, SceneGenError)
    assert str(tmp_path / "predictions.h5") in line
    assert [word for word in words if word not in line] == [], line
    assert list(tmp_path.iterdir()) == []


def test_normals_after_none(writer):
    with pytest.raises(PredictionError, match="row 1: normal: found one, expected none"):
        fill(writer(), (0, noise(0, *SIZE)), (1, noise(0, *SIZE), GOOD_NORMAL))


def test_a_refused_row_may_be_mended(writer, tmp_path):
    with writer() as out:
        for row in range(8):
            with pytest.raises(PredictionError):
                out.add(row, spoiled(np.nan))
            out.add(row, noise(row, *SIZE))
    assert validate(tmp_path / "predictions.h5") == []


def test_anything_goes_where_the_truth_shows_nothing(truths, tmp_path):
    """And nothing else is asked of normals there."""
    truth = tmp_path / "rooms.h5"
    truth.write_bytes(truths.rooms.read_bytes())
    with h5py.File(truth, "r+") as file:
        file["depth"][:, 3, 4] = np.nan
        file["normal"][:, 3, 4] = 0.0
    path = tmp_path / "predictions.h5"
    with RoomPredictionWriter(path, truth, method="m") as out:
        for row, odd in enumerate([np.inf, np.nan, -1.0, -np.inf, 0.0, 1e39, 1e30, 1.0]):
            out.add(row, spoiled(odd), spoiled(odd if row % 2 else 0.0, (3, 4), GOOD_NORMAL))
    assert validate(path) == []
    other = tmp_path / "other.h5"
    with pytest.raises(PredictionError), RoomPredictionWriter(other, truth, method="m") as out:
        out.add(0, spoiled(np.nan, (3, 5)))


def test_shifted_depth_may_have_any_sign(writer, tmp_path):
    with writer(alignment="scale_shift") as out:
        for row in range(8):
            out.add(row, noise(row, *SIZE) - 5.0)
    assert [p for p in validate(tmp_path / "predictions.h5") if not p.is_hint] == []


def test_some_depth_may_lie_behind_the_camera(writer):
    with writer() as out:
        for row in range(8):
            out.add(row, spoiled(-1.0, np.s_[:10]))


def test_missing_rows_are_an_error(writer, tmp_path):
    with pytest.raises(PredictionError, match=r"3 of 8 rows were not given, such as 1, 4, 6"):
        fill(writer(), *((row, noise(row, *SIZE)) for row in (0, 2, 3, 5, 7)))
    assert list(tmp_path.iterdir()) == []


def test_missing_rows_where_that_is_allowed(writer, tmp_path):
    with writer(allow_partial=True) as out:
        for row in (6, 1):
            out.add(row, noise(row, *SIZE), GOOD_NORMAL)
    path = tmp_path / "predictions.h5"
    with open_predictions(path) as found:
        assert found.rows.tolist() == [6, 1]
        assert np.array_equal(found.depth(1), noise(1, *SIZE).astype("f4"))
        assert found.normal(1).shape == (*SIZE, 3)
    (problem,) = validate(path)
    assert (problem.dataset, problem.rule, problem.ids) == ("row", "complete", (0, 2, 3, 4, 5))


def test_nothing_at_all_is_never_allowed(writer, tmp_path):
    with pytest.raises(PredictionError, match="8 of 8 rows"), writer(allow_partial=True):
        pass
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_the_author_leaves_nothing(writer, tmp_path):

    class Failing:
        def __array__(self, dtype=None, copy=None):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fill(writer(), (0, noise(0, *SIZE)), (1, Failing()))
    assert list(tmp_path.iterdir()) == []


def test_only_inside_the_block(writer):
    out = writer(allow_partial=True)
    with pytest.raises(PredictionError, match="inside the with block"):
        out.add(0, noise(0, *SIZE))
    with out:
        out.add(0, noise(0, *SIZE))
    with pytest.raises(PredictionError, match="inside the with block"):
        out.add(1, noise(0, *SIZE))


def test_an_existing_file_is_kept(writer, tmp_path):
    (tmp_path / "predictions.h5").write_text("precious")
    with pytest.raises(FileExistsError), writer():
        pass
    assert (tmp_path / "predictions.h5").read_text() == "precious"
    with writer(overwrite=True, allow_partial=True) as out:
        out.add(0, noise(0, *SIZE))
    with open_predictions(tmp_path / "predictions.h5") as found:
        assert len(found) == 1


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"method": ""}, "method: found an empty text"),
        ({"method": "a\nb"}, r"method: found the character '\\n'"),
        ({"method": 3}, "method: found 3, expected a text"),
        ({"method": "m" * 201}, "201 characters, expected at most 200"),
        ({"run": 7}, "run: found 7, expected a text"),
        ({"alignment": "affine"}, "alignment: found 'affine', expected 'none' or"),
        ({"notes": "\x1b[2J"}, "notes: found the character"),
    ],
)
def test_texts_are_checked_first(writer, settings, words):
    with pytest.raises(PredictionError, match=words):
        writer(**settings)


def test_the_truth_must_be_there(tmp_path, truths):
    with pytest.raises(FileNotFoundError):
        RoomPredictionWriter(tmp_path / "p.h5", tmp_path / "no.h5", method="m").__enter__()
    with pytest.raises(FileFormatError, match="not a rooms file"):
        RoomPredictionWriter(tmp_path / "p.h5", truths.iqtt, method="m").__enter__()


def test_memory_stays_flat(writer):
    """What a row leaves behind is its number, not its pixels."""
    import tracemalloc

    with writer(allow_partial=True) as out:
        out.add(0, noise(0, *SIZE), GOOD_NORMAL)
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        for row in range(1, 8):
            out.add(row, noise(row, *SIZE), GOOD_NORMAL)
        kept = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
    assert kept < 7 * 32 * 32 * 4


@pytest.mark.parametrize("name", ["submit.py", "submit_iqtt.py"])
def test_examples(truths, tmp_path, name):
    script = ROOT / "examples" / name
    truth = truths.iqtt if "iqtt" in name else truths.rooms
    out = tmp_path / "out.h5"
    done = subprocess.run(
        [sys.executable, script, truth, out],
        capture_output=True, text=True, check=True, cwd=ROOT, env={"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.stdout == f"now: bench score {out}\n"
    assert len(script.read_text().splitlines()) < 30
    assert validate(out) == []

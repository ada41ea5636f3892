"""The writers of submissions: what they write, and that they write nothing invalid."""

import shutil
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from refusals import refused

from iqtt.files.reader import AnswersFile
from metrics.prediction_writer import PredictionError, RoomPredictionWriter, write_answers
from metrics.scoring.evaluate import score
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.common.errors import SceneGenError
from scenegen.rooms.reader import RoomsFile

SIZE = (32, 32)


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
    settings = {"run": "seed 4", "alignment": "scale", "notes": "a\nb", "shown": "first_view"}
    fill(writer(**settings), *((np.int64(row), depth[row], normal[row].tolist()) for row in order))
    path = tmp_path / "predictions.h5"
    with open_predictions(path) as predictions:
        assert predictions.rows.tolist() == order
        for i, row in enumerate(order):
            assert np.array_equal(predictions.depth(i), depth[row].astype("f4"))
            assert np.array_equal(predictions.normal(i), normal[row].astype("f4"))
    assert [problem for problem in validate(path) if not problem.is_hint] == []
    with h5py.File(path) as file, RoomsFile(truths.rooms) as rooms:
        root = dict(file.attrs)
        assert root.pop("writer").startswith("pix2shape-bench ")
        assert root == {
            "format": "pix2shape-bench/predictions", "format_version": "1.0", "task": "rooms",
            "method": "mine", "run": "seed 4", "notes": "a\nb", "alignment": "scale",
            "shown": "first_view",
            "truth_path": str(truths.rooms), "truth_fingerprint": rooms.fingerprint,
        }  # fmt: skip
        told = {n: (d.attrs["unit"], d.attrs["frame"], d.dtype) for n, d in file.items()}
        assert told == {
            "row": ("1", "-", "int64"), "depth": ("scene unit", "camera", "float32"),
            "normal": ("1", "camera", "float32"),
        }  # fmt: skip
        assert (file["depth"].chunks, file["normal"].chunks) == ((1, *SIZE), (1, *SIZE, 3))


def test_the_same_rows_give_the_same_bytes(truths, tmp_path):
    for name in ("a.h5", "b.h5"):
        out = RoomPredictionWriter(tmp_path / name, truths.rooms, method="m")
        fill(out, *((row, noise(row, *SIZE)) for row in range(8)))
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


DEPTH, GOOD_NORMAL = noise(0, *SIZE), np.ones((*SIZE, 3))


def spoiled(value, at=(3, 4), base=DEPTH):
    array = base.copy()
    array[at] = value
    return array


POINTS = np.dstack([np.zeros(SIZE), np.zeros(SIZE), np.full(SIZE, -2.0)])
# Alignment, rows that are added, the place of the error, and words of what was found there.
ROW_0 = (0, DEPTH, GOOD_NORMAL)
REFUSED = {
    "row beyond": (None, [ROW_0, (8, DEPTH, GOOD_NORMAL)], "row", "8"),
    "row is a float": (None, [ROW_0, (1.0, DEPTH, GOOD_NORMAL)], "row", "1.0"),
    "row given": (None, [ROW_0, ROW_0], "row 0", "twice"),
    "no normal": (None, [ROW_0, (1, DEPTH)], "row 1: normal", "none"),
    "normal after none": (None, [(0, DEPTH), (1, DEPTH, GOOD_NORMAL)], "row 1: normal", "one"),
    "shape": (None, [(0, noise(0, 16, 16))], "row 0: depth", "16, 16)"),
    "whole numbers": (None, [(0, np.ones(SIZE, "u2"))], "row 0: depth", "uint16"),
    "ragged": (None, [(0, [[1.0, 2.0], [3.0]])], "row 0: depth", "no array"),
    "NaN": (None, [(0, spoiled(np.nan))], "row 0: depth", "1 pixels, the first at (3, 4)"),
    "masked": (None, [(0, np.ma.masked_array(DEPTH, DEPTH[3, 4] == DEPTH))], "row 0: depth", "(3,"),
    "beyond float32": (None, [(0, spoiled(1e39))], "row 0: depth", "(3, 4)"),
    "negative z": (None, [(0, -DEPTH)], "row 0: depth", "at or below 0"),
    "zeros": (None, [(0, 0.0 * DEPTH)], "row 0: depth", "at or below 0"),
    "normal NaN": (None, [(0, DEPTH, spoiled(np.nan, (5, 6, 0), GOOD_NORMAL))], "row 0: normal",
                   "(5, 6)"),
    "normal zero": (None, [(0, DEPTH, spoiled(0.0, (5, 6), GOOD_NORMAL))], "row 0: normal",
                    "length 0"),
    "nothing": ("none", [(0,)], "row 0: geometry", "none"),
    "two kinds": ("none", [{"depth": DEPTH, "points": POINTS}], "row 0: geometry", "depth and"),
    "another kind": ("none", [{"depth": DEPTH}, {"points": POINTS}], "row 1: depth", "none"),
    "disparity in metres": ("scale", [{"disparity": DEPTH}], "row 0: alignment", "scale"),
    "points by medians": ("median_scale", [{"points": POINTS}], "row 0: alignment", "median"),
    "points behind": ("none", [{"points": -POINTS}], "row 0: points", "at or below 0"),
    "disparity NaN": (None, [{"disparity": spoiled(np.nan)}], "row 0: disparity", "(3, 4)"),
    "a lens of 180": ("none", [{"depth": DEPTH, "fov_y_degrees": 180.0}], "row 0: fov_y_degrees",
                      "180"),
    "a lens once": ("none", [{"depth": DEPTH, "fov_y_degrees": 4.0}, {"depth": DEPTH}],
                    "row 1: fov_y_degrees", "none"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_refused_at_write_time(writer, tmp_path, kind):
    alignment, rows, where, found = REFUSED[kind]
    with (
        refused(PredictionError, f"{tmp_path / 'predictions.h5'}: {where}", found=found),
        writer(alignment=alignment) as out,
    ):
        for number, row in enumerate(rows):
            out.add(number, **row) if isinstance(row, dict) else out.add(*row)
    assert list(tmp_path.iterdir()) == []


def test_anything_goes_where_the_truth_shows_nothing(truths, tmp_path):
    """And nothing else is asked of normals there."""
    truth = tmp_path / "rooms.h5"
    truth.write_bytes(truths.rooms.read_bytes())
    with h5py.File(truth, "r+") as file:
        file["depth"][:, 3, 4] = np.nan
        file["normal"][:, 3, 4] = 0.0
        file["object_id"][:, 3, 4] = -1
    path = tmp_path / "predictions.h5"
    with RoomPredictionWriter(path, truth, method="m") as out:
        for row, odd in enumerate([np.inf, np.nan, -1.0, -np.inf, 0.0, 1e39, 1e30, 1.0]):
            out.add(row, spoiled(odd), spoiled(odd if row % 2 else 0.0, (3, 4), GOOD_NORMAL))
    assert validate(path, truth) == []


def test_depth_behind_the_camera(writer):
    """Some of it may lie there, and all of it where a shift is aligned away."""
    with writer(allow_partial=True) as out:
        out.add(0, spoiled(-1.0, np.s_[:10]))
    with writer(alignment="scale_shift", allow_partial=True, overwrite=True) as out:
        out.add(0, DEPTH - 5.0)


@pytest.mark.parametrize(
    ("partial", "rows", "found"),
    [(False, (0, 2, 3, 5, 7), "3 of 8 missing, such as 1, 4, 6"), (True, (), "8 of 8 missing")],
)
def test_missing_rows_are_an_error(writer, tmp_path, partial, rows, found):
    """Where some may be missing, there must be one at least."""
    with refused(PredictionError, f"{tmp_path / 'predictions.h5'}: row", found=found):
        fill(writer(allow_partial=partial), *((row, DEPTH) for row in rows))
    assert list(tmp_path.iterdir()) == []


def test_missing_rows_where_that_is_allowed(writer, truths, tmp_path):
    fill(writer(allow_partial=True), *((row, noise(row, *SIZE), GOOD_NORMAL) for row in (6, 1)))
    with open_predictions(tmp_path / "predictions.h5") as predictions:
        assert predictions.rows.tolist() == [6, 1]
        assert np.array_equal(predictions.depth(1), noise(1, *SIZE).astype("f4"))
    (problem,) = validate(tmp_path / "predictions.h5", truths.rooms)
    assert (problem.dataset, problem.rule, problem.ids) == ("row", "complete", (0, 2, 3, 4, 5))


def test_the_block_decides_what_is_left(writer, tmp_path):
    with pytest.raises(KeyboardInterrupt), writer() as out:  # noqa: PT012
        out.add(0, DEPTH)
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
    out = writer(allow_partial=True)
    with pytest.raises(PredictionError):
        out.add(1, DEPTH)
    fill(out, (0, DEPTH))
    with pytest.raises(FileExistsError), writer():
        pass
    fill(writer(overwrite=True, allow_partial=True), (3, DEPTH))
    with open_predictions(tmp_path / "predictions.h5") as predictions:
        assert predictions.rows.tolist() == [3]


@pytest.mark.parametrize(
    ("name", "value", "found"),
    [
        ("method", "", "an empty text"),
        ("run", 7, "7"),
        ("alignment", "affine", "'affine'"),
        ("notes", "\x1b[2J", r"the character '\x1b'"),
    ],
)
def test_texts_are_checked_first(writer, name, value, found):
    with refused(PredictionError, name, found=found):
        writer(**{name: value})


def test_memory_stays_flat(writer):
    """What a row leaves behind is its number, not its pixels."""
    with writer(allow_partial=True) as out:
        out.add(0, noise(0, *SIZE), GOOD_NORMAL)
        tracemalloc.start()
        for row in range(1, 8):
            out.add(row, noise(row, *SIZE), GOOD_NORMAL)
        pixels = tracemalloc.DomainFilter(True, np.lib.tracemalloc_domain)
        kept = tracemalloc.take_snapshot().filter_traces([pixels]).traces
        tracemalloc.stop()
    # Of arrays alone: what Python itself keeps depends on which tests ran before.
    assert sum(trace.size for trace in kept) < 32 * 32 * 4


def test_a_submission_never_replaces_what_it_is_about(truths, tmp_path):
    """Not under another name of the file either."""
    for task in ("rooms", "iqtt"):
        truth = shutil.copy(truths.of(task), tmp_path / f"{task}.h5")
        before = Path(truth).read_bytes()
        link = tmp_path / f"{task}-link.h5"
        link.symlink_to(truth)
        for path in (truth, link):
            with pytest.raises(PredictionError):  # noqa: PT012
                if task == "iqtt":
                    write_answers(path, truth, method="m", answer=[0] * 6, overwrite=True)
                else:
                    RoomPredictionWriter(path, truth, method="m", overwrite=True)
        assert Path(truth).read_bytes() == before


# ---- answers ----


@pytest.mark.parametrize("name", ["iqtt-test.h5", "iqtt-test-answers.h5", "iqtt-val.h5"])
def test_answers(truths, tmp_path, name):
    file = truths.iqtt.with_name(name)
    scores = noise(3, 6, 3)
    answer = scores.argmax(axis=1).tolist()
    path = tmp_path / "answers.h5"
    write_answers(path, file, method="m", run="1", notes="n", answer=answer, scores=scores)
    assert validate(path, file) == []
    truth_name = "iqtt-val.h5" if "val" in name else "iqtt-test-answers.h5"
    with open_predictions(path) as predictions, AnswersFile(file.with_name(truth_name)) as truth:
        assert predictions.rows.tolist() == list(range(6))
        assert predictions.answers.tolist() == answer
        assert np.array_equal(predictions.scores, scores)
        assert (predictions.method, predictions.run, predictions.notes) == ("m", "1", "n")
        assert predictions.truth_path == str(file)
        assert predictions.truth_fingerprint == truth.fingerprint


def test_some_answers_to_a_file_as_released(truths, tmp_path):
    """It has no fingerprint, so that only the number of questions is held against it."""
    file = tmp_path / "iqtt-val.h5"
    with h5py.File(truths.iqtt.with_name("iqtt-val.h5")) as ours, h5py.File(file, "w") as released:
        released["questions"], released["answers"] = ours["questions"][()], ours["answers"][()]
    write_answers(tmp_path / "a.h5", file, method="m", answer=[0, -1], rows=[4, 2])
    with open_predictions(tmp_path / "a.h5") as predictions:
        assert predictions.truth_fingerprint is None
        assert (predictions.rows.tolist(), predictions.answers.tolist()) == ([4, 2], [0, -1])
    assert [p.rule for p in validate(tmp_path / "a.h5", file)] == ["complete"]


EYE = np.eye(3)[[0, 1, 2, 0, 1, 2]]


@pytest.mark.parametrize(
    ("given", "where", "found"),
    [
        ({}, "", "neither a response nor scores"),
        ({"answer": [0, 1, 2]}, ": answer", "3 rows"),
        ({"answer": np.ma.masked_array([0, 1, 2] * 2, [1, 0] * 3)}, ": answer", "3 masked"),
        ({"scores": np.ma.masked_array(EYE, EYE == 1)}, ": scores", "6 NaN"),
        ({"answer": [0, 1, 2, 3, 0, 1]}, ": answer", "such as 3 (ids 3)"),
        ({"answer": [1, 1, 2, 3, 2, 1]}, ": answer", "counted from 1"),
        ({"scores": EYE * [1, 1, np.nan]}, ": scores", "(ids 0, 1, 2"),
        ({"scores": 0 * EYE, "answer": [0] * 6}, ": answer", "6 that disagree"),
        ({"answer": [0] * 6, "outcome": [0, 1, 2, 4, 0, -1]}, ": outcome", "2 outside"),
        ({"answer": [0] * 6, "rotated": [[0, 0, 3]] + [[0] * 3] * 5}, ": rotated", "(ids 0)"),
        ({"answer": [0] * 6, "rotated": [[0] * 3] * 5 + [[1, 0, 0]]}, ": rotated", "(ids 5)"),
        ({"answer": [0] * 6, "rotated": [[0, -2, 0]] * 5 + [[-2, 0, 0]]}, ": rotated", "(ids 5)"),
        ({"answer": [0, 0], "rows": [1, 6]}, ": question", "(ids 6)"),
        ({"answer": [0, 0], "rows": [1, 1]}, ": question", "more than once (ids 1)"),
        ({"answer": [0, 0], "rows": [1, -1]}, ": question", "negative (ids -1)"),
        ({"answer": [], "rows": []}, ": question", ""),
    ],
)
def test_answers_refused(truths, tmp_path, given, where, found):
    with refused(PredictionError, f"{tmp_path / 'answers.h5'}{where}", found=found):
        write_answers(tmp_path / "answers.h5", truths.iqtt, method="m", **given)
    assert list(tmp_path.iterdir()) == []


def test_answers_to_no_questions(truths, tmp_path):
    training = truths.iqtt.with_name("iqtt-train.h5")
    with pytest.raises(SceneGenError):
        write_answers(tmp_path / "a.h5", training, method="m", answer=[0])
    assert list(tmp_path.iterdir()) == []


# From the true depth and points (camera frame) to what a method of that kind gives.
GEOMETRY = {
    "depth": lambda depth, points: depth,
    "disparity": lambda depth, points: 3.0 / depth - 0.5,
    "points": lambda depth, points: 2.5 * points - [0.3, 0.1, 0.7],
}
ALIGNMENTS = {"depth": "none", "disparity": "scale_shift", "points": "scale_shift"}


def written(kind, truth, path, make=None, **settings):
    make = make or GEOMETRY[kind]
    settings = {"method": "m", "alignment": ALIGNMENTS[kind], **settings}
    with RoomsFile(truth) as rooms, RoomPredictionWriter(path, truth, **settings) as out:
        for room in rooms:
            out.add(room.index, **{kind: make(room.depth, room.points)}, fov_y_degrees=40.0)
    return path


@pytest.mark.parametrize("kind", GEOMETRY)
def test_a_kind_comes_back_and_is_scored_as_what_it_is(kind, truths, tmp_path):
    """The truth under the transformation that its kind leaves open scores as the truth."""
    path = written(kind, truths.rooms, tmp_path / "p.h5")
    with open_predictions(path) as found, RoomsFile(truths.rooms) as rooms:
        assert (found.kind, found.alignment, found.height) == (kind, ALIGNMENTS[kind], 32)
        view = found.view(3)
        expected = GEOMETRY[kind](rooms[3].depth, rooms[3].points)
        assert np.array_equal(view.geometry, expected.astype("f4"))
        assert (view.kind, view.normal, view.fov_y_degrees) == (kind, None, 40.0)
        if kind == "points":
            assert np.array_equal(found.depth(3), -view.geometry[..., 2])
    assert validate(path, truths.rooms) == []
    scores = score([path], truths.rooms).metrics
    assert scores["chamfer"].value < 1e-5
    assert scores["relief_iou"].value > 0.999


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16, torch.float16])
def test_tensors_are_arrays(dtype, truths, tmp_path):
    """On the graph of a gradient, too, and in a type that NumPy lacks."""
    make = lambda depth, _: torch.full(depth.shape, 1.5, dtype=dtype, requires_grad=True)  # noqa: E731
    path = written("depth", truths.rooms, tmp_path / "p.h5", make)
    with open_predictions(path) as found:
        assert (found.depth(0) == 1.5).all()

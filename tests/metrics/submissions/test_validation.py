"""`validate`: everything at once, and only what is wrong."""

import os
import shutil
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from h5_edits import attribute, damaged_chunk, in_all, put, values
from refusals import refused
from submissions import edited, good_answers, good_rooms

from metrics.submissions.reader import open_predictions
from metrics.submissions.truths import FoundTruth, find_truth, read_true_view
from metrics.submissions.validation import validate
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile


@pytest.mark.parametrize("normals", [True, False])
def test_a_good_submission(truths, tmp_path, normals):
    steps = []
    path = good_rooms(tmp_path, truths.rooms, normals=normals)
    assert validate(path, truths.rooms, progress=steps.append) == []
    assert steps == [1] * 8
    path = good_answers(tmp_path, truths.iqtt)
    assert validate(path, truths.iqtt) == []
    (told,) = validate(path)  # which takes the submission's word for its truth
    assert (told.dataset, told.is_hint) == ("truth", True)
    assert "iqtt-test-answers.h5" in told.found


def test_everything_at_once(truths, tmp_path):
    def spoil(file):
        file.attrs["method"] = ""
        file.attrs["alignment"] = "affine"
        file["row"][:3] = [7, 7, 99]
        file["depth"][3, 5, 7:9] = np.nan
        file["depth"][5, 5, 7] = np.inf
        file["normal"][...] *= -1
        file["normal"][4, 0, :] = 0.0
        file["normal"][6, 1, 1, 2] = np.nan
        damaged_chunk("depth", 7)(file)

    path = edited(spoil)(tmp_path, truths.rooms)
    problems = validate(path, truths.rooms)
    assert [(one.dataset, one.rule, one.ids) for one in problems] == [
        ("method", "value", ()),
        ("alignment", "value", ()),
        ("row", "unique", (7,)),
        ("row", "known", (99,)),
        ("row", "complete", (0, 1, 2)),
        ("depth", "finite", (3, 5)),
        ("depth", "readable", (7,)),
        ("normal", "finite", (6,)),
        ("normal", "length", (4,)),
        ("normal", "hint", ()),
    ]


def test_ids_are_rows_of_the_truth(truths, tmp_path):
    """Not places in the submission."""

    def spoil(file):
        file["row"][...] = np.arange(8)[::-1]
        for name in ("depth", "normal"):
            file[name][...] = file[name][()][::-1]
        file["depth"][0, 0, 0] = np.nan

    (problem,) = validate(edited(spoil)(tmp_path, truths.rooms), truths.rooms)
    assert problem.ids == (7,)


def test_problems_of_answers_at_once(truths, tmp_path):
    def spoil(file):
        file.attrs["run"] = 3
        file["question"][1] = 0
        file["outcome"] = np.full(6, 4)
        file["rotated"] = np.repeat((file["answer"][()] + 1)[:, None] % 3, 3, axis=1)

    problems = validate(edited(spoil, good_answers)(tmp_path, truths.iqtt))
    assert {(p.dataset, p.rule) for p in problems} >= {
        ("run", "type"), ("question", "unique"), ("outcome", "range"), ("rotated", "agreement"),
    }  # fmt: skip


def test_another_truth_is_told_alone(truths, tmp_path):
    """Held against the wrong rooms, neither size nor value means anything."""

    def spoil(file):
        file.attrs["truth_fingerprint"] = "f" * 64
        for name in ("depth", "normal"):
            half = file[name][:, ::2, ::2] * np.nan
            del file[name]
            file[name] = half

    (problem,) = validate(edited(spoil)(tmp_path, truths.rooms), truths.rooms)
    assert problem.rule == "match"


def test_the_truth_as_given(truths, tmp_path):
    path = edited(attribute("truth_path", "gone.h5"))(tmp_path, truths.rooms)
    assert validate(path, truths.rooms) == []
    (problem,) = validate(path)
    assert (problem.dataset, problem.rule) == ("truth", "readable")
    (problem,) = validate(path, tmp_path / "none.h5")
    assert "none.h5" in problem.found
    for path, truth in ((path, truths.iqtt), (good_answers(tmp_path, truths.iqtt), truths.rooms)):
        (problem,) = validate(path, truth)
        assert problem.dataset == "truth"
        assert str(truth) in problem.found


def test_memory_does_not_grow_with_rows(make_rooms, tmp_path):
    """A row's pixels are gone when the next is read."""
    peaks = []
    for count in (6, 48):
        truth = make_rooms(tmp_path / f"rooms{count}.h5", count)
        path = good_rooms(tmp_path, truth, f"predictions{count}.h5")
        validate(path, truth)
        tracemalloc.start()
        assert validate(path, truth) == []
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # What hints look at is kept: 24 samples, and 64 pixels of every row.
    assert peaks[1] < 24 / 6 * peaks[0]


@pytest.mark.parametrize("seed", range(2))
def test_damaged_bytes(truths, tmp_path, seed):
    """Whatever bytes are changed, in the values that is: lines, and no exception.

    Not in the global heap, where HDF5 2.0 itself may not return.
    """
    good = good_rooms(tmp_path, truths.rooms).read_bytes()
    rng = np.random.default_rng(seed)
    start = good.rindex(b"GCOL") + 4096
    for _ in range(4):
        data = bytearray(good)
        for at in rng.integers(start, len(data), 40):
            data[at] = rng.integers(256)
        (tmp_path / "x.h5").write_bytes(data)
        assert all(str(p).isprintable() for p in validate(tmp_path / "x.h5", truths.rooms))


ROW = 5


def test_truth_beside_the_submission_comes_first(truths, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path)
    path = good_rooms(tmp_path / "here", truths.rooms)
    with h5py.File(path, "r+") as file:
        file.attrs["truth_path"] = "data/rooms.h5"
    with open_predictions("here/predictions.h5") as found:
        places = [Path("here/data/rooms.h5"), Path("data/rooms.h5")]
        for place in (*places[::-1], None):
            if place is not None:
                place.parent.mkdir()
                place.touch()
                assert find_truth(found) == FoundTruth(place, "submission")
        for place in places:
            place.unlink()
        with pytest.raises(FileFormatError) as caught:
            find_truth(found)
        assert all(str(place) in caught.value.found for place in places)
        assert "--truth" in caught.value.hint


def test_only_a_truth_of_a_strangers_choice_is_tried_in_another_process(
    truths, tmp_path, monkeypatch
):
    with (
        open_predictions(good_rooms(tmp_path, truths.rooms)) as rooms,
        open_predictions(good_answers(tmp_path, truths.iqtt)) as answers,
    ):
        tried = []
        monkeypatch.setattr("scenegen.files.trial.try_file", tried.append)
        find_truth(rooms, truths.rooms)
        assert tried == []
        places = [find_truth(predictions).path for predictions in (rooms, answers)]
    assert tried == places == [truths.rooms, truths.iqtt.with_name("iqtt-test-answers.h5")]


def test_answers_beside_the_test_file_are_the_truth(truths, tmp_path):
    with open_predictions(good_answers(tmp_path, truths.iqtt)) as found:
        expected = truths.iqtt.with_name("iqtt-test-answers.h5")
        for given in (None, truths.iqtt, expected):
            assert find_truth(found, given).path == expected
        val = truths.iqtt.with_name("iqtt-val.h5")
        assert find_truth(found, val).path == val


@pytest.mark.parametrize("path", ["x" * 5000, "~/rooms.h5", ".", "/", "/dev/zero", "pipe", "link"])
def test_nothing_but_a_regular_file_is_a_truth(truths, tmp_path, path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    path = edited(attribute("truth_path", path))(tmp_path, truths.rooms)
    with open_predictions(path) as found, refused(FileFormatError, ": truth"):
        find_truth(found)


FOV, CAMERA = "camera/fov_y_degrees", "camera/world_from_camera"
SPOILED = [
    *(("depth", put("depth", (ROW, 0, 0), v)) for v in (np.inf, np.nan, 0.0)),
    ("depth", put("object_id", (ROW, 0, 0), -1)),
    ("depth", damaged_chunk("depth", ROW)),
    *(("normal", put("normal", (ROW, 0, 0), v)) for v in (np.nan, 3e38, (0, 0, 1.01))),
    ("object_id", in_all(put("depth", ROW, np.nan), put("object_id", ROW, -1))),
    *((FOV, put(FOV, ROW, v)) for v in (0.0, 180.0, np.nan)),
    (CAMERA, put(CAMERA, (ROW, 0, 3), np.nan)),
    (CAMERA, put(CAMERA, (ROW, 0, 0), 1e300)),
    (CAMERA, put(CAMERA, (ROW, 3, 3), 2.0)),
    (CAMERA, values(CAMERA, lambda v: v * np.diag([1.001, 1.001, 1.001, 1.0]).sum(0))),
    (CAMERA, values(CAMERA, lambda v: v * np.array([-1, 1, 1, 1]))),  # turns space inside out
]


@pytest.mark.parametrize(("name", "spoil"), SPOILED)
def test_a_truth_that_is_none_is_refused_with_its_place(name, spoil, truths, tmp_path):
    truth = tmp_path / "truth.h5"
    shutil.copy(truths.rooms, truth)
    with RoomsFile(truth) as rooms:
        assert read_true_view(rooms, ROW).mask.any()
    with h5py.File(truth, "r+") as file:
        spoil(file)
    with RoomsFile(truth) as rooms, pytest.raises(FileFormatError) as caught:
        read_true_view(rooms, ROW)
    assert caught.value.where.startswith(f"{truth}: {name}, row {ROW}")
    (problem,) = validate(good_rooms(tmp_path, truths.rooms), truth)
    assert problem.dataset == "truth"
    assert f"{truth}: {name}, row " in problem.found

"""Where the truth of a submission lies, who says so, and what a truth must be to be scored."""

import os
import shutil
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


def test_truth_as_given(truths, tmp_path):
    with open_predictions(good_rooms(tmp_path, truths.rooms)) as found:
        assert find_truth(found) == FoundTruth(truths.rooms, "submission")
        assert find_truth(found, truths.iqtt) == FoundTruth(truths.iqtt, "given")
        with refused(FileFormatError, ": truth", found=str(tmp_path)):
            find_truth(found, tmp_path)


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
    *(("depth", put("depth", (ROW, 0, 0), v)) for v in (np.inf, -np.inf, np.nan, 0.0, -1.0)),
    ("depth", put("object_id", (ROW, 0, 0), -1)),
    ("depth", damaged_chunk("depth", ROW)),
    *(("normal", put("normal", (ROW, 0, 0), v)) for v in (np.nan, np.inf, 3e38, 0.0, (0, 0, 1.01))),
    ("object_id", in_all(put("depth", ROW, np.nan), put("object_id", ROW, -1))),
    *((FOV, put(FOV, ROW, v)) for v in (0.0, -20.0, 180.0, np.nan, np.inf)),
    *((CAMERA, put(CAMERA, (ROW, 0, 3), v)) for v in (np.nan, np.inf)),
    *((CAMERA, put(CAMERA, (ROW, 0, 0), v)) for v in (np.nan, 1e300, 0.0)),
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


def test_pixels_without_a_surface_are_not_scored(truths, tmp_path):
    truth = tmp_path / "truth.h5"
    shutil.copy(truths.rooms, truth)
    with h5py.File(truth, "r+") as file:
        in_all(put("depth", (ROW, 0), np.nan), put("object_id", (ROW, 0), -1))(file)
    with RoomsFile(truth) as rooms:
        mask = read_true_view(rooms, ROW).mask
    assert not mask[0].any()
    assert mask[1:].all()

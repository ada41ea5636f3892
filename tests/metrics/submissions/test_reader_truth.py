"""Where the truth of a submission is looked for, and that it is told where it was not found."""

from pathlib import Path

import h5py
import pytest
from submissions import edited, good_answers, good_rooms

from metrics.submissions.reader import find_truth, open_predictions
from scenegen.common.errors import FileFormatError


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
                assert find_truth(found) == place
        for place in places:
            place.unlink()
        with pytest.raises(FileFormatError) as error:
            find_truth(found)
        assert all(str(place) in str(error.value) for place in places)
        assert "--truth" in str(error.value)


def test_truth_as_given(truths, tmp_path):
    with open_predictions(good_rooms(tmp_path, truths.rooms)) as found:
        assert find_truth(found) == truths.rooms
        assert find_truth(found, truths.iqtt) == truths.iqtt
        with pytest.raises(FileFormatError, match=r"truth not found: looked for .*none\.h5$"):
            find_truth(found, tmp_path / "none.h5")
        with pytest.raises(FileFormatError, match="truth not found"):
            find_truth(found, tmp_path)


def test_answers_beside_the_test_file_are_the_truth(truths, tmp_path):
    with open_predictions(good_answers(tmp_path, truths.iqtt)) as found:
        expected = truths.iqtt.with_name("iqtt-test-answers.h5")
        assert find_truth(found) == expected
        assert find_truth(found, truths.iqtt) == expected
        assert find_truth(found, expected) == expected
        val = truths.iqtt.with_name("iqtt-val.h5")
        assert find_truth(found, val) == val


@pytest.mark.parametrize("path", ["x" * 5000, "~/rooms.h5", ".", "/"])
def test_a_strange_path_is_not_found(truths, tmp_path, path):
    def edit(file):
        file.attrs["truth_path"] = path

    with (
        open_predictions(edited(edit)(tmp_path, truths.rooms)) as found,
        pytest.raises(FileFormatError, match="truth not found"),
    ):
        find_truth(found)

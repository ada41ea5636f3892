"""Rooms that are handed out without truth: what they hold, and how their predictions are scored."""

import h5py
import numpy as np
import pytest
from refusals import refused

from baselines.trivial import write_room_baseline
from metrics.scoring.evaluate import score
from metrics.scoring.runs import ScoringError
from metrics.submissions.validation import validate
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rooms.reader import INPUT, RoomsFile
from scenegen.rooms.withheld import truth_beside, truth_path, withhold_truth


@pytest.fixture
def handed_out(make_rooms, tmp_path):
    """Rooms without truth; the truth lies beside them."""
    path = tmp_path / "rooms.h5"
    withhold_truth(make_rooms(truth_path(path), 3, views=(0.0, 80.0), seed=77_123), path)
    return path


def test_the_file_holds_images_and_cameras_and_not_how_they_were_made(handed_out):
    names = set()
    with h5py.File(handed_out) as file:
        file.visititems(lambda name, item: names.add(name) if hasattr(item, "dtype") else None)
        texts = [str(value) for value in file.attrs.values()]
    assert names == set(INPUT)
    assert not any("77123" in text or "scenegen render" in text for text in texts)
    with RoomsFile(handed_out) as rooms, RoomsFile(truth_path(handed_out)) as truth:
        assert (rooms.has_truth, truth.has_truth) == (False, True)
        assert rooms.fingerprint == truth.fingerprint
        assert set(rooms.fields) == set(INPUT)
        for name in INPUT:
            assert np.array_equal(rooms.read(name, slice(None)), truth.read(name, slice(None)))
        with refused(FileFormatError, f"{handed_out}: depth"):
            rooms.read("depth", 0)
        with refused(SpecError, "field"):
            rooms.read("albedo", 0)


def test_predictions_of_it_are_scored_with_either_name_of_the_truth(handed_out, tmp_path):
    truth, path = truth_path(handed_out), tmp_path / "p.h5"
    write_room_baseline("picture-outline", handed_out, path)
    assert truth_beside(handed_out) == truth
    assert truth_beside(truth) is None
    by_truth, by_input = (score([path], place) for place in (truth, handed_out))
    assert by_truth.items["chamfer"].tolist() == by_input.items["chamfer"].tolist()
    assert by_input.comparable
    assert validate(path, handed_out) == []
    moved = truth.rename(tmp_path / "elsewhere.h5")
    with refused(ScoringError, f"{path}: truth"):
        score([path], handed_out)
    assert not validate(path, handed_out)[0].is_hint
    assert score([path], moved).comparable


def test_a_file_without_truth_passes_until_an_image_changes(handed_out, verdict):
    code, checks, _ = verdict(handed_out)
    assert (code, checks["content"], set(checks.values())) == (0, "ok", {"ok"})
    with h5py.File(handed_out, "r+") as file:
        file["image"][0, 0, 0] += 1
    code, checks, _ = verdict(handed_out)
    assert (code, checks["content"]) == (1, "FAIL")


def test_what_cannot_be_withheld_is_refused(handed_out, tmp_path):
    with refused(FileFormatError, str(handed_out)):
        withhold_truth(handed_out, tmp_path / "again.h5")
    assert not (tmp_path / "again.h5").exists()

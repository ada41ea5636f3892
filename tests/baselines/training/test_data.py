"""Files to learn from: one kind of them, each opened once; several are one set of rows."""

import pytest
import torch
from pix2shape_models import in_memory
from refusals import refused

from baselines.training.data import TrainingFiles, only, requests
from baselines.training.rooms import read_rooms
from scenegen.common.errors import FileFormatError, SpecError


def test_rooms_do_not_mix_with_questions(rooms_path, train_questions, tmp_path):
    with TrainingFiles(rooms_path) as rooms, TrainingFiles(train_questions) as questions:
        assert (rooms.hold_questions, questions.hold_questions) == (False, True)
        with pytest.raises(FileFormatError):
            rooms.questions("labeled")
        with pytest.raises(FileFormatError):
            questions.rooms()
    with refused(SpecError, str(train_questions), "questions", "rooms"):
        TrainingFiles(rooms_path, train_questions)
    with pytest.raises(FileNotFoundError):
        TrainingFiles(rooms_path, tmp_path / "none.h5")


def test_several_files_are_one_set_of_rows_and_a_card_lists_them(turned_path, make_rooms, tmp_path):
    """Scenes of different files have different numbers."""
    other = make_rooms(tmp_path / "b.h5", 2, seed=9, views=(0.0, 10.0), min_visible_pixels=2)
    parts = [in_memory(path, 32, depth=True) for path in (turned_path, other)]
    with TrainingFiles(turned_path, other) as data:
        files = data.rooms()
        together, told = read_rooms(files, 32, depth=True), requests(files)
        with refused(SpecError, "data", "2 files"):
            only(files, "ptn")
        assert only(files[:1], "ptn") is files[0]
    assert len(together) == 9 + 4
    for name in ("image", "world_from_camera", "angle", "depth", "inside"):
        expected = torch.cat([getattr(part, name) for part in parts])
        torch.testing.assert_close(
            getattr(together, name), expected, rtol=0, atol=0, equal_nan=True
        )
    assert together.scene.tolist() == [*parts[0].scene.tolist(), 3, 3, 4, 4]
    marks = f"{parts[0].fingerprint} {parts[1].fingerprint}"
    assert told["fingerprint"] == together.fingerprint == marks
    assert told["data"].split("\n") == [file.spec.to_json() for file in files]

"""Baselines of the truth are computed once, and never taken from a damaged entry."""

import numpy as np
import pytest

from baselines.trivial import write_room_baseline
from metrics.scoring import kept_baselines
from metrics.scoring.evaluate import score
from metrics.scoring.images import image_scores
from metrics.scoring.runs import Settings


@pytest.fixture
def scored(room_baseline, tmp_path, monkeypatch):
    truth, submission = room_baseline
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def run():
        return score([submission], truth, Settings(processes=1)).columns

    return run, tmp_path / "pix2shape-bench" / "baselines"


@pytest.fixture(scope="module")
def room_baseline(make_rooms, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept")
    truth = make_rooms(folder / "rooms.h5", 3, height=32, width=32)
    write_room_baseline("empty-room", truth, folder / "empty.h5")
    return truth, folder / "empty.h5"


def same(a, b):
    assert a.keys() == b.keys()
    assert all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)


def test_a_second_submission_computes_none(scored, monkeypatch):
    run, folder = scored
    first = run()
    assert len([*folder.iterdir()]) == 3
    with monkeypatch.context() as patch:
        patch.setattr(image_scores, "_floors", None)
        same(run(), first)
        patch.setattr(kept_baselines, "_program", lambda: b"another release")
        with pytest.raises(TypeError):
            run()


@pytest.mark.parametrize("damage", ["flip", "cut", "folder"])
def test_what_is_damaged_is_made_again(scored, damage):
    run, folder = scored
    if damage == "folder":
        folder.parent.mkdir()
        folder.write_text("in its place")
        same(run(), run())
        return
    first = run()
    for entry in folder.iterdir():
        data = bytearray(entry.read_bytes())
        data[-9] ^= 255
        entry.write_bytes(data if damage == "flip" else data[: len(data) // 2])
    same(run(), first)

"""`scenegen view` as a user types it."""

import pytest

pytest.importorskip("rerun")

from recordings import recorded


def test_a_recording_is_named_after_the_file(run, rooms_path, tmp_path):
    assert run("view", rooms_path, "--items", "2-4").exit_code == 0
    assert sorted(recorded(tmp_path / "rooms.rrd", "scene")["/about"]) == [2, 3, 4]


def test_mistakes(refuses, rooms_path, tmp_path):
    (tmp_path / "no.h5").write_text("nothing")
    (tmp_path / "old.rrd").write_text("mine")
    refuses("view", rooms_path, "--items", "3,8", words=("--items", "8", "0 to 7"))
    refuses("view", rooms_path, "--out", tmp_path / "old.rrd", words=("old.rrd", "--overwrite"))
    refuses("view", rooms_path, "--out", rooms_path, words=("rooms.h5", "input"))
    refuses("view", tmp_path / "no.h5", words=("no.h5",))
    refuses("view", tmp_path / "none.h5", words=("none.h5",))

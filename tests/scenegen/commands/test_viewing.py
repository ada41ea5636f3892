"""`scenegen view` as a user types it."""

import pytest

pytest.importorskip("rerun")

from recordings import recorded


def test_a_recording_is_named_after_the_file(run, rooms_path, tmp_path):
    assert run("view", rooms_path, "--items", "2-4").exit_code == 0
    assert sorted(recorded(tmp_path / "rooms.rrd", "scene")["/about"]) == [2, 3, 4]

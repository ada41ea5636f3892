"""A second run is refused while the first one goes on, and a killed run holds nobody up."""

import errno
import os
import signal
import subprocess
import sys

import pytest

from scenegen.common.errors import SceneGenError
from scenegen.files.sets import workspace as module
from scenegen.files.sets.workspace import run_lock

HOLD = """
import os, sys, time
from pathlib import Path
from scenegen.files.sets.workspace import run_lock
with run_lock(Path(sys.argv[1]), Path("set")):
    if os.fork() == 0:  # a reader of data, say, that outlives the run
        print("held", flush=True)
    time.sleep(60)
    os._exit(0)
"""


def test_a_second_run_is_refused_until_the_first_ends(tmp_path):
    lock = tmp_path / ".lock"
    with run_lock(lock, tmp_path / "set"):
        with (
            pytest.raises(SceneGenError) as refused,
            run_lock(lock, tmp_path / "set", "come again"),
        ):
            pass
        assert str(tmp_path / "set") in refused.value.where
        assert refused.value.hint == "come again"
        assert lock.exists()
    assert not lock.exists()
    with run_lock(lock, tmp_path / "set"):
        pass


def test_a_killed_run_holds_nobody_up(tmp_path):
    lock = tmp_path / ".lock"
    command = [sys.executable, "-c", HOLD, lock]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    assert run.stdout is not None
    with run, run.stdout:
        assert run.stdout.readline() == "held\n"
        with pytest.raises(SceneGenError), run_lock(lock, tmp_path / "set"):
            pass
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
        assert lock.exists()
        with run_lock(lock, tmp_path / "set"):
            pass
        os.killpg(run.pid, signal.SIGKILL)


def test_disks_without_locks_lock_nothing(tmp_path, monkeypatch):
    if module.fcntl is None:
        pytest.skip("no locks here at all")

    def refuses(*_: object) -> None:
        raise OSError(errno.ENOTSUP, "no locks")

    monkeypatch.setattr(module.fcntl, "lockf", refuses)
    with run_lock(tmp_path / ".lock", tmp_path / "set"):
        pass

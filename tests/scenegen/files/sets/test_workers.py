"""Worker processes after the process that started them: killed, or stopped by Ctrl-C."""

import errno
import functools
import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from unittest.mock import Mock

import pytest

from scenegen.common.errors import SceneGenError
from scenegen.files import pool
from scenegen.files.pool import LostWorkerError
from scenegen.files.sets.workers import in_processes

BUSY = """
import sys, time
from scenegen.files.pool import worker_pool
try:
    with worker_pool(2, time.sleep) as pool:
        tasks = [pool.submit(seconds) for seconds in (float(sys.argv[1]), 0.1)]
        tasks[1].result()  # one process is busy now, and the other waits
        time.sleep(0.3)
        print("busy", flush=True)
        [task.result() for task in tasks]
except KeyboardInterrupt:
    print("stopped")
"""


def start(seconds: float) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", BUSY, str(seconds)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout.readline() == "busy\n"
    return process


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
def test_no_worker_outlives_a_process_that_is_killed():
    """Were one left, it would hold standard output open, and reading it would not end."""
    process = start(1000)
    process.kill()
    out, err = process.communicate(timeout=20)
    assert out == ""
    assert "Traceback" not in err


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
def test_ctrl_c_is_left_to_the_process_that_started_them():
    process = start(1)
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=20) == ("stopped\n", "")


def test_warnings_of_a_process_are_given_here():
    with pytest.warns(RuntimeWarning, match="strange"):
        assert len(list(in_processes(_strange, [1, 2], 2))) == 2


def _strange(task):
    warnings.warn("strange", RuntimeWarning, stacklevel=1)
    return task


def test_a_process_that_ends_by_itself_is_told():
    with pytest.raises(LostWorkerError) as lost:
        list(in_processes(os._exit, [1, 2, 3], 2))
    assert (lost.value.found.startswith("exit code"), lost.value.hint) == (True, "")


def _dies_by(folder, number, dying, task):
    """Return the square; a signal ends the process at 3, at the first try or at each."""
    if task == 3 and (dying == "always" or not (folder / "tried").exists()):
        (folder / "tried").touch()
        os.kill(os.getpid(), number)
    return task * task


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGSEGV, marks=pytest.mark.slow), signal.SIGKILL]
)
def test_a_task_whose_process_a_signal_ended_is_done_again_once(tmp_path, number):
    for dying in ("once", "always"):
        results = in_processes(
            functools.partial(_dies_by, tmp_path, number, dying), range(8), 2, "square {}".format
        )
        if dying == "once":
            assert list(results) == [task * task for task in range(8)]
            continue
        with pytest.raises(LostWorkerError) as lost:
            list(results)
    assert lost.value.where.startswith("square 3:")
    assert lost.value.found == f"signal {number:d}, {number.name}"
    assert ("memory" in lost.value.hint) == (number == signal.SIGKILL)


def _alone(folder, task):
    """Return how many tasks are being done; the process of task 1 dies once."""
    if task == 1 and not (folder / "tried").exists():
        (folder / "tried").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    mine = folder / f"running-{task}"
    mine.touch()
    time.sleep(0.3)
    running = len(list(folder.glob("running-*")))
    mine.unlink()
    return running


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
def test_what_is_done_again_is_done_alone(tmp_path):
    running = list(in_processes(functools.partial(_alone, tmp_path), range(9), 3))
    assert running[1] == 1


def test_where_no_processes_are_to_be_had_workers_are_named(monkeypatch):
    """As where no memory is left; the output is not blamed."""
    monkeypatch.setattr(pool.subprocess, "Popen", Mock(side_effect=OSError(errno.ENOMEM, "No")))
    with pytest.raises(SceneGenError) as refused:
        list(in_processes(abs, [1], 2))
    assert "--workers" in refused.value.hint


def test_a_process_that_cannot_begin_is_no_fault_of_a_task(monkeypatch):
    monkeypatch.setattr(pool.sys, "executable", "/bin/false")
    with pytest.raises(SceneGenError) as refused:
        list(in_processes(abs, [1], 2))
    assert not isinstance(refused.value, LostWorkerError)


class Unreadable(Exception):
    def __init__(self, one, two):
        super().__init__(one)


def _awkward(task):
    raise Unreadable("a", lambda: "b") if task else SystemExit(3)


def test_errors_that_cannot_be_passed_on():
    with pytest.raises(TypeError):
        list(in_processes(_awkward, [1], 1))
    with pytest.raises(LostWorkerError) as lost:
        list(in_processes(_awkward, [0], 1))
    assert lost.value.found == "exit code 3"


def test_a_pool_goes_on_after_a_process_ended():
    with pool.worker_pool(1, _strange_end) as workers:
        ends = [workers.submit(task).exception() for task in (0, 1, 0)]
    assert [end is None for end in ends] == [True, False, True]


def _strange_end(task):
    if task:
        os._exit(0)


SCRIPT = """
import sys
print("once")
import pathlib
pathlib.Path("ran").open("a").write("x")
from scenegen.files.sets.workers import in_processes
print(list(in_processes(abs, [-1, 2, -3], 2)))
"""


@pytest.mark.parametrize(
    "how",
    [
        *("stdin", "thread"),
        *(pytest.param(how, marks=pytest.mark.slow) for how in ("script", "module", "inside")),
    ],
)
def test_a_script_without_a_guard_runs_once(how, tmp_path):
    """Nothing of the main module is needed, whatever that is."""
    text = SCRIPT
    if how == "thread":
        lines = "".join(f"  {line}\n" for line in SCRIPT.strip().splitlines())
        text = f"import threading\ndef go():\n{lines}t = threading.Thread(target=go)\n"
        text += "t.start()\nt.join()\n"
    (tmp_path / "plain.py").write_text(text)
    (tmp_path / "outer.py").write_text("import runpy\nrunpy.run_path('plain.py')\n")
    (tmp_path / "scenegen").mkdir()  # of the user's own, without what is needed
    words = {"stdin": ["-"], "module": ["-m", "plain"], "inside": ["outer.py"]}
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[4])}
    done = subprocess.run(
        [sys.executable, *words.get(how, ["plain.py"])], input=text, cwd=tmp_path, timeout=120,
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("once\n[1, 2, 3]\n", "")
    assert (tmp_path / "ran").read_text() == "x"

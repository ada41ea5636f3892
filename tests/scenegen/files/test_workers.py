"""Worker processes after the process that started them: killed, or stopped by Ctrl-C."""

import errno
import functools
import math
import os
import signal
import subprocess
import sys
import warnings
from unittest.mock import Mock

import pytest

from scenegen.common.errors import SceneGenError
from scenegen.files import workers
from scenegen.files.workers import in_order, in_processes, in_threads

BUSY = """
import sys, time
from scenegen.files.workers import worker_pool
try:
    with worker_pool(2) as pool:
        tasks = [pool.submit(time.sleep, seconds) for seconds in (float(sys.argv[1]), 0.1)]
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


def test_results_come_in_order_from_both_kinds_of_workers():
    tasks = [9, 1, 5, 3, 7, 2]
    assert list(in_threads(abs, tasks, 3, 2)) == tasks
    assert list(in_processes(abs, iter(tasks), 2)) == tasks


def _counted(task):
    yield from range(task)
    return task


@pytest.mark.parametrize("workers", [1, 2])
def test_what_a_generator_yields_and_returns_comes_in_order(workers):
    ends = []
    assert list(in_order(_counted, [2, 0, 3], workers, ends.append)) == [0, 1, 0, 1, 2]
    assert ends == [2, 0, 3]


@pytest.mark.parametrize("run", [in_processes, functools.partial(in_threads, ahead=1)])
def test_errors_are_those_of_the_function(run):
    with pytest.raises(ValueError, match="domain"):
        list(run(math.sqrt, [4.0, -1.0, 9.0], count=2))


def test_few_tasks_are_begun_ahead():
    begun = []
    results = in_threads(abs, (begun.append(i) or i for i in range(100)), 2, 5)
    assert next(results) == 0
    assert len(begun) <= 7
    results.close()


def test_warnings_of_a_process_are_given_here():
    with pytest.warns(RuntimeWarning, match="strange"):
        assert len(list(in_processes(_strange, [1, 2], 2))) == 2


def _strange(task):
    warnings.warn("strange", RuntimeWarning, stacklevel=1)
    return task


def test_a_process_that_ends_by_itself_is_told():
    with pytest.raises(SceneGenError) as refused:
        list(in_processes(os._exit, [1, 2, 3], 2))
    assert "worker process" in refused.value.where


def test_processors_are_those_of_the_cgroup(tmp_path):
    """Version 2 with a limit above and none here; version 1; a limit that is no number."""
    cgroup, root = tmp_path / "cgroup", tmp_path / "fs"
    for line, file, text, limit in [
        ("0::/pod/box", "pod/cpu.max", "150000 100000", 1.5),
        ("0::/pod/box", "pod/box/cpu.max", "max 100000", 1.5),
        ("0::/", "cpu.max", "50000 100000", 0.5),
        ("4:memory:/x\n3:cpu,cpuacct:/box", "cpu/box/cpu.cfs_quota_us", "300000", math.inf),
        ("4:memory:/x\n3:cpu,cpuacct:/box", "cpu/box/cpu.cfs_period_us", "100000", 3.0),
        ("3:cpu:/", "cpu/cpu.cfs_quota_us", "-1", math.inf),
    ]:
        cgroup.write_text(line + "\n")
        (root / file).parent.mkdir(parents=True, exist_ok=True)
        (root / file).write_text(text + "\n")
        assert workers._cgroup_processors(root, str(cgroup)) == limit
    assert workers._cgroup_processors(root, str(tmp_path / "none")) == math.inf
    assert 1 <= workers.processors() <= os.cpu_count()


@pytest.mark.parametrize("error", [OSError(errno.EROFS, "Read-only"), NotImplementedError("few")])
def test_where_no_processes_are_to_be_had_workers_are_named(monkeypatch, error):
    """As where /dev/shm cannot be written to; the output is not blamed."""
    monkeypatch.setattr(workers, "ProcessPoolExecutor", Mock(side_effect=error))
    with pytest.raises(SceneGenError) as refused:
        list(workers.in_processes(abs, [1], 2))
    assert "--workers" in refused.value.hint

"""Worker processes after the process that started them: killed, or stopped by Ctrl-C."""

import os
import signal
import subprocess
import sys

import pytest

BUSY = """
import sys, time
from scenegen.common.worker_pool import worker_pool
try:
    with worker_pool(2) as pool:
        tasks = [pool.submit(time.sleep, seconds) for seconds in (float(sys.argv[1]), 1)]
        tasks[1].result()  # one process is busy now, and the other waits
        time.sleep(1)
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
    process = start(3)
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=20) == ("stopped\n", "")

"""Commands that are told to stop: they clean up, and say by which signal they ended."""

import signal
import subprocess
import sys
import time

import pytest

RENDER = ("render", "--size", "32", "--min-visible-pixels", "3", "--n", "10000", "--out", "x.h5")
BLOCK = """
import signal, sys, time
from scenegen.common.signals import ended_by_signals
{before}
with ended_by_signals():
    try:
        print("begun", flush=True)
        time.sleep(20)
    finally:
        print("cleaned up", flush=True)
        {cleaning}
"""
CASES = {
    "terminated": ("", "", [signal.SIGTERM], 143, "cleaned up\n"),
    "hung up": ("", "", [signal.SIGHUP], 129, "cleaned up\n"),
    "under nohup": (
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)", "",
        [signal.SIGHUP, signal.SIGTERM], 143, "cleaned up\n",
    ),
    "twice": ("", "time.sleep(20)", [signal.SIGTERM, signal.SIGHUP], -1, "cleaned up\n"),
    "by others": (
        "signal.signal(signal.SIGTERM, lambda *_: sys.exit(7))", "",
        [signal.SIGTERM], 7, "cleaned up\n",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("before", "cleaning", "signals", "code", "out"), CASES.values(), ids=CASES
)
def test_a_block_ends_as_told(before, cleaning, signals, code, out):
    program = BLOCK.format(before=before, cleaning=cleaning)
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begun\n"
    for number in signals:
        process.send_signal(number)
        time.sleep(0.3)
    assert process.communicate(timeout=15)[0] == out
    assert process.returncode == code


def test_a_render_that_is_terminated_leaves_nothing(tmp_path):
    command = [sys.executable, "-c", "import cli; cli.scenegen()", *RENDER]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not any(path.stat().st_size > 100_000 for path in tmp_path.rglob("*.h5")):
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < end
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    err = process.communicate(timeout=60)[1]
    assert process.returncode == 143
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []

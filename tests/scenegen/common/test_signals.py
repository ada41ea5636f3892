"""Commands that are told to stop: they clean up, and say by which signal they ended."""

import signal
import subprocess
import sys
import time

import pytest

from scenegen.common.signals import held_back

DEAF = """
import os, signal, time
from scenegen.common.signals import ended_by_signals
class Deaf:
    def __del__(self):
        os.kill(os.getpid(), signal.{name})
        time.sleep(0.1)
with ended_by_signals():
    try:
        deaf = Deaf()
        del deaf
        time.sleep(20)
        print("it went on")
    except KeyboardInterrupt:
        print("cleaned up")
        raise SystemExit(3) from None
"""
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
        time.sleep(0.1)
    assert process.communicate(timeout=15)[0] == out
    assert process.returncode == code


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGINT", 3)])
def test_a_signal_is_not_lost_where_python_ignores_what_is_raised(name, code):
    """As in a destructor, in which a signal often comes."""
    command = [sys.executable, "-c", DEAF.format(name=name)]
    start = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (code, "cleaned up\n", "")
    assert time.monotonic() - start < 10


def test_signals_wait_until_the_block_has_ended():
    def block():
        with held_back():
            signal.raise_signal(signal.SIGINT)
            with held_back():  # the outer block decides
                signal.raise_signal(signal.SIGINT)
            done.append(1)

    done = []
    with pytest.raises(KeyboardInterrupt):
        block()
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_signals_that_wait_come_to_whoever_answers_them():
    def block():
        with held_back():
            signal.raise_signal(signal.SIGTERM)
            assert seen == []
            raise OSError("as it is")

    seen, before = [], signal.signal(signal.SIGTERM, lambda number, _: seen.append(number))
    try:
        with pytest.raises(OSError, match="as it is"):
            block()
        assert seen == [signal.SIGTERM]
    finally:
        signal.signal(signal.SIGTERM, before)

"""Signals that end a command, so that it leaves nothing half done."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)
)  # Windows has no SIGHUP


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP interrupt the block as Ctrl-C does, and then exit with 128 + number.

    A second signal kills. Python sees a signal only when the library that is running returns, so
    that nothing but SIGKILL ends a process that hangs in one. A signal that is ignored, as under
    nohup, stays ignored. The process ends as the block does: the interpreter's own farewell may
    crash where threads of a library are still at work.
    """
    received: list[int] = []

    def end(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        for own in before:
            signal.signal(own, signal.SIG_DFL)
        raise KeyboardInterrupt

    main = threading.current_thread() is threading.main_thread()
    before = [n for n in ENDING if main and signal.getsignal(n) is signal.SIG_DFL]
    for number in before:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in before:
            signal.signal(number, signal.SIG_DFL)
        if received:
            os._exit(128 + received[0])


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Let the processes and threads that the block starts never see Ctrl-C.

    A terminal sends it to all processes, of which only the first one should answer.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

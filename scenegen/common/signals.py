"""Signals that end a command, so that it leaves nothing half done."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

ENDING = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)
)  # Windows has no SIGHUP
INTERRUPTING = (signal.SIGINT, *ENDING, *([signal.SIGALRM] if hasattr(signal, "SIGALRM") else []))
MOMENT = 0.01  # seconds


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
        with _raised_again():
            yield
    finally:
        for number in before:
            signal.signal(number, signal.SIG_DFL)
        if received:
            for stream in (sys.stdout, sys.stderr):  # as what they hold would be lost
                with suppress(OSError, ValueError, AttributeError):  # full, closed or none
                    stream.flush()
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


@contextmanager
def _raised_again() -> Iterator[None]:
    """Raise a KeyboardInterrupt of the block again, a moment later, where Python has ignored it.

    Python prints and ignores whatever is raised in a destructor or in the callback of a weak
    reference. A signal often comes there, and the command would go on as if there had been none.
    """
    main = threading.current_thread() is threading.main_thread()
    alarm = getattr(signal, "SIGALRM", None)  # Windows has none
    if not main or alarm is None or signal.getsignal(alarm) is not signal.SIG_DFL:
        yield
        return

    def raise_again(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    def ignored(what: Any) -> None:
        if issubclass(what.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, MOMENT)
        else:
            tell(what)

    tell, sys.unraisablehook = sys.unraisablehook, ignored
    signal.signal(alarm, raise_again)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(alarm, signal.SIG_DFL)
        sys.unraisablehook = tell


@contextmanager
def held_back() -> Iterator[None]:
    """Let signals that Python answers, such as Ctrl-C, wait until the block has ended.

    Other threads than the main one see no signals. A signal that kills at once still does.
    """
    waiting: list[int] = []
    holding = threading.current_thread() is threading.main_thread()

    def wait(number: int, frame: FrameType | None) -> None:
        if holding:
            waiting.append(number)
        else:  # it comes while the handlers of before are being put back
            before[number](number, frame)

    found = {n: signal.getsignal(n) for n in INTERRUPTING} if holding else {}
    before = {number: handler for number, handler in found.items() if callable(handler)}
    try:
        for number in before:
            signal.signal(number, wait)
        yield
    finally:
        holding = False
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in waiting:
            before[number](number, None)

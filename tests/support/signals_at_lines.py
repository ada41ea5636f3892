"""A signal before each line of some code that runs, one after the other."""

import signal
import sys
from collections.abc import Callable, Iterator
from types import FrameType, ModuleType
from typing import Any


def interrupted_at_each_line(
    run: Callable[[], Any], modules: tuple[ModuleType, ...], number: int
) -> Iterator[int]:
    """Call `run` again and again, and interrupt it before the next line of the modules each time.

    The signal raises a KeyboardInterrupt, as Ctrl-C does. Yields the number of the line after each
    call; ends when `run` has come to its end.
    """
    files = [module.__file__ for module in modules]
    seen = 0

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    def trace(frame: FrameType, event: str, _argument: Any) -> Any:
        nonlocal seen
        if frame.f_code.co_filename not in files:
            return None
        if event == "line":
            seen += 1
            if seen == at:
                signal.raise_signal(number)
        return trace

    before, tracing = signal.signal(number, interrupt), sys.gettrace()
    try:
        at = 0
        while seen >= at:
            at, seen = at + 1, 0
            sys.settrace(trace)
            try:
                run()
            except KeyboardInterrupt:
                sys.settrace(tracing)
                yield at
            finally:
                sys.settrace(tracing)
    finally:
        signal.signal(number, before)

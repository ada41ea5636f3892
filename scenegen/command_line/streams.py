"""Standard streams that outlive their readers, and show control characters instead of sending them.

What a command prints holds names from other people's files, and goes to pipes that may close at any
time. Neither may hurt the terminal, or keep the command from writing its files. The streams escape
all control characters but ends of lines and tabs; what must stay one line, such as an error or a
row of a table, is made so before, by `text_table.printable`.
"""

import codecs
import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from typing import Any, TextIO

from scenegen.common.text_table import printable


@contextmanager
def robust_streams() -> Iterator[None]:
    """Let all that the block prints to the real standard streams go through streams of this module.

    Descriptors 0 to 2 are opened first where they are closed, so that no data file gets one.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free descriptor: this one
    before = sys.stdout, sys.stderr
    if sys.stdout is sys.__stdout__:
        sys.stdout = _Shown(1, sys.__stdout__, "standard output")
    if sys.stderr is sys.__stderr__:
        sys.stderr = _Shown(2, sys.__stderr__, "")
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        sys.stdout, sys.stderr = before


def for_progress_bars() -> Any:
    """Return standard error for a program that moves the cursor on purpose."""
    return sys.stderr.unfiltered() if isinstance(sys.stderr, _Shown) else sys.stderr


class _Shown(io.TextIOWrapper):
    """A stream of text that shows what a terminal would obey as escapes.

    Failure is told at most once; all that is written later is dropped. A reader that has gone is no
    failure of standard output. Nothing is one of standard error, whose `name` is empty.
    """

    def __init__(self, descriptor: int, like: TextIO | None, name: str) -> None:
        encoding = like.encoding if like else "utf-8"
        if codecs.lookup(encoding).name == "ascii":
            encoding = "utf-8"  # as click takes it
        # Not a class of our own: Ctrl-C could come after it has written and before it says so, and
        # the buffer would write the same a second time.
        raw = io.FileIO(descriptor, "w", closefd=False)
        buffer = io.BufferedWriter(raw)
        super().__init__(buffer, encoding, "backslashreplace", line_buffering=raw.isatty())
        self.called = name

    def write(self, text: str) -> int:
        # What is no text is left to the class above to refuse; click tries.
        return self._write(printable(text, keep="\n\t") if isinstance(text, str) else text)

    def flush(self) -> None:
        """Write what is held. Raises OSError with the stream's name as its file."""
        with self._told_once():
            super().flush()

    def unfiltered(self) -> Any:
        """Return an object that writes to the same place, with control characters as they are."""
        same = {name: getattr(self, name) for name in ("flush", "isatty", "fileno", "encoding")}
        return SimpleNamespace(write=self._write, **same)

    def _write(self, text: str) -> int:
        with self._told_once():
            super().write(text)
        return len(text)

    @contextmanager
    def _told_once(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if self.called and error.errno != errno.EPIPE:
                text = f"cannot be written: {error.strerror}"
                raise OSError(error.errno, text, self.called) from error

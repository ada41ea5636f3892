"""What the terminal can show: found in the environment, or by asking it."""

import os
import re
import select
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

try:
    import fcntl
    import termios
except ImportError:  # Windows
    fcntl = termios = None  # type: ignore[assignment]

PROTOCOLS = ("kitty", "sixel")
WHO_ARE_YOU = b"\x1b[c"  # "primary device attributes"; sixel is attribute 4
ANSWER = re.compile(rb"\x1b\[\?([0-9;]*)c")
PATIENCE = 0.4  # seconds; terminals that answer do so within some milliseconds, also over ssh
CELL = (10, 20)  # pixels of a character, where the terminal does not tell
SIZE = "HHHH"  # of a terminal: rows, columns, width and height in pixels


def protocol() -> str | None:
    """Return "kitty" or "sixel" where standard output is a terminal that shows pictures so.

    Programs that stand between, such as tmux, keep the variables of the terminal outside, but
    pass on nothing of kitty's protocol; so they are asked.
    """
    if termios is None or not sys.stdout.isatty() or os.environ.get("TERM", "dumb") == "dumb":
        return None
    if not within_another() and _is_like_kitty():
        return "kitty"
    return "sixel" if b"4" in _attributes() else None


def within_another() -> bool:
    """Return whether the terminal is drawn by a program in another one: tmux, screen or zellij."""
    term = os.environ.get("TERM", "")
    return term.startswith(("screen", "tmux")) or any(
        os.environ.get(name) for name in ("TMUX", "STY", "ZELLIJ")
    )


def width() -> int:
    """Return the width of the terminal at standard output in pixels, as far as it is known."""
    columns = pixels = 0
    with suppress(OSError, AttributeError):  # no terminal, or Windows
        told = fcntl.ioctl(sys.stdout.fileno(), termios.TIOCGWINSZ, bytes(struct.calcsize(SIZE)))
        _, columns, pixels, _ = struct.unpack(SIZE, told)
    return pixels or (columns or 80) * CELL[0]


def _is_like_kitty() -> bool:
    program, term = os.environ.get("TERM_PROGRAM", ""), os.environ.get("TERM", "")
    return (
        program in ("ghostty", "WezTerm")
        or term in ("xterm-kitty", "xterm-ghostty")
        or (not program and bool(os.environ.get("KITTY_WINDOW_ID")))
    )


def _attributes() -> list[bytes]:
    """Ask the terminal who it is; return its attributes, none if it does not answer.

    It is not asked where keys that were pressed before wait to be read, as they would be lost, nor
    by a process in the background, which would be stopped.
    """
    try:
        terminal = os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY)
    except OSError:
        return []
    try:
        if os.tcgetpgrp(terminal) != os.getpgrp():
            return []
        with _without_echo(terminal):
            if select.select([terminal], [], [], 0)[0]:
                return []
            os.write(terminal, WHO_ARE_YOU)
            answer = _answer(terminal)
    except OSError:  # it has gone
        return []
    finally:
        os.close(terminal)
    return answer.split(b";")


def _answer(terminal: int) -> bytes:
    """Read no more than the answer, byte by byte."""
    heard, end = b"", time.monotonic() + PATIENCE
    while (left := end - time.monotonic()) > 0 and select.select([terminal], [], [], left)[0]:
        heard += os.read(terminal, 1)
        if told := ANSWER.search(heard):
            return told[1]
    return b""


@contextmanager
def _without_echo(terminal: int) -> Iterator[None]:
    """Let the block read what the terminal sends at once, unseen; Ctrl-C still interrupts."""
    before = termios.tcgetattr(terminal)
    quiet = [*before[:3], before[3] & ~(termios.ECHO | termios.ICANON), *before[4:]]
    try:
        termios.tcsetattr(terminal, termios.TCSANOW, quiet)
        yield
    finally:
        termios.tcsetattr(terminal, termios.TCSANOW, before)

"""Terminals that answer as a test says, and what they would draw: sixels and kitty's escapes, read
by code that shares nothing with what wrote them."""

import base64
import fcntl
import io
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from dataclasses import dataclass

import numpy as np
from PIL import Image

QUESTION = b"\x1b[c"
LONGEST = 60  # seconds; then a program is killed
WITH_SIXEL, WITHOUT_SIXEL = b"\x1b[?62;4;22c", b"\x1b[?1;2c"
ONE_OF_OURS = "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
EXEC = "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"


@dataclass
class Terminal:
    """What a program did in a terminal.

    Attributes:
        shown: all that it printed there, but for the questions.
        questions: how often it asked who the terminal is.
        unread: keys that were pressed and that it has not read.
        restored: whether it left the settings as they were.
        code: exit code.
        seconds: until it ended.
    """

    shown: str
    questions: int
    unread: bytes
    restored: bool
    code: int
    seconds: float


def in_terminal(arguments, answer=None, typed=b"", size=(24, 80, 0, 0), cwd=None, **environment):
    """Run Python with these arguments in a terminal that answers `answer`, or nothing."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", *size))
    before = termios.tcgetattr(theirs)
    if typed:
        os.write(ours, typed)
    kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH", "HOME") if name in os.environ}
    start = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-c", ONE_OF_OURS + EXEC, *arguments],
        stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True, cwd=cwd,
        env={**kept, "TERM": "xterm-256color", **environment},
    )  # fmt: skip
    shown, questions = b"", 0
    while process.poll() is None or select.select([ours], [], [], 0)[0]:
        if time.monotonic() - start > LONGEST:
            os.killpg(process.pid, signal.SIGKILL)
        if not select.select([ours], [], [], 0.02)[0]:
            continue
        shown += os.read(ours, 65536)
        asked = shown.count(QUESTION)
        if asked > questions and answer:
            os.write(ours, answer)
        questions = asked
    seconds, unread = time.monotonic() - start, b""
    restored = termios.tcgetattr(theirs) == before
    raw = [*before[:3], before[3] & ~(termios.ICANON | termios.ECHO), *before[4:]]
    termios.tcsetattr(theirs, termios.TCSANOW, raw)
    while select.select([theirs], [], [], 0)[0]:
        unread += os.read(theirs, 4096)
    for descriptor in (ours, theirs):
        os.close(descriptor)
    text = shown.replace(QUESTION, b"").decode().replace("\r\n", "\n")
    return Terminal(text, questions, unread, restored, process.returncode, seconds)


def kitty_picture(text):
    """Return the picture that kitty draws for a text with one picture in it."""
    chunks = re.findall(r"\x1b_G([^;]*);([A-Za-z0-9+/=]*)\x1b\\", text)
    keys = [dict(pair.split("=") for pair in told.split(",")) for told, _ in chunks]
    assert {"a": "T", "f": "100", "q": "2"}.items() <= keys[0].items()
    assert [key["m"] for key in keys] == ["1"] * (len(keys) - 1) + ["0"]
    assert all(len(data) <= 4096 for _, data in chunks)
    assert all(len(data) % 4 == 0 for _, data in chunks[:-1])
    return Image.open(io.BytesIO(base64.b64decode("".join(data for _, data in chunks))))


def sixel_pixels(text):
    """Return the pixels that a VT340 draws for a text with one picture in it, (H, W, 3) uint8.

    Pixels that nothing was drawn to are magenta.
    """
    (body,) = re.findall(r"\x1bP[0-9;]*q(.*?)\x1b\\", text, re.DOTALL)
    wide, high = map(int, re.match(r'"1;1;(\d+);(\d+)', body).groups())
    pixels = np.full((high + 6, wide, 3), (255, 0, 255), np.uint8)
    palette, color, x, y = {}, 0, 0, 0
    for token in re.finditer(r"""
        (?P<size>"[0-9;]*) | \#(?P<define>\d+);2;(?P<rgb>\d+;\d+;\d+) | \#(?P<use>\d+)
        | (?P<start>\$) | (?P<next>-) | !(?P<count>\d+)(?P<repeated>[?-~]) | (?P<one>[?-~])
        | (?P<bad>.)
    """, body, re.VERBOSE | re.DOTALL):  # fmt: skip
        assert token["bad"] is None, f"no sixel: {token[0]!r}"
        if token["define"]:
            shares = [int(share) for share in token["rgb"].split(";")]
            palette[int(token["define"])] = [round(share * 2.55) for share in shares]
        elif token["use"]:
            color = int(token["use"])
        elif token["start"]:
            x = 0
        elif token["next"]:
            x, y = 0, y + 6
        elif token["one"] or token["repeated"]:
            bits, count = ord(token["one"] or token["repeated"]) - 63, int(token["count"] or 1)
            for k in range(6):
                if bits >> k & 1:
                    pixels[y + k, x : x + count] = palette[color]
            x += count
            assert x <= wide
    assert (pixels[high:] == (255, 0, 255)).all()
    assert len(palette) <= 256
    return pixels[:high]

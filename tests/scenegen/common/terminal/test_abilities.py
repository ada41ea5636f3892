"""Programs in a terminal that answers, or not: what they find out, and what they leave behind."""

import sys

import pytest
from terminals import WITH_SIXEL, WITHOUT_SIXEL, in_terminal

from scenegen.common.terminal import abilities

ASK = "from scenegen.common.terminal.abilities import protocol, width; print(protocol(), width())"
LIKE_KITTY = (
    {"TERM": "xterm-kitty"},
    {"TERM": "xterm-ghostty"},
    {"TERM_PROGRAM": "ghostty"},
    {"TERM_PROGRAM": "WezTerm"},
    {"KITTY_WINDOW_ID": "1"},
)
WITHIN = ({"TMUX": "/tmp/tmux"}, {"STY": "1.pts"}, {"ZELLIJ": "0"}, {"TERM": "screen-256color"})


@pytest.mark.parametrize(
    ("answer", "found"), [(WITH_SIXEL, "sixel"), (WITHOUT_SIXEL, "None"), (None, "None")]
)
def test_a_terminal_is_asked(answer, found):
    done = in_terminal(["-c", ASK], answer)
    assert done.shown.split()[-2:] == [found, "800"]
    assert (done.questions, done.unread, done.restored, done.code) == (1, b"", True, 0)
    assert done.seconds < 5


def test_attribute_4_is_not_a_digit_of_another():
    assert in_terminal(["-c", ASK], b"\x1b[?64;14;41c").shown.split()[-2] == "None"


@pytest.mark.parametrize("environment", LIKE_KITTY, ids=str)
def test_terminals_like_kitty_are_known_by_name(environment):
    done = in_terminal(["-c", ASK], WITH_SIXEL, **environment)
    assert (done.shown.split()[-2], done.questions) == ("kitty", 0)


@pytest.mark.parametrize("environment", WITHIN, ids=str)
def test_within_tmux_the_name_of_the_outer_terminal_says_nothing(environment):
    environment = {"KITTY_WINDOW_ID": "1", **environment}
    assert in_terminal(["-c", ASK], WITHOUT_SIXEL, **environment).shown.split()[-2] == "None"
    assert in_terminal(["-c", ASK], WITH_SIXEL, **environment).shown.split()[-2] == "sixel"


def test_a_window_in_kitty_may_be_another_terminal():
    inherited = {"KITTY_WINDOW_ID": "1", "TERM_PROGRAM": "vscode"}
    assert in_terminal(["-c", ASK], WITHOUT_SIXEL, **inherited).shown.split()[-2] == "None"


def test_what_was_typed_before_is_kept():
    done = in_terminal(["-c", ASK], WITH_SIXEL, typed=b"ls\n")
    assert (done.questions, done.unread, done.restored) == (0, b"ls\n", True)
    assert done.shown.split()[-2] == "None"


def test_what_follows_the_answer_is_kept():
    done = in_terminal(["-c", ASK], WITH_SIXEL + b"ls\n")
    assert (done.shown.split()[-2], done.unread) == ("sixel", b"ls\n")


def test_an_interrupt_restores_the_terminal():
    done = in_terminal(["-c", ASK], b"\x03")
    assert "KeyboardInterrupt" in done.shown
    assert (done.restored, done.code) == (True, -2)


def test_a_process_in_the_background_is_not_stopped():
    """It may not touch the terminal: the kernel would stop it."""
    script = f"set -m; {sys.executable} -c '{ASK}' & wait $! 2>&1; echo ended"
    done = in_terminal(["-c", f"import os; os.execv('/bin/bash', ['bash', '-c', {script!r}])"])
    assert (done.shown.split()[:2], done.questions) == (["None", "800"], 0)
    assert "Stopped" not in done.shown


def test_terminals_that_can_nothing_are_not_asked():
    done = in_terminal(["-c", ASK], WITH_SIXEL, TERM="dumb")
    assert (done.shown.split()[-2], done.questions) == ("None", 0)


def test_the_width_is_in_pixels_where_the_terminal_tells():
    assert in_terminal(["-c", ASK], size=(24, 80, 1234, 600)).shown.split()[-1] == "1234"
    assert in_terminal(["-c", ASK], size=(24, 100, 0, 0)).shown.split()[-1] == "1000"


def test_what_is_no_terminal_shows_nothing(monkeypatch, capsys):
    monkeypatch.setenv("TERM", "xterm-kitty")
    assert (abilities.protocol(), abilities.width()) == (None, 800)

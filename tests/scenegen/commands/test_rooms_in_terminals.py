"""`scenegen preview` in terminals that can draw pictures, and in others."""

import numpy as np
import pytest
from PIL import Image
from terminals import WITH_SIXEL, WITHOUT_SIXEL, in_terminal, kitty_picture, sixel_pixels

from scenegen.rooms.preview import contact_sheet
from scenegen.rooms.reader import open_rooms

SCENEGEN = ("-c", "import cli; cli.scenegen(prog_name='scenegen')", "preview")
WIDE = (24, 200, 2000, 500)


@pytest.fixture(scope="module")
def sheet(rooms_path):
    with open_rooms(rooms_path) as rooms:
        return np.asarray(contact_sheet([rooms[0], rooms[1]])).astype(int)


def test_a_terminal_with_sixels_shows_the_sheet(rooms_path, sheet, tmp_path):
    command = [*SCENEGEN, str(rooms_path), "--items", "0,1"]
    done = in_terminal(command, WITH_SIXEL, size=WIDE, cwd=tmp_path)
    drawn = sixel_pixels(done.shown).astype(int)
    assert abs(drawn - sheet).max() < 40
    assert done.shown.endswith(f"shown (--out writes a file): 2 of {rooms_path}'s rooms\n")
    assert (done.restored, done.code, list(tmp_path.iterdir())) == (True, 0, [])


def test_kitty_shows_the_sheet(rooms_path, sheet, tmp_path):
    command = [*SCENEGEN, str(rooms_path), "--items", "0,1"]
    done = in_terminal(command, size=WIDE, cwd=tmp_path, TERM="xterm-kitty")
    assert np.array_equal(np.asarray(kitty_picture(done.shown)), sheet)
    assert (done.code, list(tmp_path.iterdir())) == (0, [])


@pytest.mark.parametrize(
    ("answer", "options"),
    [
        (None, ()),
        (WITHOUT_SIXEL, ()),
        (WITH_SIXEL, ("--show", "no")),
        (WITH_SIXEL, ("--out", "sheet.png")),
    ],
    ids=str,
)
def test_otherwise_it_is_written(rooms_path, sheet, tmp_path, answer, options):
    command = [*SCENEGEN, str(rooms_path), "--items", "0,1", *options]
    done = in_terminal(command, answer, cwd=tmp_path)
    assert done.shown == f"sheet.png: 2 of {rooms_path}'s rooms\n"
    assert np.array_equal(np.asarray(Image.open(tmp_path / "sheet.png")), sheet)
    assert (done.restored, done.questions) == (True, int(not options))


def test_within_tmux_kitty_is_refused(rooms_path, tmp_path):
    command = [*SCENEGEN, str(rooms_path), "--show", "kitty"]
    done = in_terminal(command, cwd=tmp_path, TMUX="/tmp/tmux-0/default,1,0")
    assert done.shown.startswith("Error: --show kitty: ")
    assert (done.code, list(tmp_path.iterdir())) == (2, [])


@pytest.mark.parametrize(("protocol", "read"), [("kitty", kitty_picture), ("sixel", sixel_pixels)])
def test_what_is_asked_for_goes_into_a_pipe_too(run, rooms_path, sheet, tmp_path, protocol, read):
    result = run("preview", rooms_path, "--items", "0,1", "--show", protocol, "--out", "s.png")
    assert result.stdout.endswith(f"s.png: 2 of {rooms_path}'s rooms\n")
    assert np.asarray(read(result.stdout)).shape[1] == 800 < sheet.shape[1]
    assert np.array_equal(np.asarray(Image.open(tmp_path / "s.png")), sheet)


def test_a_pipe_gets_nothing_else(run, rooms_path, tmp_path, monkeypatch):
    monkeypatch.setenv("TERM", "xterm-kitty")
    assert run("preview", rooms_path).stdout == f"sheet.png: 8 of {rooms_path}'s rooms\n"
    assert (tmp_path / "sheet.png").exists()

"""Paths that no file is written to, and what a written file is like."""

import errno
import os
from pathlib import Path

import pytest

from scenegen.common.new_file import check_writable, refuse_inputs, write_text


@pytest.mark.parametrize(
    ("path", "number", "where"),
    [
        ("", errno.ENOENT, None),
        ("missing/x", errno.ENOENT, "missing"),
        ("file/x", errno.ENOTDIR, "file"),
        (".", errno.EISDIR, "."),
        ("link", errno.ELOOP, "link"),
        ("dangling", errno.ELOOP, "dangling"),
        ("pipe", errno.EINVAL, "pipe"),
    ],
)
def test_places_that_no_file_is_written_to(tmp_path, monkeypatch, path, number, where):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    Path("link").symlink_to("file")
    Path("dangling").symlink_to("nothing")
    os.mkfifo("pipe")
    before = sorted(os.listdir())
    for call in (lambda: check_writable(path, True), lambda: write_text(path, "new", True)):
        with pytest.raises(OSError, match=r".") as error:
            call()
        assert (error.value.errno, error.value.filename) == (number, where)
    assert sorted(os.listdir()) == before
    assert Path("file").read_text() == "mine"


def test_a_written_file_has_the_permissions_of_any_other(tmp_path):
    write_text(tmp_path / "first", "")
    (tmp_path / "plain").write_text("")
    assert (tmp_path / "first").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize(
    ("output", "source"),
    [
        ("in.h5", "in.h5"),
        ("folder/../in.h5", "in.h5"),
        ("hard.h5", "in.h5"),
        ("in.h5", "soft.h5"),
    ],
)
def test_an_output_that_is_an_input_is_refused(tmp_path, monkeypatch, output, source):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("in.h5").write_text("")
    os.link("in.h5", "hard.h5")
    Path("soft.h5").symlink_to("in.h5")
    with pytest.raises(OSError, match=source) as error:
        refuse_inputs(["new.h5", output], ["missing.h5", source])
    assert error.value.filename == output
    refuse_inputs(["new.h5", "hard.h5"], ["folder", "missing.h5"])

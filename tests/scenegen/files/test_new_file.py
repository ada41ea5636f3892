"""Paths that no file is written to, and what a written file is like."""

import errno
import os
from pathlib import Path

import pytest

from scenegen.files.new_file import check_writable, write_text, written_beside


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


def test_of_two_runs_that_want_one_name_the_second_fails(tmp_path, monkeypatch):
    """The first takes the name after the second has seen that it is free."""
    path, link = tmp_path / "x", os.link

    def links(*arguments: object) -> None:
        path.write_text("first")
        link(*arguments)

    monkeypatch.setattr(os, "link", links)
    with pytest.raises(FileExistsError) as error, written_beside(path) as temporary:
        temporary.write_text("second")
    assert error.value.filename == str(path)
    assert path.read_text() == "first"

"""Rows that are not there, and places that cannot be written, of a good file."""

import pytest

FORMATS = pytest.mark.parametrize("form", ["exr", "png", "ply", "obj"])


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "text").write_text("mine")
    (tmp_path / "folder.png").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    "case",
    [
        ("--items", "8", "items: found 8", "0 to 7"),
        ("--items", "0-500", "items: found 8", "0 to 7"),
        ("--items", "9" * 30, "items: found 999", "0 to 7"),
        ("--items", "-1", "--items", "'-1'", "0,5,7 or 0-7"),
        ("--items", "a", "--items", "'a'", "0,5,7 or 0-7"),
        ("--items", "", "--items", "''", "0,5,7 or 0-7"),
        ("--items", "0,", "--items", "'0,'", "0,5,7 or 0-7"),
        ("--items", "1.5", "--items", "'1.5'", "0,5,7 or 0-7"),
        ("--items", "5-2", "--items", "5-2"),
        ("--random", "0", "--random", "0", "1<=x<=400"),
        ("--random", "401", "--random", "401", "1<=x<=400"),
        ("--random", "x", "--random", "'x'"),
        ("--out", "none/s.png", "none: ", "folder does not exist"),
        ("--out", "text/s.png", "text: ", "not a folder"),
        ("--out", "folder.png", "folder.png: ", "is a folder"),
        ("--out", "s.xyz", "'s.xyz'", "sheet.png"),
        ("--out", "s", "'s'", "sheet.png"),
        ("--out", "rooms.h5", "'rooms.h5'", "sheet.png"),
        ("--out", "", "sheet.png"),
        ("--out", "/proc/s.png", "/proc"),
        ("--out", "a" * 300 + ".png", "too long"),
        ("--bogus", "1", "--bogus"),
    ],
    ids=lambda case: f"{case[0]} {case[1]:.20}",
)
def test_preview(refuses, rooms_path, folder, case):
    option, value, *words = case
    line = refuses("preview", rooms_path, option, value, words=tuple(words))
    hidden = [word for word in line.replace("/", " ").split() if word.startswith(".")]
    assert hidden == [], "the user's name for it, not ours"


def test_preview_of_contradictions(refuses, rooms_path):
    refuses("preview", rooms_path, "--items", "0", "--random", "2", words=("items", "random"))
    refuses("preview", rooms_path, "--random", "2", "--seed", "-1", words=("seed", "-1"))


@FORMATS
@pytest.mark.parametrize(
    "case",
    [
        ("--items", "8", "items: found 8", "0 to 7"),
        ("--items", "5-2", "--items", "5-2"),
        ("--items", "-1", "--items", "'-1'"),
        ("--out", "none/deep", "none", "o such file"),
        ("--out", "text", "text: ", "not a folder"),
        ("--out", "/proc", "/proc"),
    ],
    ids=lambda case: f"{case[0]} {case[1]:.20}",
)
def test_export(refuses, rooms_path, folder, form, case):
    option, value, *words = case
    arguments = ("export", rooms_path, "--items", "0", "--format", form)
    line = refuses(*arguments, option, value, words=tuple(words))
    assert "/." not in line, "the user's name for it, not ours"


@FORMATS
def test_export_makes_its_folder(run, rooms_path, folder, form):
    out = ("--out", "exports")
    assert run("export", rooms_path, "--items", "1", "--format", form, *out).exit_code == 0
    assert any((folder / "exports").iterdir())


@FORMATS
def test_export_keeps_existing_files(run, refuses, rooms_path, form):
    assert run("export", rooms_path, "--items", "1", "--format", form).exit_code == 0
    words = ("rooms-000001", "exists already", "--overwrite")
    refuses("export", rooms_path, "--items", "0,1", "--format", form, words=words)


def test_export_options(run, refuses, rooms_path):
    refuses("export", rooms_path, "--format", "exr", words=("--items",))
    refuses("export", rooms_path, "--items", "0", "--format", "stl", words=("--format", "'stl'"))
    result = run("export", rooms_path, "--items", "0")
    assert result.exit_code == 2
    assert "Missing option '--format'" in result.stderr  # click lists the choices below it


@pytest.mark.parametrize(
    "case",
    [
        ("--items", "-1", "--items", "-1"),
        ("--items", "x", "--items", "'x'"),
        ("--items", "1.5", "--items", "'1.5'"),
        ("--device", "tpu", "--device", "'tpu'", "'auto', 'cpu', 'cuda'"),
        ("--bogus", "1", "--bogus"),
    ],
    ids=lambda case: f"{case[0]} {case[1]}",
)
def test_verify(refuses, rooms_path, case):
    option, value, *words = case
    refuses("verify", rooms_path, option, value, words=tuple(words))


def test_verify_without_a_gpu(refuses, rooms_path, monkeypatch):
    monkeypatch.setattr("scenegen.rendering.backend._cuda_driver", lambda: False)
    refuses("verify", rooms_path, "--device", "cuda", words=("cuda", "--device cpu"))

"""`scenegen export` to formats of data loaders, and `scenegen card`, as a user types them."""

import importlib.util

import pytest

WHO = ("--creator", "A. Person")


@pytest.fixture
def without_pyarrow(monkeypatch):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pyarrow" else real(name)
    )


def test_all_rows_go_to_a_folder_of_its_own(run, rooms_path, tmp_path):
    told = run("export", rooms_path, "--format", "parquet", "--rows-per-file", 5)
    assert told.exit_code == 0, told.output
    assert told.stdout.startswith("rooms-parquet: 8 images in 2 files, ")
    assert sorted(p.name for p in (tmp_path / "rooms-parquet").iterdir()) == [
        "config.json", "rooms-00000-of-00002.parquet", "rooms-00001-of-00002.parquet"
    ]  # fmt: skip


def test_refused_exports(refuses, rooms_path):
    refuses("export", rooms_path, "--format", "png", words=("--items",))
    refuses("export", rooms_path, "--format", "parquet", "--items", 8, words=("--items", "0 to 7"))


def test_refused_cards(run, refuses, meshes, rooms_path, tmp_path):
    (tmp_path / "README.md").write_text("mine")
    refuses("card", rooms_path, *WHO, words=("README.md", "--overwrite"))
    refuses("card", rooms_path, *WHO, "--out", rooms_path, words=("rooms.h5", "input"))
    refuses("card", rooms_path, *WHO, "--license", "my own", "--out", "x", words=("--license",))
    (meshes / "mug" / "broken.obj").unlink()
    tiny = ("--n", 1, "--size", 16, "--out", "m.h5", "--objects-root", meshes, "--objects", 1)
    assert run("render", *tiny).exit_code == 0
    refuses("card", "m.h5", *WHO, "--out", "new", words=("--license", "meshes"))
    assert run("card", "m.h5", *WHO, "--out", "new", "--license", "LicenseRef-own").exit_code == 0


@pytest.mark.usefixtures("without_pyarrow")
def test_without_the_extra(run, refuses, rooms_path):
    words = ("pyarrow", "pip install '.[share]'")
    refuses("export", rooms_path, "--format", "parquet", words=words)
    refuses("card", rooms_path, *WHO, "--out", "card", words=words)
    assert run("export", rooms_path, "--format", "webdataset").exit_code == 0

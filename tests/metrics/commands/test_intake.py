"""`bench import`: what it prints, and one line for every mistake."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import cli
from metrics.submissions.reader import open_predictions
from scenegen.rooms.reader import RoomsFile


def bench(*arguments):
    return CliRunner().invoke(cli.bench, [str(argument) for argument in arguments])


@pytest.fixture
def folder(truths, tmp_path):
    """A folder with the true depth of each row, as metres in a file, and its truth's path."""
    (tmp_path / "mine").mkdir()
    with RoomsFile(truths.rooms) as rooms:
        for room in rooms:
            np.save(tmp_path / "mine" / f"{room.index}.npy", room.depth)
    return tmp_path


def test_a_folder_is_imported_and_scored(folder, truths):
    out = folder / "p.h5"
    done = bench("import", "--depth", folder / "mine", "--data", truths.rooms, "--out", out)
    assert done.exit_code == 0, done.output
    assert "8 files" in done.stdout
    assert done.stdout.splitlines()[-1] == f"now: bench score {out} --truth {truths.rooms}"
    with open_predictions(out) as found:
        assert found.method == "mine"
    assert bench("score", out, "--truth", truths.rooms).exit_code == 0


def test_a_wrong_unit_gets_a_hint(folder, truths):
    done = bench("import", "--depth", folder / "mine", "--scale", "1000", "--data", truths.rooms,
                 "--out", folder / "p.h5")  # fmt: skip
    assert (done.exit_code, "millimetres" in done.stderr) == (0, True)


def test_answers_are_imported(truths, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(list("ABCCBA")))
    out = tmp_path / "a.h5"
    done = bench("import", "--answers", tmp_path / "a.json", "--data", truths.iqtt, "--out", out)
    assert done.exit_code == 0, done.output
    with open_predictions(out) as found:
        assert (found.answers.tolist(), found.method) == ([0, 1, 2, 2, 1, 0], "a")


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ([], "--depth"),
        (["--depth", "mine", "--answers", "mine"], "--depth"),
        (["--depth", "mine", "--unit", "mm", "--scale", "2"], "--unit"),
        (["--depth", "mine", "--scale", "1/0"], "1/0"),
        (["--depth", "mine", "--scale", "x"], "x"),
        (["--depth", "mine", "--alignment", "scale", "--kind", "disparity", "--scale", "-1"], "-1"),
        (["--depth", "mine/*.png"], "mine/*.png"),
        (["--depth", "none"], "none"),
        (["--depth", "mine/[0-6].npy"], "7"),
        (["--depth", "mine", "--normals", "mine"], "normal"),
        (["--depth", "mine", "--kind", "points"], "points"),
        (["--depth", "mine", "--data", "iqtt"], "iqtt"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(options, word, folder, truths, monkeypatch):
    monkeypatch.chdir(folder)
    data = [] if "--data" in options else ["--data", str(truths.rooms)]
    options = [str(truths.iqtt) if option == "iqtt" else option for option in options]
    done = bench("import", *options, *data, "--out", "p.h5")
    assert done.exit_code == 2, done.output
    line = done.stderr.splitlines()[-1]
    assert word in line
    assert [path.name for path in folder.iterdir()] == ["mine"]

"""`bench import` and `bench run`: what they print, and one line for every mistake."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import cli
from metrics.intake.outputs import KEYS
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
        (["--depth", "mine/0.npy", "mine/1.npy"], "mine/1.npy"),
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


MODEL = """
import numpy as np
def infer(image):
    print("looking")
    return {"depth_metric": np.full(image.shape[:2], 1.5)}
"""


def test_the_help_names_all_keys_that_models_return():
    assert all(key in bench("run", "--help").output for key in KEYS)


def test_a_model_is_run(truths, tmp_path, capfd):
    (tmp_path / "wall.py").write_text(MODEL)
    out = tmp_path / "p.h5"
    done = bench("run", tmp_path / "wall.py", "--data", truths.rooms, "--out", out)
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-1] == f"now: bench score {out} --truth {truths.rooms}"
    assert "looking" in capfd.readouterr().err  # of its process, which has no other output
    assert "looking" not in done.stdout
    with open_predictions(out) as found:
        assert found.method == "wall"


def test_an_error_of_the_model_is_one_line_unless_all_is_asked_for(truths, tmp_path):
    (tmp_path / "wall.py").write_text(MODEL.replace("1.5", "1 / 0"))
    line = ["run", tmp_path / "wall.py", "--data", truths.rooms, "--out", tmp_path / "p.h5"]
    done = bench(*line)
    assert (done.exit_code, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert "line 5: row 0" in done.stderr
    assert "Traceback" in bench(*line, "--traceback").stderr
    assert [path.name for path in tmp_path.iterdir() if path.suffix] == ["wall.py"]


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["none.py"], "none.py"),
        (["folder"], "folder"),
        (["wall.py", "--key", "depth"], "--key"),
        (["wall.py", "--key", "depth_affine_invariant"], "depth_affine_invariant"),
        (["wall.py", "--device", "cuda"], "--device"),
        (["wall.py", "--batch", "4"], "--batch"),
        (["wall.py", "--intrinsics"], "--intrinsics"),
        (["wall.py", "--data", "wall.py"], "wall.py"),
    ],
)
def test_a_mistake_in_running_is_one_line(options, word, truths, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wall.py").write_text(MODEL)
    (tmp_path / "folder").mkdir()
    data = [] if "--data" in options else ["--data", truths.rooms]
    done = bench("run", *options, *data, "--out", "p.h5")
    assert done.exit_code == 2, done.output
    assert word in done.stderr.splitlines()[-1]
    assert not (tmp_path / "p.h5").exists()
    assert not (tmp_path / "p.h5.rows").exists()

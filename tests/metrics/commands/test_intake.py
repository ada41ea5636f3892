"""`bench import` and `bench run`: what they print, and one line for every mistake."""

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
    done = bench("import", "--depth", folder / "mine", "--scale", "1000", "--data", truths.rooms,
                 "--out", out, "--overwrite")  # fmt: skip
    assert (done.exit_code, "millimetres" in done.stderr) == (0, True)


def test_answers_are_imported(truths, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(list("ABCCBA")))
    out = tmp_path / "a.h5"
    done = bench("import", "--answers", tmp_path / "a.json", "--data", truths.iqtt, "--out", out)
    assert done.exit_code == 0, done.output
    with open_predictions(out) as found:
        assert (found.answers.tolist(), found.method) == ([0, 1, 2, 2, 1, 0], "a")


MODEL = """
import numpy as np
def infer(image):
    print("looking")
    return {"depth_metric": np.full(image.shape[:2], 1.5)}
"""


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
    ("line", "word"),
    [
        ("import", "--depth"),
        ("import --depth mine --answers mine", "--depth"),
        ("import --depth mine --unit mm --scale 2", "--unit"),
        ("import --depth mine --scale 1/0", "1/0"),
        ("import --depth mine --alignment scale --kind disparity --scale -1", "-1"),
        ("import --depth mine/*.png", "mine/*.png"),
        ("import --depth mine/0.npy mine/1.npy", "mine/1.npy"),
        ("import --depth none", "none"),
        ("import --depth mine/[0-6].npy", "7"),
        ("import --depth mine --normals mine", "normal"),
        ("import --depth mine --kind points", "points"),
        ("import --depth mine --data IQTT", "iqtt"),
        ("run none.py", "none.py"),
        ("run mine", "mine"),
        ("run wall.py --key depth", "--key"),
        ("run wall.py --key depth_affine_invariant", "depth_affine_invariant"),
        ("run wall.py --device cuda", "--device"),
        ("run wall.py --batch 4", "--batch"),
        ("run wall.py --intrinsics", "--intrinsics"),
        ("run wall.py --data wall.py", "wall.py"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(line, word, folder, truths, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "wall.py").write_text(MODEL)
    words = line.replace("IQTT", str(truths.iqtt)).split()
    data = [] if "--data" in words else ["--data", truths.rooms]
    done = bench(*words, *data, "--out", "p.h5")
    assert done.exit_code == 2, done.output
    assert word in done.stderr.splitlines()[-1]
    assert {path.name for path in folder.iterdir()} <= {"mine", "wall.py", "__pycache__"}

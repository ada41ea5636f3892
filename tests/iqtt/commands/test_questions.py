"""The iqtt commands as a user types them, and the mistakes that a user makes."""

import json
import shutil
import sys

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

import cli
from iqtt.questions.specs import secret_seed

TINY = "--train 6 --labeled 3 --val 3 --test 3 --size 32 --batch 4 --cubes 6-7"
FILES = ["iqtt-test-answers.h5", "iqtt-test.h5", "iqtt-train.h5", "iqtt-val.h5"]


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    """Return a folder with a tiny split that no test changes."""
    folder = tmp_path_factory.mktemp("iqtt")
    result = CliRunner().invoke(cli.iqtt, [*f"make-split {TINY} --out".split(), f"{folder}/split"])
    assert result.exit_code == 0, result.output
    return folder / "split"


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run `iqtt ...` inside this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(cli.iqtt, [str(a) for a in arguments])


def files_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_every_option_is_recorded(run, monkeypatch, tmp_path):
    line = (
        "make-split --out x --train 6 --labeled 2 --val 3 --test 4 --seed 5 --cubes 6-7"
        " --shapes tree --distractors near --min-angle 40 --min-cube-pixels 2 --max-radius 3"
        " --size 40x32 --background 0.5,0.25,1 --lights 1-3 --image-dtype float32 --with-depth"
        " --compression lzf --batch 2 --device cpu"
    )
    monkeypatch.setattr(sys, "argv", ["/somewhere/iqtt", *line.split()])
    result = run(*line.split())
    assert result.exit_code == 0, result.output
    assert files_in(tmp_path / "x") == [*FILES]
    with h5py.File("x/iqtt-test-answers.h5") as file:
        spec = json.loads(file.attrs["spec"])
        assert file.attrs["creation_command"] == "iqtt " + line.replace(" --batch 2", "")
        assert file["truth/depth"].shape == (4, 4, 40, 32)
    expected = {
        "seed": 5, "train": 6, "labeled": 2, "val": 3, "test": 4, "cubes": [6, 7],
        "shapes": "tree", "distractors": "near", "min_angle_degrees": 40.0, "min_cube_pixels": 2,
        "max_radius": 3.0, "height": 40, "width": 32, "background": [0.5, 0.25, 1.0],
        "lights": [1, 3], "image_dtype": "float32", "with_depth": True,
    }  # fmt: skip
    assert {name: spec[name] for name in expected} == expected
    with h5py.File("x/iqtt-train.h5") as file:
        assert file["labeled/questions"].shape == (2, 4, 40, 32, 3)
        assert file["labeled/questions"].dtype == "float32"
        assert file["labeled/questions"].compression == "lzf"
        assert np.unique(file["truth/labeled/light_count"][:]).max() <= 3


@pytest.mark.usefixtures("few_explained")
def test_a_secret_seed(run, tmp_path):
    """The same content gives the same questions, blanks aside; tools that read need no seed."""
    for name, content in (("a", "0123456789abcdef"), ("b", " 0123456789abcdef\n"), ("c", "z" * 16)):
        (tmp_path / name).write_text(content)
        made = run("make-split", *TINY.split(), "--out", f"{name}x", "--secret-seed", name)
        assert made.exit_code == 0, made.output
    raw = {name: (tmp_path / f"{name}x/iqtt-test.h5").read_bytes() for name in "abc"}
    assert raw["a"] == raw["b"] != raw["c"]
    told = run("info", "ax/iqtt-test-answers.h5")
    assert told.exit_code == 0
    assert str(secret_seed("a")) not in told.stdout
    assert run("audit", "ax").exit_code == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--secret-seed short", ["short", "14", "16"]),
        ("--secret-seed missing", ["missing", "No such file"]),
        ("--secret-seed long --seed 0", ["--secret-seed", "--seed"]),
        ("--secret-seed x/iqtt-val.h5 --out x --overwrite", ["x/iqtt-val.h5", "not an input"]),
        ("--secret-seed vast", ["vast", "1000001"]),
    ],
)
def test_a_secret_that_is_none(run, tmp_path, options, words, check_refusal):
    (tmp_path / "short").write_text("  14 characters.\n")
    (tmp_path / "long").write_text("z" * 20)
    (tmp_path / "vast").write_text("z" * 2_000_000)
    (tmp_path / "x").mkdir()
    (tmp_path / "x/iqtt-val.h5").write_text("z" * 20)
    before = sorted(tmp_path.rglob("*"))
    result = run("make-split", *TINY.split(), *options.split())
    check_refusal(result.exit_code, result.stdout, result.stderr, tuple(words))
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "rows"),
    [
        (["iqtt-val.h5"], 3),
        (["iqtt-test.h5", "--mark-correct"], 3),
        (["iqtt-train.h5", "--part", "unlabeled", "--items", "0,2"], 2),
    ],
)
def test_show_draws_questions(run, split, arguments, rows, tmp_path):
    result = run("show", split / arguments[0], *arguments[1:], "--out", "sheet.png")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(f"sheet.png: {rows} of ")
    assert (tmp_path / "sheet.png").stat().st_size > 1000


@pytest.mark.usefixtures("few_explained")
def test_audit_exits_with_1_when_a_proof_fails(run, split, tmp_path, check_refusal):
    shutil.copytree(split, "x")
    result = run("audit", "x", "--json", "audit.json")
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "audit.json").read_text())
    assert found["passed"] is True
    assert {proof["status"] for proof in found["audits"][0]["proofs"]} == {"ok"}
    again = run("audit", "x", "--json", "audit.json")
    check_refusal(again.exit_code, again.stdout, again.stderr, ("audit.json", "--overwrite"))
    with h5py.File("x/iqtt-val.h5", "r+") as file:
        file["answers"][0] = (file["answers"][0] + 1) % 3
    result = run("audit", "x")
    assert (result.exit_code, "FAIL" in result.stdout) == (1, True)

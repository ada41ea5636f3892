"""The reference model's commands as a user types them, with and without torch."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import pytest
from pix2shape_commands import bench, invoke, linked, pix2shape, train

import cli
from baselines.pix2shape.commands import PACKAGES

COMMANDS = ("train", "predict", "sample", "interpolate", "rotate")


@pytest.fixture
def folder(pix2shape_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder that holds links to those files."""
    monkeypatch.chdir(tmp_path)
    return linked(pix2shape_files, tmp_path)


def test_train_predict_score(folder):
    small = [f"--set={one}" for one in ("iterations=2", "batch=2", "consistency=0")]
    made = train(*small, "--seed", 5)
    assert made.exit_code == 0, made.output
    assert made.stdout.startswith(
        "run/weights.safetensors: trained on large.h5; now `pix2shape pre"
    )
    card = json.loads((folder / "run" / "weights.json").read_text())
    settings = {name: card["config"][name] for name in ("iterations", "batch", "seed", "decay")}
    assert settings == {"iterations": 2, "batch": 2, "seed": 5, "decay": True}, "compact's others"
    weights = "run/weights.safetensors"
    done = pix2shape("predict", "--weights", weights, "--data", "large.h5", "--run", "one")
    assert done.exit_code == 0, done.output
    line = f"predictions.h5: {weights} on large.h5; score it with `bench score predictions.h5`\n"
    assert done.stdout == line
    assert bench("validate", "predictions.h5").stdout == "predictions.h5: valid\n"
    assert "chamfer" in bench("score", "predictions.h5").stdout
    other = bench(
        "baseline", "pix2shape", "--data", "large.h5", "--weights", weights, "--out", "b.h5"
    )
    assert other.exit_code == 0, other.output
    with h5py.File("predictions.h5") as one, h5py.File("b.h5") as two:
        assert (one["depth"][()] == two["depth"][()]).all()
        assert (one.attrs["run"], two.attrs["run"]) == ("one", "")
    again = train("--resume")
    assert again.exit_code == 0, again.output


def test_pictures(folder):
    common = ("--weights", "rooms.safetensors")
    for line, name, words in (
        (["sample", "--n", 3], "samples.png", "samples.png: 3 samples"),
        (
            ["interpolate", "--data", "rooms.h5", "--steps", 2],
            "interpolation.png",
            "row 0 to row 1",
        ),
        (["rotate", "--data", "rooms.h5", "--frames", 3], "rotation.gif", "6 scenes turned by 80"),
    ):
        for _ in range(2):
            done = pix2shape(*line, *common)
            assert done.exit_code == 0, done.output
            assert words in done.stdout
        assert (folder / name).stat().st_size > 1000
    labelled = pix2shape("sample", "--weights", "classes.safetensors", "--class", "bowl", "--n", 2)
    assert labelled.exit_code == 0, labelled.output


def test_questions(folder):
    done = pix2shape("predict", "--weights", "questions.safetensors", "--data", "iqtt-test.h5")
    assert done.exit_code == 0, done.output
    assert "iqtt_accuracy" in bench("score", "predictions.h5").stdout


def test_who_interrupts_is_told_how_to_go_on(folder, monkeypatch):
    from baselines.pix2shape.training import runs

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(runs, "train_run", interrupted)
    result = train("--set=iterations=2")
    assert result.exit_code == 1
    assert "`--resume` goes on from run's last checkpoint" in result.stdout
    assert "Aborted" in result.stderr


def test_bundled_weights_go_by_name(folder, monkeypatch, check_refusal):
    from baselines.pix2shape.weights import bundled

    monkeypatch.setattr(bundled, "FOLDER", folder / "none")
    assert bundled.names() == []
    result = pix2shape("sample")
    words = ("weights: found 'shapes'", "of which this installation has none")
    check_refusal(result.exit_code, result.stdout, result.stderr, words)
    result = bench("baseline", "pix2shape", "--data", "rooms.h5")
    words = ("none are bundled for rooms.h5", "pix2shape train")
    check_refusal(result.exit_code, result.stdout, result.stderr, words)
    (folder / "none").mkdir()
    for name in ("shapes", "shapes-single"):
        for ending in ("safetensors", "json"):
            shutil.copy(f"rooms.{ending}", f"none/{name}.{ending}")
    made = bench("baseline", "pix2shape", "--data", "rooms.h5")
    assert "weights shapes, on rooms.h5" in made.stdout, made.output
    assert pix2shape("sample", "--n", 1).exit_code == 0
    result = pix2shape("sample", "--weights", "chairs")
    words = ("'chairs'", "or one of shapes, shapes-single")
    check_refusal(result.exit_code, result.stdout, result.stderr, words)


def test_weights_that_come_with_the_package_load(folder):
    from baselines.pix2shape.weights import bundled

    for name in sorted(set(bundled.names()) - {"iqtt"}):
        model, card = bundled.open_weights(name)
        assert card.config == model.config
        assert card.iteration > 0
        assert pix2shape("sample", "--weights", name, "--n", 2).exit_code == 0


LINES = [
    ("pix2shape", f"{name} --data x.h5 --out y".split()) for name in COMMANDS if name != "sample"
]
LINES += [("pix2shape", ["sample"]), ("bench", ["baseline", "pix2shape", "--data", "x.h5"])]


@pytest.mark.parametrize("gone", [PACKAGES, ("safetensors",)])
@pytest.mark.parametrize(("group", "line"), LINES, ids=str)
def test_without_the_optional_packages(group, line, gone, tmp_path, monkeypatch, check_refusal):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name in gone else find(name)
    )
    monkeypatch.chdir(tmp_path)
    result = invoke(getattr(cli, group), *line)
    words = (f"pix2shape needs {', '.join(gone)}: pip install 'pix2shape-bench[model]'",)
    check_refusal(result.exit_code, result.stdout, result.stderr, words)


def test_without_torch_help_and_the_other_baselines_work(truths, tmp_path, check_refusal):
    """In a Python that has none of the packages."""
    code = f"import sys; sys.modules.update(dict.fromkeys({PACKAGES!r})); import cli; cli."

    def run(group: str, *arguments: object) -> Any:
        command = [sys.executable, "-c", f"{code}{group}()", *map(str, arguments)]
        return subprocess.run(
            command, capture_output=True, text=True, check=False, cwd=tmp_path, env=os.environ
        )

    assert all(name in run("pix2shape", "--help").stdout for name in COMMANDS)
    done = run("bench", "baseline", "empty-room", "--data", truths.rooms)
    assert done.returncode == 0, done.stderr
    done = run("pix2shape", "sample")
    check_refusal(
        done.returncode, done.stdout, done.stderr, ("pip install 'pix2shape-bench[model]'",)
    )

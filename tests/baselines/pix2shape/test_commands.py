"""The reference model's commands as a user types them, with and without torch; mistakes, too."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import pytest
from pix2shape_commands import bench, files_in, linked, pix2shape, train

from baselines.pix2shape.commands import PACKAGES

ROOMS, LARGE = "--data rooms.h5", "--data large.h5 --out run --workers 0"
WITH = "--weights rooms.safetensors"


@pytest.fixture
def folder(pix2shape_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder that holds links to those files."""
    monkeypatch.chdir(tmp_path)
    return linked(pix2shape_files, tmp_path)


def test_train_predict_score(folder):
    small = [f"--set={one}" for one in ("iterations=2", "batch=2", "adversarial=0", "decay=true")]
    small += ["--config", "paper", "--set=networks.size=32", "--set=networks.width=0.05"]
    made = train(*small, "--seed", 5)
    assert made.exit_code == 0, made.output
    from baselines.pix2shape.weights import open_weights

    settings = vars(open_weights(folder / "run" / "weights.safetensors")[1].settings)
    expected = {"iterations": 2, "batch": 2, "seed": 5, "decay": True}
    assert expected.items() <= settings.items()
    on = ("--data", "large.h5", "--weights", "run/weights.safetensors")
    done = pix2shape("predict", *on, "--run", "one")
    assert done.exit_code == 0, done.output
    truth = ("--truth", "large.h5")
    assert bench("validate", "predictions.h5", *truth).stdout == "predictions.h5: valid\n"
    assert "chamfer" in bench("score", "predictions.h5").stdout
    other = bench("baseline", "pix2shape-compact", *on, "--out", "b.h5")
    assert other.exit_code == 0, other.output
    with h5py.File("predictions.h5") as one, h5py.File("b.h5") as two:
        assert (one["depth"][()] == two["depth"][()]).all()
        assert (one.attrs["run"], two.attrs["run"]) == ("one", "")
    assert train("--resume").exit_code == 0


@pytest.mark.parametrize(
    ("line", "name"),
    [
        (f"sample {WITH} --n 3", "samples.png"),
        ("sample --weights classes.safetensors --class bowl --n 2", "samples.png"),
        (f"interpolate {WITH} {ROOMS} --steps 2", "interpolation.png"),
        (f"rotate {WITH} {ROOMS} --frames 3", "rotation.gif"),
    ],
)
def test_pictures(folder, line, name):
    for told in ((), ("--overwrite",)):
        done = pix2shape(*line.split(), *told)
        assert done.exit_code == 0, done.output
        assert done.stdout.startswith(name)
    assert (folder / name).stat().st_size > 1000
    refused = pix2shape(*line.split())
    assert (refused.exit_code, name in refused.stderr) == (2, True)


MISTAKES = [
    (f"predict {ROOMS} --weights rooms.h5", ("'rooms.h5'", ".safetensors")),
    (f"predict {ROOMS} --weights text.safetensors", ("text.safetensors",)),
    (f"predict {WITH} --data damaged.h5", ("damaged.h5", "image, row 5")),
    (f"sample {WITH} --class mug", ("class", "'mug'")),
    ("sample --weights classes.safetensors --class sofa", ("'sofa'", "mug, bowl")),
    ("sample --weights questions.safetensors", ("weights",)),
    (f"interpolate {WITH} {ROOMS} --items 0,8", ("items", "8")),
    (f"interpolate --weights questions.safetensors {ROOMS}", ("weights",)),
    (f"rotate {WITH} {ROOMS} --frames 2 --out x.png", ("out", "'x.png'")),
    (f"train {LARGE} --set batch", ("--set", "'batch'", "batch=8")),
    (f"train {LARGE} --set batch=2 --set batch=4", ("--set", "'batch'")),
    (f"train {LARGE} --set batch={'[' * 100_000}", ("--set",)),
    (f"train {LARGE} --set networks.sise=32", ("sise",)),
    (f"train {LARGE} --set networks.classes=3", ("classes", "--conditional")),
    (f"train {LARGE} --resume --seed 3", ("--resume",)),
]
BASELINE_MISTAKES = [
    (f"oracle {ROOMS} {WITH}", ("--weights", "oracle")),
    (f"pix2shape {ROOMS} {WITH} --train rooms.h5", ("--train",)),
    (f"pix2shape-compact {ROOMS} {WITH}", ("--weights", "pix2shape-compact")),
    ("pix2shape --data nothing.h5", ("nothing.h5",)),
]


@pytest.mark.parametrize(
    ("command", "line", "words"),
    [(pix2shape, *mistake) for mistake in MISTAKES]
    + [(bench, f"baseline {line}", words) for line, words in BASELINE_MISTAKES],
)
def test_a_mistake_is_one_line_and_leaves_nothing(command, line, words, folder, check_refusal):
    pytest.importorskip("torch")
    before = files_in(folder)
    result = command(*line.split())
    check_refusal(result.exit_code, result.stdout, result.stderr, words)
    assert files_in(folder) == before


def test_without_torch_the_other_baselines_work(truths, tmp_path, check_refusal):
    """In a Python that has none of the packages."""
    code = f"import sys; sys.modules.update(dict.fromkeys({PACKAGES!r})); import cli; cli."

    def run(group: str, *arguments: object) -> Any:
        command = [sys.executable, "-c", f"{code}{group}()", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)

    done = run("bench", "baseline", "empty-room", "--data", truths.rooms)
    assert done.returncode == 0, done.stderr
    done = run("pix2shape", "sample")
    check_refusal(done.returncode, done.stdout, done.stderr, (".[model]",))

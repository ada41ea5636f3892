"""`bench train` and `bench baseline` with trained baselines, as a user types them, and mistakes."""

from pathlib import Path

import h5py
import pytest
from pix2shape_commands import bench, files_in, linked, pix2shape

SMALL = tuple(f"--set={one}" for one in ("width=4", "size=16", "batch=2"))
DATA = "--data iqtt-train.h5"


@pytest.fixture
def folder(pix2shape_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder that holds links to rooms and questions."""
    monkeypatch.chdir(tmp_path)
    return linked(pix2shape_files, tmp_path)


@pytest.mark.parametrize("name", ["cnn", "siamese"])
def test_train_answer_score(name, folder):
    pytest.importorskip("torch")
    made = bench(
        *f"train {name} {DATA} --out run --labels 2 --iterations 2 --seed 3".split(), *SMALL
    )
    assert made.exit_code == 0, made.output
    with_it = ("--weights", "run/weights.safetensors")
    done = bench("baseline", name, "--data", "iqtt-test.h5", *with_it, "--out", "a.h5")
    assert done.exit_code == 0, done.output
    assert bench("validate", "a.h5", "--truth", "iqtt-test.h5").stdout == "a.h5: valid\n"
    with h5py.File("a.h5") as file:
        assert (file.attrs["method"], file.attrs["run"]) == (name, "2 labels, seed 3")
    assert bench("train", name, *DATA.split(), "--out", "run", "--resume").exit_code == 0


@pytest.mark.parametrize("name", ["cnn", "pix2shape"])  # all but the latter have one `train`
def test_two_runs_never_share_a_folder(name, folder):
    pytest.importorskip("torch")
    from baselines.training.checkpoint import alone_in

    reference = (pix2shape, "train", "--set=networks.size=32", "--set=networks.width=0.0625")
    train = reference if name == "pix2shape" else (bench, "train", name)
    run = Path("deep/run")
    with alone_in(run):
        done = train[0](*train[1:], "--data", "iqtt-train.h5", "--out", run)
        assert (done.exit_code, list(files_in(run))) == (2, ["deep/run/.lock"]), done.output
    assert done.stderr.startswith("Error: deep/run: ")
    assert not Path("deep").exists()


MISTAKES = [
    (f"train cnn {DATA} --out run --labels 4", ("--labels", "found 4", "1 to 3")),
    ("train cnn --data iqtt-test.h5 --out run", ("iqtt-test.h5", "no training questions")),
    (f"train cnn {DATA} --out run --set depth=34", ("depth", "18 or 50")),
    (f"train cnn {DATA} --out run", ("iqtt-train.h5", "32x32", "64")),
    (f"train cnn {DATA} --out run --set colour=1", ("--set", "'colour'")),
    (f"train cnn {DATA} --out run --resume --seed 2", ("--resume",)),
    (f"train ptm {DATA} --out run", ("ptm",)),
    (f"train cnn {DATA} --out run --minutes 5 --iterations 3", ("--minutes", "--iterations")),
    ("baseline cnn --data iqtt-test.h5", ("weights", "bench train cnn")),
    ("baseline cnn --data iqtt-test.h5 --weights rooms.safetensors", ("rooms.safetensors",)),
    ("baseline chance --data iqtt-test.h5 --weights rooms.safetensors", ("--weights", "chance")),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES)
def test_a_mistake_is_one_line_and_leaves_nothing(line, words, folder, check_refusal):
    pytest.importorskip("torch")
    before = files_in(folder)
    result = bench(*line.split())
    check_refusal(result.exit_code, result.stdout, result.stderr, words)
    assert files_in(folder) == before

"""Mistakes that a user of the reference model's commands makes: one line each, and nothing left."""

from pathlib import Path

import pytest
from h5_edits import damaged_chunk
from pix2shape_commands import bench, files_in, linked, pix2shape, train
from pix2shape_models import edited

torch = pytest.importorskip("torch")

NO_GPU = "device: found no GPU that this torch can use; say --device cpu"
ROOMS, LARGE = "--data rooms.h5", "--data large.h5 --out run --workers 0"
WITH = "--weights rooms.safetensors"


@pytest.fixture
def folder(pix2shape_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder that holds links to those files."""
    monkeypatch.chdir(tmp_path)
    return linked(pix2shape_files, tmp_path)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("predict", ("Missing option '--data'",)),
        (f"predict {WITH} --data nothing.h5", ("nothing.h5", "no such file")),
        (f"predict {WITH} --data .", (".: is a folder",)),
        (f"predict {WITH} --data rooms.json", ("rooms.json", "not a readable HDF5 file")),
        (f"predict {ROOMS} --weights nothing.safetensors", ("nothing.json: No such file",)),
        (f"predict {ROOMS} --weights nothing", ("'nothing'", "expected a .safetensors file or")),
        (f"predict {ROOMS} --weights rooms.json", ("'rooms.json'", "expected a .safetensors")),
        (f"predict {ROOMS} --weights .", ("weights: found '.'",)),
        (f"predict {ROOMS} --weights alone.safetensors", ("alone.json: No such file",)),
        (f"predict {ROOMS} --weights garbage.safetensors", ("garbage.json", "expected JSON")),
        (f"predict {ROOMS} --weights text.safetensors", ("text.safetensors", "not a safetensors")),
        (f"predict {ROOMS} --weights questions.safetensors", ("weights: a model of no camera",)),
        (f"predict {ROOMS} --weights classes.safetensors", ("weights: a model of classes",)),
        (f"predict {WITH} --data iqtt-test.h5", ("expected one for questions",)),
        (f"predict {WITH} {ROOMS} --out rooms.h5", ("rooms.h5", "--overwrite")),
        (f"predict {WITH} {ROOMS} --out none/p.h5", ("none", "does not exist")),
        (f"predict {WITH} --data damaged.h5", ("damaged.h5", "image, row 5", "cannot be read")),
        (f"predict {WITH} {ROOMS} --device tpu", ("--device", "'tpu'")),
        ("predict --weights questions.safetensors --data iqtt-train.h5", ("training questions",)),
        (f"sample {WITH} --n 0", ("--n", "0")),
        (f"sample {WITH} --class mug", ("class: found 'mug'", "expected none")),
        ("sample --weights classes.safetensors --class sofa", ("'sofa'", "one of mug, bowl")),
        ("sample --weights questions.safetensors", ("weights: a model of questions",)),
        (f"sample {WITH} --seed -1", ("--seed", "-1")),
        (f"sample {WITH} --seed 99999999999999999999", ("seed: found 99999999999999999999",)),
        (f"sample {WITH} --out x.gif", ("out: found 'x.gif'", "sheet.png")),
        (f"sample {WITH} --out none/x.png", ("none", "does not exist")),
        (f"interpolate {WITH} {ROOMS} --items 0,8", ("items: found 8", "rows from 0 to 7")),
        (f"interpolate {WITH} {ROOMS} --items 0-2", ("--items: found 3 rows, expected two",)),
        (f"interpolate {WITH} {ROOMS} --items a", ("--items", "'a'")),
        (f"interpolate {WITH} {ROOMS} --steps 1", ("--steps", "1")),
        (f"interpolate {WITH} {ROOMS} --out x.h5", ("out: found 'x.h5'",)),
        (f"interpolate {WITH} --data iqtt-test.h5", ("iqtt-test.h5: not a rooms file",)),
        (f"interpolate --weights questions.safetensors {ROOMS}", ("a model of questions",)),
        (f"rotate {WITH} {ROOMS} --items 3-9", ("items: found 8", "rows from 0 to 7")),
        (f"rotate {WITH} --data large.h5", ("items: found 3", "rows from 0 to 2")),
        (f"rotate {WITH} {ROOMS} --frames 2 --out x.png", ("out: found 'x.png'", "turn.gif")),
        (f"rotate {WITH} {ROOMS} --degrees 91", ("--degrees", "91")),
        (f"rotate --weights questions.safetensors {ROOMS}", ("a model of questions",)),
        ("train --out run", ("Missing option '--data'",)),
        ("train --data nothing.h5 --out run", ("nothing.h5", "no such file")),
        ("train --data rooms.h5 --out run", ("rooms.h5: images of 32x32", "multiple of 64")),
        (f"train {LARGE} --config huge", ("--config", "'huge'")),
        (f"train {LARGE} --set batch", ("--set", "'batch'", "such as batch=8")),
        (f"train {LARGE} --set batch=many", ("'batch=many'", "expected a number")),
        (f"train {LARGE} --set batch=1", ("batch: found 1, expected 2 or more",)),
        (f"train {LARGE} --set learning_rate=NaN", ("learning rate: found nan",)),
        (f"train {LARGE} --set seed=-1", ("seed: found -1",)),
        (f"train {LARGE} --set name=1", ("unknown field 'name'",)),
        (f"train {LARGE} --set networks.classes=3", ("classes: found 3", "--conditional")),
        (f"train {LARGE} --set networks.camera=false", ("camera: found False",)),
        (f"train {LARGE} --set betas=[1]", ("betas: found 1 values",)),
        (f"train {LARGE} --resume", ("run: holds no checkpoint",)),
        (f"train {LARGE} --resume --config paper", ("--resume goes on with the run's own",)),
        (f"train {LARGE} --resume --set batch=3", ("--resume goes on with the run's own",)),
        (f"train {LARGE} --resume --seed 3", ("--resume goes on with the run's own",)),
        (f"train {LARGE} --conditional", ("conditional: found objects (1, 3)",)),
        (f"train {LARGE} --labels 3", ("labels: found 3, expected 0 for rooms",)),
        (f"train {LARGE} --every 0", ("--every", "0")),
        (f"train {LARGE} --out rooms.json", ("rooms.json: File exists",)),
        ("train --data iqtt-train.h5 --out run --labels 9", ("labels: found 9, expected 0 to 3",)),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(line, words, folder, check_refusal):
    before = files_in(folder)
    result = pix2shape(*line.split())
    check_refusal(result.exit_code, result.stdout, result.stderr, words)
    assert files_in(folder) == before


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("nonsense=3", ("nonsense",)),
        ("networks.sise=32", ("sise",)),
        ("networks.size=48", ("size: found 48",)),
        ("networks=3", ("networks",)),
        ('batch="x"', ("batch",)),
        ("batch=null", ("batch",)),
        ("batch=2.7", ("batch",)),
        ("batch=1e999", ("batch",)),
        ("betas=3", ("betas",)),
    ],
)
def test_settings_that_are_none(setting, words, folder, check_refusal):
    result = train("--set", setting, data="rooms.h5")
    check_refusal(result.exit_code, result.stdout, result.stderr, words)


def test_networks_are_set_as_the_document_says(folder):
    small = ["--set=networks.size=32", "--set=networks.width=0.05", "--set=iterations=1"]
    done = train(*small, data="rooms.h5")
    assert done.exit_code == 0, done.output


def test_an_angle_that_is_no_number(folder, check_refusal):
    result = pix2shape(*f"rotate {WITH} {ROOMS} --degrees nan".split())
    check_refusal(result.exit_code, result.stdout, result.stderr, ("--degrees",))


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_damaged_file_is_one_line_whoever_reads_it(folder, check_refusal):
    edited(folder / "large.h5", folder / "bad.h5", damaged_chunk("image", 1))
    start = ("train", "--data", "bad.h5", "--out", "run", "--device", "cpu", "--set", "batch=2")
    result = pix2shape(*start, "--set", "iterations=5", "--workers", 1)
    check_refusal(result.exit_code, result.stdout, result.stderr, ("bad.h5", "image, row 1"))


@pytest.mark.parametrize(
    "line", [f"predict {WITH} {ROOMS} --device cuda", f"train {LARGE} --device cuda"]
)
def test_no_gpu_is_one_line(line, folder, check_refusal):
    if torch.cuda.is_available():
        pytest.skip("there is one")
    result = pix2shape(*line.split())
    check_refusal(result.exit_code, result.stdout, result.stderr, (NO_GPU,))
    assert not (folder / "run").exists()
    assert not (folder / "predictions.h5").exists()


def test_a_run_is_not_replaced(folder, check_refusal):
    (folder / "run").mkdir()
    (folder / "run" / "checkpoint.safetensors").write_text("mine")
    result = train()
    check_refusal(
        result.exit_code, result.stdout, result.stderr, ("run: holds a checkpoint", "--resume")
    )
    assert (folder / "run" / "checkpoint.safetensors").read_text() == "mine"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (f"oracle {ROOMS} {WITH}", ("--weights: oracle has none",)),
        (f"pix2shape {ROOMS} {WITH} --train rooms.h5", ("--train: pix2shape is trained already",)),
        (f"pix2shape {ROOMS} --weights nothing", ("weights: found 'nothing'",)),
        (f"pix2shape --data nothing.h5 {WITH}", ("nothing.h5: no such file",)),
        (f"pix2shape {ROOMS} {WITH} --out rooms.h5", ("rooms.h5", "--overwrite")),
        ("pix2shape --data nothing.h5", ("nothing.h5: no such file",)),
    ],
)
def test_a_mistake_with_the_baseline_is_one_line(line, words, folder, check_refusal):
    before = files_in(folder)
    result = bench("baseline", *line.split())
    check_refusal(result.exit_code, result.stdout, result.stderr, words)
    assert files_in(folder) == before

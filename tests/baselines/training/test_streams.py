"""Training on streams: what is shown, what the card tells, and what is refused."""

from dataclasses import replace

import pytest
import torch
from click.testing import CliRunner
from pix2shape_models import tiny
from refusals import refused
from safetensors.torch import load_file

import cli
from baselines.pix2shape.training.run import train_run
from baselines.pix2shape.weights import METHOD
from baselines.relief import depth_supervised
from baselines.relief.network import Settings
from baselines.training.baseline import train
from baselines.training.checkpoint import load_weights
from baselines.training.machine import Machine
from baselines.training.streams import TrainingStreams
from scenegen.common.errors import SpecError
from scenegen.description.specs import request_from_json

HERE = Machine("cpu", workers=0)
SMALL = Settings(size=32, width=0.25, iterations=2, batch=4, seed=7)
SHAPES = TrainingStreams("shapes")


def test_networks_learn_from_streams_and_their_cards_tell_it(tmp_path):
    """A run that is resumed is shown what would have come."""
    both = TrainingStreams("shapes,albedo")
    whole = train(depth_supervised.BASELINE, both, tmp_path / "whole", SMALL, HERE)
    card = load_weights(whole, depth_supervised.METHOD)[1]
    specs = [request_from_json(line) for line in card.data.splitlines()]
    assert [spec.random_reflectance for spec in specs] == [False, True]
    assert (card.rows, {spec.seed for spec in specs}) == (8, {7})
    objects = TrainingStreams("shapenet").shown(32, 7).specs
    assert [spec.object_split for spec in objects] == ["train"]

    def stop(done, total, losses):
        raise KeyboardInterrupt

    every = replace(HERE, every=1)
    with pytest.raises(KeyboardInterrupt):
        train(depth_supervised.BASELINE, both, tmp_path / "part", SMALL, every, progress=stop)
    again = train(depth_supervised.BASELINE, both, tmp_path / "part", SMALL, HERE, resume=True)
    found, expected = load_file(again), load_file(whole)
    assert all(torch.equal(found[name], expected[name]) for name in expected)
    with refused(SpecError, "shapes", "recipe hash"):
        train(depth_supervised.BASELINE, SHAPES, tmp_path / "part", SMALL, HERE, resume=True)


@pytest.mark.parametrize(
    "names",
    ["shapes", *(pytest.param(n, marks=pytest.mark.slow) for n in ("near", "shapes,shapenet"))],
)
def test_the_reference_model_learns_from_streams(names, tmp_path, monkeypatch):
    monkeypatch.setattr("baselines.pix2shape.training.beginnings.FIRST", 8)
    streams, config = TrainingStreams(names), tiny(seed=3, iterations=1)
    folder = tmp_path / "run"
    weights = train_run(folder, streams, config, replace(HERE, every=1))
    card = load_weights(weights, METHOD)[1]
    assert card.rows > 0
    with refused(SpecError, "labels"):
        train_run(tmp_path / "other", streams, config, HERE, labels=1)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("depth-supervised --stream shapes --seed 1000", "rooms-1"),
        ("depth-supervised --stream shape", "shapes"),
        ("depth-supervised --stream shapes,near", "both"),
        ("depth-supervised --stream shapes,interiors", "shapes,interiors"),
        ("depth-supervised --stream shapes --data rooms.h5", "one of"),
        ("depth-supervised", "one of"),
        ("cnn --stream near", "--stream"),
    ],
)
def test_what_is_refused(words, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rooms.h5").touch()
    done = CliRunner().invoke(cli.bench, ["train", *words.split(), "--out", "run"])
    assert done.exit_code == 2
    assert told in done.output

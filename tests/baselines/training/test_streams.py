"""Training on streams: what is shown, what the card tells, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from pix2shape_models import tiny
from refusals import refused
from safetensors.torch import load_file

import cli
from baselines.depth_match import training as depth_match
from baselines.pix2shape.training.run import train_run
from baselines.pix2shape.weights import METHOD
from baselines.relief import depth_supervised, view_pairs
from baselines.relief.network import Settings
from baselines.training.baseline import train
from baselines.training.checkpoint import load_weights
from baselines.training.machine import Machine
from baselines.training.streams import TrainingStreams
from scenegen import RoomStream
from scenegen.common.errors import SpecError
from scenegen.description.specs import request_from_json
from scenegen.rooms.make import MAX_COUNT

HERE = Machine("cpu", workers=0)
SMALL = Settings(size=32, width=0.25, iterations=2, batch=4, seed=7)
SHAPES = TrainingStreams("shapes")


def test_blocks_are_rows_beyond_those_of_any_file():
    shown = SHAPES.shown(32, 7)
    block = next(shown.blocks(8, 4, 0))
    spec = request_from_json(shown.card()["data"])
    start = MAX_COUNT + 8
    (rows,) = RoomStream(spec, fields=["image", "depth"], batch=4, start=start, stop=start + 4)
    assert block.read("scene_index", slice(None)).tolist() == list(range(start, start + 4))
    for name, values in rows.items():
        np.testing.assert_array_equal(block.read(name, slice(None)), values)
    assert (spec.seed, len(block), block.height) == (7, 4, 32)


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
    with refused(SpecError, "shapes", "fingerprint"):
        train(depth_supervised.BASELINE, SHAPES, tmp_path / "part", SMALL, HERE, resume=True)


@pytest.mark.slow
def test_view_pairs_are_of_whole_scenes(tmp_path):
    settings = replace(SMALL, iterations=1, batch=10)
    weights = train(view_pairs.BASELINE, SHAPES, tmp_path / "run", settings, HERE)
    assert load_weights(weights, view_pairs.BASELINE.method)[1].rows == 18
    assert {path.name for path in (tmp_path / "run").iterdir()} == {
        "checkpoint.safetensors", "weights.safetensors"
    }  # fmt: skip


@pytest.mark.slow
def test_depth_match_learns_from_a_stream(tmp_path):
    settings = depth_match.Settings(size=32, width=0.25, iterations=1, batch=6)
    streams = TrainingStreams("near")
    weights = train(depth_match.BASELINE, streams, tmp_path / "run", settings, HERE)
    assert load_weights(weights, depth_match.METHOD)[1].rows == 2


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
        ("depth-supervised --stream shapes --data rooms.h5", "one of them"),
        ("depth-supervised", "one of them"),
        ("cnn --stream near", "--stream"),
    ],
)
def test_what_is_refused(words, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rooms.h5").touch()
    done = CliRunner().invoke(cli.bench, ["train", *words.split(), "--out", "run"])
    assert done.exit_code == 2
    assert told in done.output

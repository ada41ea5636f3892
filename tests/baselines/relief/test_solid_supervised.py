"""Thickness is learned from layers, and predicted from masks and visible surfaces alone."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from h5_edits import values
from pix2shape_models import edited
from refusals import refused

from baselines.relief.network import Card, Settings
from baselines.relief.solid_supervised import BASELINE, lessons_of, read_solids, views_of
from baselines.training.baseline import train, write_submission
from baselines.training.checkpoint import bundled, load_weights
from baselines.training.data import TrainingFiles
from metrics.scoring.evaluate import score
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.withheld import withhold_truth

SMALL = Settings(size=32, width=0.1, iterations=2, batch=2)


@pytest.fixture(scope="module")
def layered(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("layered") / "rooms.h5"
    return make_rooms(path, 3, height=32, width=32, truth=("layers",), shapes=("box", "sphere"))


def predicted(data: Path, out: Path, weights: Path) -> np.ndarray:
    write_submission(BASELINE, data, out, weights, overwrite=True)
    with h5py.File(out) as file:
        return file["layers"][()]


def test_targets_are_where_rays_leave(layered):
    with RoomsFile(layered) as rooms:
        read = read_solids([rooms], 32)
        true, weight = lessons_of(read, SMALL, None, None).target(torch.arange(3))
        depth, ids = (rooms.read(f"layers/{x}", slice(None)) for x in ("depth", "object_id"))
    shown = ids[..., 0] > 0
    np.testing.assert_array_equal(weight > 0, shown)
    np.testing.assert_allclose(true[shown], (depth[..., 1] - depth[..., 0])[shown], atol=1e-6)
    np.testing.assert_allclose((true * weight).sum(dim=(1, 2)), 1, rtol=1e-5)  # images count alike
    np.testing.assert_array_equal(read.image[:, 0].numpy()[shown], depth[..., 0][shown])


def test_hidden_layers_and_images_are_not_read(layered, tmp_path):
    with TrainingFiles(layered) as files:
        weights = train(BASELINE, files, tmp_path / "run", SMALL)
    found = predicted(layered, tmp_path / "p.h5", weights)
    names = ("image", "layers/depth", "layers/object_id", "layers/entering")
    blank = edited(layered, tmp_path / "b.h5", *(values(name, np.zeros_like) for name in names))
    np.testing.assert_array_equal(predicted(blank, tmp_path / "q.h5", weights), found)
    with RoomsFile(layered) as rooms:
        np.testing.assert_array_equal(found[..., 0], rooms.read("depth", slice(None)))
        shown = rooms.read("object_id", slice(None)) > 0
    np.testing.assert_array_equal(np.isfinite(found[..., 1]), shown)


def test_larger_images_are_taken_in_parts(layered, make_rooms, tmp_path):
    large = make_rooms(tmp_path / "large.h5", 1, height=64, width=64)
    torch.manual_seed(0)
    network = BASELINE.method.network(Card("x", SMALL)).eval()
    with RoomsFile(large) as rooms, torch.inference_mode():
        ((_, arrays),) = views_of(network, Card("x", SMALL), rooms).predicted
        depth, ids = rooms.read("depth", 0), rooms.read("object_id", 0)
    np.testing.assert_array_equal(arrays["layers"][0, ..., 0], depth)
    np.testing.assert_array_equal(np.isfinite(arrays["layers"][0, ..., 1]), ids > 0)


def test_files_without_layers_or_truth_are_refused(layered, turned_path, tmp_path):
    with TrainingFiles(turned_path) as files, refused(SpecError, "turned.h5", "no layers"):
        train(BASELINE, files, tmp_path / "run", SMALL)
    withhold_truth(layered, bare := tmp_path / "bare.h5")
    network = BASELINE.method.network(Card("x", SMALL))
    with RoomsFile(bare) as rooms, refused(SpecError, "bare.h5"):
        views_of(network, Card("x", SMALL), rooms)


def test_bundled_weights_beat_the_shortcuts(make_rooms, tmp_path):
    """On unseen rooms; docs/solids.md has the skill of 300 images."""
    path = bundled(BASELINE.files, BASELINE.method)
    assert path.stat().st_size < 2_000_000
    card = load_weights(path, BASELINE.method)[1]
    assert card.iteration == card.settings.iterations
    rooms = make_rooms(tmp_path / "r.h5", 12, height=64, width=64, seed=77, truth=("layers",))
    write_submission(BASELINE, rooms, tmp_path / "p.h5")
    skill = score([tmp_path / "p.h5"], rooms).skills["solid_iou"]
    assert skill.value > 0

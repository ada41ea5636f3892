"""Rooms as batches: what the file holds, as the networks take it, and no ground truth."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from h5_edits import put
from pix2shape_models import edited, room_source, tiny
from refusals import refused
from torch.utils.data import default_collate

from baselines.pix2shape.network.surfels import render
from scenegen.common.errors import FileFormatError, SpecError

TOLD = {"light_position", "light_color", "ambient", "attenuation", "reflectance"}


@pytest.fixture(scope="session")
def views_path(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of 3 rooms seen twice, 64x64, float32."""
    path = tmp_path_factory.mktemp("data") / "views.h5"
    size = {"height": 64, "width": 64, "object_radius": (0.08, 0.16)}
    look = {"attenuation": (0.2, 0.7), "ambient": (0.1, 0.2, 0.3), "light_saturation": 1.0}
    look |= dict.fromkeys(("reflectance", "room_reflectance"), (0.8, 0.7, 0.6))
    return make_rooms(path, 3, **size, **look, views=(0.0, 35.0), image_dtype="float32")


def test_the_truth_shaded_with_what_is_told_is_the_image(views_path):
    """Lights, camera and material are those of the image: the renderer's own hits prove it."""
    source = room_source(views_path, tiny())
    batch = source.as_batch(default_collate([source[row] for row in range(len(source))]))
    with h5py.File(views_path) as file:
        depth, normal = torch.tensor(file["depth"][:]), torch.tensor(file["normal"][:])
        expected = file["image"][:]
    assert (batch.views.scene.light_color != 0).any(dim=2).sum(dim=1).unique().numel() > 1
    image = render(depth, batch.views.scene, normal.permute(0, 3, 1, 2)).permute(0, 2, 3, 1)
    np.testing.assert_allclose(image, expected, rtol=4e-5, atol=4e-5)


@pytest.mark.parametrize(
    ("name", "place", "value"),
    [
        ("camera/world_from_camera", (2, 1, 3), np.nan),
        ("camera/world_from_camera", (2, 1, 3), 1e30),
        ("camera/world_from_camera", 2, np.zeros((4, 4))),
        ("camera/world_from_camera", 2, np.diag([1, 1, -1, 1])),
        ("camera/world_from_camera", (2, 3, 0), 1),
        ("light/position", (2, 0, 0), np.inf),
        ("light/color", (2, 0, 0), np.nan),
        ("light/attenuation", 2, 0),
        ("image", (2, 5, 5, 0), np.nan),
        ("image", (2, 5, 5, 0), 1e30),
    ],
)
def test_what_networks_cannot_be_told_is_refused(name, place, value, make_rooms, tmp_path):
    """Not finite or absurd: it would crash training, or look like any other number."""
    path = make_rooms(tmp_path / "rooms.h5", 4, image_dtype="float32")
    path = edited(path, tmp_path / "bad.h5", put(name, place, value))
    with refused(FileFormatError, f"{path}: {name}, row 2"):
        room_source(path, tiny())[2]


def test_depth_is_read_only_for_supervision(views_path, tmp_path):
    item = room_source(views_path, tiny())[0]
    assert set(item) == TOLD | {"image", "condition", "world_from_camera"}
    path = edited(views_path, tmp_path / "hole.h5", put("depth", (1, 7, 10), np.nan))
    source = room_source(path, tiny(depth=1.0))
    with h5py.File(path) as file:
        parts = [file["depth"][1][i::2, j::2] for i in (0, 1) for j in (0, 1)]
    item = source[1]
    np.testing.assert_allclose(item["depth"], sum(parts) / 4, rtol=1e-6)
    assert np.argwhere(np.isnan(item["depth"])).tolist() == [[3, 5]]
    batch = source.as_batch(default_collate([source[0], item]))
    assert batch.depth.shape == (2, 32, 32)
    plain = room_source(path, tiny())
    assert plain.as_batch(default_collate([plain[1]])).depth is None


@pytest.mark.parametrize(
    ("classes", "rooms", "found"),
    [
        (0, {"random_reflectance": True}, "rooms of several materials"),
        (0, {"room_reflectance": (0.4, 0.6, 0.85)}, "rooms of several materials"),
        (0, {"specular": (0.3, 0.8), "shininess": (8.0, 64.0)}, "rooms of several materials"),
        (0, {"height": 96, "width": 128}, "images of 96x128"),
        (0, {"height": 50, "width": 50}, "images of 50x50"),
        (0, {"height": 16, "width": 16, "min_visible_pixels": 1}, "images of 16x16"),
        (3, {"objects": (1, 1), "shapes": ("box", "sphere")}, "2 classes"),
        (2, {"objects": (1, 2), "shapes": ("box", "sphere")}, "rooms of several objects"),
    ],
)
def test_rooms_that_do_not_suit_are_refused(make_rooms, tmp_path, classes, rooms, found):
    path = make_rooms(tmp_path / "odd.h5", 3, **rooms)
    with refused(SpecError, str(path), found):
        room_source(path, tiny(classes=classes))

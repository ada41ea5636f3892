"""Sheets and animations: what stands where, files that other programs read, nothing disturbed."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image
from pix2shape_models import made, room_source, tiny
from torch.utils.data import default_collate

from baselines.pix2shape import pictures
from baselines.pix2shape.batch import Batch
from baselines.pix2shape.network.surfels import normals_from_depth
from baselines.pix2shape.pictures import drawn, image_tiles, save_pictures, sheet
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.rooms.preview import srgb_bytes

GAP, TILE = 6, 128
PAPER = (250, 250, 250)


@pytest.fixture
def batch(rooms_path: Path) -> Batch:
    source = room_source(rooms_path, tiny())
    return source.as_batch(default_collate([source[row] for row in range(5)]))


def noise(side: int, seed: int) -> Any:
    return np.random.default_rng(seed).integers(0, 255, (side, side, 3), "u1")


def frame(shade: int) -> Image.Image:
    """Return a picture with a bar whose place tells which frame it is."""
    values = np.full((40, 60, 3), 200, np.uint8)
    values[:, shade : shade + 4] = 10
    return Image.fromarray(values)


@pytest.mark.parametrize(
    ("side", "factor"), [(32, 4), (64, 2), (100, 2), (127, 2), (128, 1), (256, 1)]
)
def test_tiles_stand_in_lines_and_small_ones_are_enlarged(side, factor):
    rows = [[noise(side, 0), noise(side, 1), noise(side, 2)], [noise(side, 3)]]
    picture = np.asarray(sheet(rows))
    large = side * factor
    assert large >= TILE
    assert picture.shape == (2 * (large + GAP) + GAP, 3 * (large + GAP) + GAP, 3)
    left = np.full(picture.shape, PAPER)
    for y, row in enumerate(rows):
        for x, pixels in enumerate(row):
            whole = pixels.repeat(factor, axis=0).repeat(factor, axis=1)
            top, start = GAP + y * (large + GAP), GAP + x * (large + GAP)
            left[top : top + large, start : start + large] = whole
    assert (picture == left).all()


def test_images_depths_and_normals_of_codes(batch):
    model = made(tiny())
    code = torch.randn(5, 128, generator=torch.Generator().manual_seed(0))
    images, depths, normals = drawn(model, code, batch.views)
    with torch.no_grad():
        depth = model.surfels(code, batch.views.condition).depth
        radiance = model.image(code, batch.views)
    facing = normals_from_depth(depth, batch.views.scene.fov_y_degrees)
    for i in range(5):
        assert (images[i] == srgb_bytes(radiance[i].permute(1, 2, 0).numpy())).all()
        near, far = depth[i].argmin(), depth[i].argmax()
        assert depths[i].shape == (32, 32, 3)
        assert (depths[i].reshape(-1, 3)[near] == 0).all()
        assert (depths[i].reshape(-1, 3)[far] == 255).all()
        again = torch.from_numpy(normals[i]) / 127.5 - 1
        torch.testing.assert_close(again.permute(2, 0, 1), facing[i], atol=0.005, rtol=0)
    assert (images[0] == image_tiles(radiance[:1])[0]).all()


def test_what_is_not_finite_is_not_drawn(batch):
    model = made(tiny())
    dark = replace(batch.views.scene, ambient=batch.views.scene.ambient * torch.nan)
    with pytest.raises(SceneGenError):
        drawn(model, torch.zeros(5, 128), replace(batch.views, scene=dark))


def test_nothing_is_drawn_where_rays_meet_nothing(batch):
    model = made(tiny(opacity=True))
    code = torch.randn(5, 128, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        raw = model.decoder(code, batch.views.condition)[:, 1]
        model.decoder.last.bias[1] -= raw.median()
        opacity = model.surfels(code, batch.views.condition).opacity
    away = (opacity < 0.5).numpy()
    assert 0.05 < away.mean() < 0.95
    _, depths, normals = drawn(model, code, batch.views)
    assert (np.array(depths)[away] == 0).all()
    assert (np.array(normals)[away] == 128).all()
    assert (np.array(normals)[~away] != 128).any()


@pytest.mark.parametrize(
    ("name", "count"), [("turn.gif", 2), ("turn.gif", 6), ("turn.GIF", 3), ("turn.webp", 3)]
)
def test_an_animation_goes_there_and_back(tmp_path, name, count):
    save_pictures([frame(8 * k) for k in range(count)], tmp_path / name)
    there = list(range(count))
    with Image.open(tmp_path / name) as found:
        assert found.n_frames == 2 * count - 2
        assert (found.info["loop"], found.size) == (0, (60, 40))
        for place, k in enumerate(there + there[-2:0:-1]):
            found.seek(place)
            shown = np.asarray(found.convert("RGB")).astype(int)
            assert np.abs(shown - np.asarray(frame(8 * k)).astype(int)).mean() < 4, place
            assert found.info["duration"] == 80


@pytest.mark.parametrize(
    ("count", "name"),
    [(3, "turn.png"), (3, "turn"), (3, "turn.gif.h5"), (1, "one.gif"), (1, "one")],
)
def test_endings_that_do_not_suit_are_refused(tmp_path, count, name):
    with pytest.raises(SpecError, match=f"out: found '{name}'"):
        save_pictures([frame(k) for k in range(count)], tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("adversarial", [0.0, 1.0])
def test_what_training_is_watched_by(batch, adversarial):
    """Six lines; running statistics, not the batch's, so an image looks the same in any company."""
    model = made(tiny(adversarial=adversarial)).train()
    codes = torch.randn(5, 128, generator=torch.Generator().manual_seed(0))
    state = torch.get_rng_state()
    before = {name: value.clone() for name, value in model.state_dict().items()}
    found = pictures.training_sheet(model, batch, codes, columns=3)
    assert torch.equal(torch.get_rng_state(), state), "training is not disturbed"
    assert all(module.training for module in model.modules())
    assert all(torch.equal(value, before[name]) for name, value in model.state_dict().items())
    model.eval()
    with torch.no_grad():
        own = model.encode(batch.image, batch.views)
    other = codes if adversarial else own.roll(1, 0)
    lines = [image_tiles(batch.image), *drawn(model, own, batch.views)]
    lines += drawn(model, other, batch.views)[:2]
    expected = sheet([line[:3] for line in lines])
    assert found.size == expected.size == (3 * (TILE + GAP) + GAP, 6 * (TILE + GAP) + GAP)
    assert found.tobytes() == expected.tobytes()
    assert pictures.training_sheet(model, batch, codes).size[0] == 5 * (TILE + GAP) + GAP

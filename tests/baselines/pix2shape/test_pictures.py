"""Sheets and animations: what stands where, files that other programs read, nothing disturbed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from pix2shape_models import made, room_source, tiny
from torch.utils.data import default_collate

from baselines.pix2shape.batch import Batch
from baselines.pix2shape.pictures import drawn, save_pictures
from scenegen.common.errors import SceneGenError


@pytest.fixture
def batch(rooms_path: Path) -> Batch:
    source = room_source(rooms_path, tiny())
    return source.as_batch(default_collate([source[row] for row in range(5)]))


def frame(shade: int) -> Image.Image:
    """Return a picture with a bar whose place tells which frame it is."""
    values = np.full((40, 60, 3), 200, np.uint8)
    values[:, shade : shade + 4] = 10
    return Image.fromarray(values)


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

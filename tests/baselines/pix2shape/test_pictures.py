"""Sheets and animations: what stands where, files that other programs read, nothing disturbed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from pix2shape_models import made, room_source, tiny
from torch.utils.data import default_collate

from baselines.pix2shape.images import Batch
from baselines.pix2shape.pictures import drawn
from scenegen.common.errors import SceneGenError


@pytest.fixture
def batch(rooms_path: Path) -> Batch:
    source = room_source(rooms_path, tiny())
    return source.as_batch(default_collate([source[row] for row in range(5)]))


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

"""Turned pictures against pictures of turned surfaces under turned lights."""

import math
from dataclasses import replace

import pytest
import torch

from baselines.pix2shape.images import Batch, turned
from baselines.pix2shape.network.model import Surfels, Views, shaded
from baselines.pix2shape.network.surfels import Scene


def surface():
    """Return the depth of a tilted, curved surface, and the image of it under two lights."""
    source = torch.Generator().manual_seed(0)
    rows, columns = torch.meshgrid(*[torch.linspace(-1, 1, 32)] * 2, indexing="ij")
    depth = (3 + 0.2 * columns - 0.1 * rows + 0.1 * rows**2)[None]
    position = torch.rand(1, 2, 3, generator=source) * 2 - 1
    colour, ones = torch.rand(1, 2, 3, generator=source), torch.ones(1, 3)
    attenuation = torch.tensor([[0.0, 1.0]])
    scene = Scene(28.0, position, colour, 0.1 * ones, attenuation, 0.8 * ones)
    views = Views(torch.empty(1, 0), scene, background=ones)
    return depth, Batch(shaded(Surfels(depth), views), views)


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
@pytest.mark.parametrize("mirror", [False, True])
def test_a_turned_picture_is_that_of_the_turned_surface(quarters, mirror):
    depth, batch = surface()
    found = turned(batch, torch.tensor([quarters * math.pi / 2]), torch.tensor([mirror]))
    there = (depth.flip(2) if mirror else depth).rot90(quarters, (1, 2))
    expected = shaded(Surfels(there), found.views)
    assert torch.allclose(found.image, expected, atol=1e-4)
    assert torch.allclose(shaded(Surfels(depth), batch.views), batch.image, atol=1e-6)
    if quarters or mirror:
        wrong = replace(found.views, scene=batch.views.scene)
        assert (shaded(Surfels(there), wrong) - found.image).abs().max() > 1e-2

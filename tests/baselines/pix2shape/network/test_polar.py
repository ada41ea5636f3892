"""The polar encoder: where a pixel lands, and what turning a picture does to a code."""

import math

import pytest
import torch

from baselines.pix2shape.network.architecture import NetworkSpec
from baselines.pix2shape.network.polar import PolarEncoder

SPEC = NetworkSpec(
    size=32, width=0.02, z_scene=6, z_view=2, camera=False, spherical=True, encoder="polar"
)


def shapes(count=4):
    """Return images of one light block each on white, off the centre but within the circle."""
    image = torch.ones(count, 3, 32, 32)
    source = torch.Generator().manual_seed(0)
    for one in image:
        row, column = torch.randint(6, 17, (2,), generator=source).tolist()
        one[:, row : row + 9, column : column + 6] = 0.9 * torch.rand(3, 9, 6, generator=source)
    return image


def test_a_turned_picture_has_the_same_scene_and_another_view():
    torch.manual_seed(0)
    encoder, nothing = PolarEncoder(SPEC).eval(), torch.empty(4, 0)
    with torch.no_grad():
        code, turned, mirrored = (
            encoder(image, nothing)
            for image in (shapes(), shapes().rot90(1, (2, 3)), shapes().flip(3))
        )
    assert torch.allclose(turned[:, :6], code[:, :6], atol=1e-4)
    assert (turned[:, 6:] - code[:, 6:]).abs().max() > 1e-2
    assert (mirrored[:, :6] - code[:, :6]).abs().max() > 1e-2, "handedness is seen"
    assert code[:, :6].norm(dim=1) == pytest.approx(math.sqrt(6), rel=1e-5)

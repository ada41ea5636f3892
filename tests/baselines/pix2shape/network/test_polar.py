"""The polar encoder: where a pixel lands, and what turning a picture does to a code."""

import math

import pytest
import torch

from baselines.pix2shape.network.architecture import NetworkSpec
from baselines.pix2shape.network.polar import PolarEncoder, polar

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


@pytest.mark.parametrize(("row", "column"), [(16, 28), (28, 16), (4, 15), (15, 4)])
def test_a_pixel_lands_at_its_angle_and_radius(row, column):
    """Angles go from the right downwards, and the radius ends at the middle of a side."""
    image = torch.zeros(1, 1, 32, 32)
    image[0, 0, row, column] = 1.0
    found = polar(image)[0, 0]
    assert found.shape == (32, 12)
    angle, radius = divmod(int(found.argmax()), 12)
    x, y = column + 0.5 - 16, row + 0.5 - 16
    assert (radius + 0.5) / 12 * 16 == pytest.approx(math.hypot(x, y), abs=1.4)
    off = (angle + 0.5) / 32 * 2 * math.pi - math.atan2(y, x)
    assert math.cos(off) > math.cos(0.2)


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

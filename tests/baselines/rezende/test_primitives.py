"""Rendered primitives: their cameras and lights are those that the rasteriser is told."""

import numpy as np
import pytest
from refusals import refused

from baselines.rezende import primitives
from baselines.rezende.primitives import PRIMITIVE_SETS, PrimitiveSet, render_primitives
from baselines.rezende.rasteriser import rasterise
from baselines.rezende.sphere import icosphere
from scenegen.camera import pixel_directions
from scenegen.common.errors import SpecError


def sphere_of(depth, pictures):
    """Return centre and radius of the sphere with these depths, frame of the rasteriser."""
    shown = np.isfinite(depth)
    size = pictures.views.size
    rays = pixel_directions(size, size, pictures.views.fov_y_degrees)[shown]
    points = rays * depth[shown][:, None] + [0, 0, pictures.views.distance]
    rows = np.c_[2 * points, np.ones(len(points))]
    x, y, z, rest = np.linalg.lstsq(rows, (points**2).sum(axis=1), rcond=None)[0]
    return np.array([x, y, z]), np.sqrt(rest + x * x + y * y + z * z)


@pytest.mark.parametrize(
    "case",
    [PrimitiveSet(), PrimitiveSet(radius=0.5, offset=0.7), PrimitiveSet(room=True)],
    ids=["centred", "off-centre", "room"],
)
def test_a_sphere_put_where_the_depth_says_has_the_colours_of_the_image(case, monkeypatch):
    case = PrimitiveSet(("sphere",), case.radius, case.offset, case.room)
    monkeypatch.setitem(primitives.PRIMITIVE_SETS, "balls", case)
    pictures = render_primitives("balls", 3, 32, seed=1)
    vertices, faces = icosphere(4)
    for row in range(3):
        centre, radius = sphere_of(pictures.depth[row], pictures)
        if not case.room:
            assert radius == pytest.approx(case.radius, rel=1e-3)
            assert np.linalg.norm(centre[:2]) == pytest.approx(case.offset, abs=1e-3)
        mesh = (centre + radius * vertices)[None]
        image, depth = rasterise(mesh, faces, pictures.views_of(np.array([row])))
        both = np.isfinite(depth[0]) & np.isfinite(pictures.depth[row])
        assert both.sum() > 0.95 * np.isfinite(depth[0]).sum() > 50
        np.testing.assert_allclose(depth[0][both], pictures.depth[row][both], atol=0.05 * radius)
        difference = abs(image[0] - np.moveaxis(pictures.image[row], 0, 2))[both]
        assert np.median(difference) < 0.01  # at outlines images are averages of both sides


def test_items_depend_on_seed_and_index_alone():
    several = render_primitives("complex", 4, 16, seed=3)
    alone = render_primitives("complex", 2, 16, seed=3, first=2)
    np.testing.assert_array_equal(several.image[2:], alone.image)
    assert several.fingerprint != alone.fingerprint
    other = render_primitives("complex", 4, 16, seed=4)
    assert (several.image != other.image).any(axis=(1, 2, 3)).all()


def test_the_sets_are_what_they_are_called():
    shares = {}
    for name in PRIMITIVE_SETS:
        pictures = render_primitives(name, 12, 16)
        shown = np.isfinite(pictures.depth)
        shares[name] = shown.mean()
        corner = pictures.image[:, :, 0, 0]
        assert (corner < 0.99).any() == (name == "background")
        columns = shown.any(axis=1) @ np.arange(16) / shown.any(axis=1).sum(axis=1) - 7.5
        assert (abs(columns) > 2.5).any() == (name in ("off-centre", "background"))
    assert shares["off-centre"] < 0.5 * shares["centred"]


def test_an_unknown_set_is_refused():
    with refused(SpecError, "set of primitives", "'cubes'", "centred"):
        render_primitives("cubes", 1, 16)

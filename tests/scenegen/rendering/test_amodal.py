"""Whole silhouettes, also beyond the image."""

import numpy as np

from scenegen.camera import Camera
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.amodal import amodal_masks, wide_masks
from scenegen.rendering.packing import pack

GREY = (0.8, 0.8, 0.8)


def batch(fov: float, side: int):
    """Return a cube and a cone at two borders of the image of 32 pixels and 20 degrees."""
    camera = Camera((2.0, 1.2, 2.5), (0.5, 0.4, 0.5), fov)
    turn = (0.8, 0.0, 0.6, 0.0)
    items = (
        PlacedObject("box", (0.4, 0.05, 0.5), turn, 0.3, GREY),
        PlacedObject("cone", (1.0, 0.5, 0.3), turn, 0.2, GREY),
    )
    scene = SceneSpec(0, (camera,), items, (), (0.1,) * 3, (0.5, 0.5), GREY)
    spec = DatasetSpec(height=side, width=side, objects=(2, 2), shapes=("box", "cone"))
    return pack(spec, [scene])


def test_on_the_wide_canvas_are_the_rays_of_a_camera_that_sees_three_times_as_much():
    """Its image plane is the same, and so are its pixels."""
    narrow = batch(20.0, 32)
    wide = np.degrees(2 * np.arctan(3 * np.tan(np.radians(10.0))))
    found, expected = wide_masks(narrow)[0], amodal_masks(batch(float(wide), 96))[0]
    for mask, whole in zip(found, expected, strict=True):
        cut = mask[32:64, 32:64].sum()
        assert 0 < cut < 0.9 * mask.sum()
        assert (mask != whole).sum() <= 2
    np.testing.assert_array_equal(found[:, 32:64, 32:64], amodal_masks(narrow)[0])

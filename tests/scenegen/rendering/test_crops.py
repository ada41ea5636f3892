"""Off-centre principal points and wide pixels: the truth of a crop is cut from a larger image."""

from dataclasses import replace

import numpy as np
import pytest

from scenegen.description.presets import preset_spec
from scenegen.rendering.amodal import amodal_masks, wide_masks
from scenegen.rendering.layers import layers_of
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import launch_fields
from scenegen.sampling.scenes import sample_scene

NAMES = ("depth", "normal", "object_id")
LARGE, TOP, LEFT, SIZE = (72, 96), 24, 30, (36, 30)
WIDE = 3  # pixels of the larger image side by side, of which a wide pixel has the middle


@pytest.fixture(scope="module", params=["shapes", "shapenet", "interiors"])
def batches(request):
    """Return a scene as a larger image shows it, and as a crop with wide pixels."""
    spec = preset_spec(request.param, height=LARGE[0], width=LARGE[1], min_visible_pixels=0)
    whole = pack(spec, [sample_scene(spec, 0)])
    return whole, cropped(whole)


def cropped(whole):
    (height, width), fov = SIZE, np.radians(whole.fov_y_degrees[0])
    middle = (LARGE[1] / 2 - LEFT) / width, (LARGE[0] / 2 - TOP) / height
    crop = replace(whole.spec, height=height, width=width // WIDE, principal_point=middle,
                   pixel_aspect=WIDE)  # fmt: skip
    narrower = 2 * np.degrees(np.arctan(height / LARGE[0] * np.tan(fov / 2)))
    return replace(whole, spec=crop, fov_y_degrees=np.array([narrower]))


def cut(values):
    """Return the part of a larger image (H, W, ...) that the crop shows."""
    return values[TOP : TOP + SIZE[0], LEFT + 1 : LEFT + SIZE[1] : WIDE]


def test_truth_is_that_of_the_larger_image(batches):
    whole, crop = (launch_fields(batch, NAMES)() for batch in batches)
    for name in NAMES:
        np.testing.assert_allclose(crop[name][0], cut(whole[name][0]), rtol=1e-5, atol=1e-4)
    assert len(np.unique(crop["object_id"])) > 1


def test_layers_and_masks_are_those_of_the_larger_image(batches):
    pixels = [launch_fields(batch, NAMES)() for batch in batches]
    whole, crop = (
        layers_of(batch, 0, truth["depth"][0], truth["object_id"][0])
        for batch, truth in zip(batches, pixels, strict=True)
    )
    np.testing.assert_array_equal(crop.object_id, cut(whole.object_id))
    np.testing.assert_allclose(crop.depth, cut(whole.depth), rtol=1e-5)
    masks, larger = amodal_masks(batches[1])[0], amodal_masks(batches[0])[0]
    np.testing.assert_array_equal(masks, [cut(mask) for mask in larger])
    wide = wide_masks(batches[1])[0]
    seen = np.s_[:, SIZE[0] - TOP : SIZE[0] - TOP + LARGE[0], : SIZE[1] // WIDE]
    np.testing.assert_array_equal(wide[seen], larger[:, :, LEFT - SIZE[1] + 1 : LEFT : WIDE])


def test_images_are_those_of_the_larger_image():
    spec = preset_spec("shapes", height=LARGE[0], width=LARGE[1], image_dtype="float32")
    whole = pack(spec, [sample_scene(spec, 0)])
    images = [launch_fields(batch, ("image",))()["image"][0] for batch in (whole, cropped(whole))]
    np.testing.assert_allclose(images[1], cut(images[0]), atol=1e-4)


def test_traced_images_show_the_same():
    spec = preset_spec("interiors", height=LARGE[0], width=LARGE[1], spp=1, truth=("albedo",))
    whole = pack(spec, [sample_scene(spec, 0)])
    larger, crop = (
        launch_fields(batch, ("albedo",))()["albedo"][0] for batch in (whole, cropped(whole))
    )
    same = np.isclose(crop, cut(larger), atol=1e-3, equal_nan=True).all(axis=-1)
    assert same.mean() > 0.99

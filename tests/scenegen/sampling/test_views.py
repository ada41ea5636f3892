"""Several views of a scene: turned by just so much, all in the octant, and all of one scene."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest, kstest

from scenegen import open_rooms
from scenegen.camera import look_at
from scenegen.common.errors import SpecError
from scenegen.description.specs import DatasetSpec
from scenegen.sampling.cameras import sample_cameras
from scenegen.sampling.scenes import sample_scene, sample_scenes

ANGLES = (0.0, 5.0, 35.0, 55.0, 80.0)
MANY = DatasetSpec(views=ANGLES, seed=4)
TINY = {
    "views": ANGLES, "objects": (2, 2), "object_radius": (0.08, 0.15), "min_visible_pixels": 8,
    "height": 64, "width": 64, "image_dtype": "float32", "random_reflectance": True, "seed": 4,
}  # fmt: skip


def offsets(spec, index):
    """From the target to each camera."""
    return sample_cameras(spec, np.array([index]))[0] - spec.camera_target


def test_each_scene_draws_its_field_of_view_from_a_range(make_rooms, tmp_path):
    """All else is as in a set where this is the only field of view."""
    ranged = {**TINY, "height": 32, "width": 32, "fov_degrees": 20.0, "fov_spread_degrees": 40.0}
    path = make_rooms(tmp_path / "x.h5", 12, **ranged)
    with open_rooms(path) as rooms:
        fov = rooms.read("camera/fov_y_degrees", slice(None)).reshape(12, 5)
        assert (fov == fov[:, :1]).all()
        assert len(np.unique(fov)) == 12
        assert (fov.min() > 20) & (fov.max() < 60) & (np.ptp(fov) > 20)
        with pytest.raises(SpecError):
            _ = rooms.spec.fov_y_degrees
    spec = DatasetSpec(**ranged)
    proposed, scenes = sample_scenes(spec, np.arange(12), np.zeros(12, int))
    assert proposed.sum() > 6
    for item in np.flatnonzero(proposed).tolist():
        alone = replace(spec, fov_degrees=fov[item, 0], fov_spread_degrees=0.0)
        assert sample_scene(alone, item) == scenes.scene(proposed[:item].sum())


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 2**62),
    st.lists(st.floats(0.01, 80.0), max_size=6, unique=True).map(sorted),
    st.floats(1.3, 5.0),
)
def test_cameras_turn_about_the_vertical_by_the_angles_asked_for(seed, turns, radius):
    """At one height and distance, all one way, all looking at the target with level heads."""
    spec = DatasetSpec(views=(0.0, *turns), seed=seed, camera_radius=radius)
    away = offsets(spec, 3)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), radius, rtol=1e-12)
    np.testing.assert_allclose(away[:, 1], away[0, 1], rtol=1e-12)
    assert away.min() >= -1e-12, "nobody looks from behind a wall"
    flat = away[:, [0, 2]] / np.linalg.norm(away[:, [0, 2]], axis=1, keepdims=True)
    across = flat[0, 0] * flat[:, 1] - flat[0, 1] * flat[:, 0]
    turned = np.degrees(np.arctan2(across, flat @ flat[0]))
    np.testing.assert_allclose(abs(turned), spec.views, atol=1e-7)
    assert (turned[1:] > 0).all() or (turned[1:] < 0).all()
    poses = look_at(away + spec.camera_target, np.array(spec.camera_target))
    assert (poses[:, 1, 0] == 0).all()


def test_input_views_are_uniform_in_their_span_on_either_side():
    """The widest turn leaves 10 degrees of azimuth, at one side of the octant or at the other."""
    away = sample_cameras(MANY, np.arange(800)) - MANY.camera_target
    found = np.degrees(np.arctan2(away[..., 2], away[..., 0]))
    low = found[:, 1] > found[:, 0]
    assert binomtest(int(low.sum()), len(low)).pvalue > 0.01
    assert kstest(found[low, 0], "uniform", (0, 10)).pvalue > 0.01
    assert kstest(found[~low, 0], "uniform", (80, 10)).pvalue > 0.01
    heights = away[:, 0, 1] / MANY.camera_radius
    assert kstest(heights, "uniform").pvalue > 0.01
    assert kstest(heights[low], "uniform").pvalue > 0.01, "which side says nothing of the height"

"""The kernel against Embree, on whole scenes and through the numpy renderer."""

from dataclasses import replace

import numpy as np
import pytest
from other_engines import cast_whole_scene, near_silhouettes

from scenegen.camera import Camera, pixel_directions
from scenegen.description.names import SHAPE_NAMES
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.numpy_renderer import render_in_numpy
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render

FLOAT = DatasetSpec(image_dtype="float32", seed=11)
SMALL = replace(FLOAT, height=47, width=61, objects=(2, 3), min_visible_pixels=0)


def compare(ours, theirs):
    """Check that all pixels agree except on silhouettes, and there more than 99.9%."""
    edges = near_silhouettes(ours.object_id)
    same = ours.object_id == theirs.object_id
    assert (same | edges).all()
    assert same.mean() > 0.999
    close = np.isclose(ours.depth, theirs.depth, rtol=0, atol=1e-5, equal_nan=True)
    assert (close | edges | ~same).all()
    assert (close & same).mean() > 0.999
    aligned = abs(ours.normal - theirs.normal).max(axis=-1) <= 1e-3
    assert (aligned & same).mean() > 0.999
    assert (abs(ours.image - theirs.image).max(axis=-1) < 1e-3).mean() > 0.998


KINDS = {"box", "sphere", "torus", "teapot"}  # others are polyhedra, or alike


@pytest.mark.parametrize(
    "name", [n if n in KINDS else pytest.param(n, marks=pytest.mark.slow) for n in SHAPE_NAMES]
)
def test_each_shape_agrees_in_depth_normal_and_image(name, scenes_of, embree_cast):
    spec = replace(SMALL, shapes=(name,), pose="any", shadows=True)
    batch = pack(spec, scenes_of(spec, 3))
    truth = render(batch)
    assert (truth.object_id > 0).mean() > 0.02
    compare(truth, render_in_numpy(batch, embree_cast))


def test_normals_face_the_viewer_inside_open_shapes_too(embree_cast):
    """Into a teapot's spout from above, where its inside is seen, and along its coarse outline."""
    camera = Camera((0.7, 2.0, 0.5), (0.5, 0.5, 0.5), 22.0)
    teapot = PlacedObject("teapot", (0.5, 0.5, 0.5), (1.0, 0.0, 0.0, 0.0), 0.5, (0.8, 0.8, 0.8))
    scene = SceneSpec(0, (camera,), (teapot,), (), (0.1, 0.1, 0.1), (0.5, 0.5), (0.8, 0.8, 0.8))
    spec = replace(FLOAT, height=256, width=256, objects=(1, 1), shapes=("teapot",))
    batch = pack(spec, [scene])
    truth = render(batch)
    rays = pixel_directions(256, 256, camera.fov_y_degrees)
    assert (truth.normal[0] * rays).sum(axis=-1).max() < 1e-6
    faces = cast_whole_scene(scene, spec)[2]
    inside = ((faces * rays).sum(axis=-1) > 0) & ~near_silhouettes(truth.object_id)[0]
    assert inside.sum() > 100
    expected = render_in_numpy(batch, embree_cast).normal[0]
    assert (abs(truth.normal[0] - expected).max(axis=-1)[inside] < 1e-3).mean() > 0.95

"""Single rays worked out by hand: light, shadow, corners, and what a ray must not hit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenegen.camera import Camera, pixel_directions
from scenegen.description.names import SHAPE_NAMES
from scenegen.description.scenes import Light, PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render

GREY = (0.8, 0.8, 0.8)


def test_a_room_pixel_by_hand() -> None:
    """From z = 2.3, level, at the middle of the image: the wall z = 0, 2.3 away, facing us."""
    camera = Camera((0.3, 0.3, 2.3), (0.3, 0.3, 0.3), 25.0)
    light = Light((0.3, 0.3, 2.0), (1.0, 0.5, 0.25))
    scene = SceneSpec(0, (camera,), (), (light,), (0.1, 0.1, 0.1), (0.5, 0.25), (0.8, 0.8, 0.4))
    spec = DatasetSpec(height=9, width=9, objects=(0, 0), lights=(1, 1), image_dtype="float32",
                       min_visible_pixels=0)  # fmt: skip
    truth = render(pack(spec, [scene]))
    assert truth.depth[0, 4, 4] == pytest.approx(2.3, abs=1e-6)
    np.testing.assert_allclose(truth.normal[0, 4, 4], [0, 0, 1], atol=1e-6)
    falloff = 0.5 * 2 + 0.25 * 2**2
    expected = [
        0.8 * (0.1 + 1 / falloff),
        0.8 * (0.1 + 0.5 / falloff),
        0.4 * (0.1 + 0.25 / falloff),
    ]
    np.testing.assert_allclose(truth.image[0, 4, 4], expected, rtol=1e-5)
    np.testing.assert_allclose(truth.normal[0, 8, 4], [0, 1, 0], atol=1e-6)  # row 8: the floor
    np.testing.assert_allclose(truth.normal[0, 4, 0], [1, 0, 0], atol=1e-6)  # column 0: wall x = 0


@pytest.mark.parametrize(("z", "shadow"), [(0.5, True), (1.2, False)])
def test_a_shadow_by_hand(z: float, shadow: bool) -> None:
    """A small ball between a light and the wall z = 0 darkens just the pixels behind it.

    One behind the light, seen from the wall, darkens none.
    """
    camera = Camera((0.5, 0.5, 2.3), (0.3, 0.3, 0.0), 40.0)
    ball = PlacedObject("sphere", (0.3, 0.3, z), (1.0, 0.0, 0.0, 0.0), 0.02, GREY)
    light = Light((0.3, 0.3, 1.0), (1.0, 1.0, 1.0))
    scene = SceneSpec(0, (camera,), (ball,), (light,), (0.1,) * 3, (0.5, 0.5), GREY)
    images = {}
    for shadows in (False, True):
        spec = DatasetSpec(height=33, width=33, objects=(1, 1), lights=(1, 1), shadows=shadows,
                           image_dtype="float32", shapes=("sphere",))  # fmt: skip
        images[shadows] = render(pack(spec, [scene])).image[0]
    assert images[False][16, 16, 0] == pytest.approx(0.8 * (0.1 + 1.0), rel=1e-4)
    changed = (images[False] != images[True]).any(axis=-1)
    if shadow:
        assert images[True][16, 16, 0] == pytest.approx(0.8 * 0.1, rel=1e-5)
        assert 1 <= changed.sum() < 15, "elsewhere not a bit changes"
    else:
        assert not changed.any()


def glossy(objects: tuple[PlacedObject, ...], lamp: Any, shadows: bool) -> Any:
    """Return what is rendered of objects before nothing, from (0, 0, 3) along -z."""
    camera, light = Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 20.0), Light(lamp, (1.0, 1.0, 1.0))
    scene = SceneSpec(0, (camera,), objects, (light,), (0.1,) * 3, (0.5, 0.5), None)
    spec = DatasetSpec(height=65, width=65, objects=(1, 2), lights=(1, 1), shadows=shadows,
                       specular=(0.0, 1.0), image_dtype="float32", shapes=("sphere",))  # fmt: skip
    return render(pack(spec, [scene]))


UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def test_a_ball_is_shaded_neither_by_itself_nor_where_another_one_hides_its_highlight() -> None:
    """The lamp is half a right angle aside, so that the highlight is at half of that."""
    lamp, aside = np.array([2.0, 0.0, 2.0]), np.pi / 8
    ball = PlacedObject("sphere", (0.0,) * 3, UPRIGHT, 0.3, GREY, specular=1.0, shininess=20.0)
    shown, alone = (glossy((ball,), tuple(lamp), shadows) for shadows in (False, True))
    lit = (shown.normal[0] @ [1.0, 0.0, 1.0] > 0.1) & (shown.object_id[0] == 1)
    np.testing.assert_array_equal(shown.image[0][lit], alone.image[0][lit])
    pole = 0.3 * np.array([np.sin(aside), 0.0, np.cos(aside)])
    between = tuple((pole + 0.4 * (lamp - pole)).tolist())
    before = PlacedObject("sphere", between, UPRIGHT, 0.05, GREY)
    dark = glossy((ball, before), tuple(lamp), True)
    row, column = 32, 32 + round(pole[0] / (3.0 - pole[2]) / np.tan(np.radians(10.0)) * 32.5)
    assert shown.image[0, row, column, 0] > 0.3
    np.testing.assert_allclose(dark.image[0, row, column], 0.08, rtol=1e-5)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_of_two_objects_is_seen_although_their_spheres_overlap(
    order: tuple[int, int],
) -> None:
    """Along z: the front one's face at 0.75, inside the bounding sphere of the one behind it."""
    upright, half = (1.0, 0.0, 0.0, 0.0), 0.1 / 3**0.5
    boxes = [
        PlacedObject("box", (0.5, 0.5, 0.75 - half), upright, 0.1, GREY),
        PlacedObject("box", (0.5, 0.5, 0.63 - 3 * half), upright, 0.3, GREY),
    ]
    camera = Camera((0.5, 0.5, 2.75), (0.5, 0.5, 0.0), 8.0)
    spec = DatasetSpec(height=9, width=9, objects=(2, 2), shapes=("box",), min_visible_pixels=0)
    objects = tuple(boxes[i] for i in order)
    scene = SceneSpec(0, (camera,), objects, (), (0.1,) * 3, (0.5, 0.5), GREY)
    truth = render(pack(spec, [scene]))
    assert truth.depth[0, 4, 4] == pytest.approx(2.0, abs=1e-6)
    assert (truth.object_id[0, 3:6, 3:6] == 1 + order.index(0)).all()
    assert 1 + order.index(1) in truth.object_id


def turned_shapes(room: Any) -> list[SceneSpec]:
    """All shapes, rotated at random, with random cameras and lights above them."""
    rng, scenes = np.random.default_rng(3), []
    for index, name in enumerate(SHAPE_NAMES * 6):
        turn, away, up = rng.standard_normal((3, 4))
        w, x, y, z = (turn / np.linalg.norm(turn)).tolist()
        item = PlacedObject(name, (0.5, 0.5, 0.5), (w, x, y, z), 0.2, GREY)
        back = abs(away[:3]) * (1, 0.5, 1) if room else away[:3] * (1, 0.5, 1)
        camera = Camera(tuple((0.5 + 2 * back / np.linalg.norm(back)).tolist()), (0.5,) * 3, 12.0)
        lamp = Light(tuple((0.5 + 2 * abs(up[:3])).tolist()), (1.0, 1.0, 1.0))
        scenes.append(SceneSpec(index, (camera,), (item,), (lamp,), (0.1,) * 3, (0.5, 0.5), room))
    return scenes


SHAPES_SPEC = DatasetSpec(
    height=96, width=96, objects=(1, 1), min_visible_pixels=0, lights=(1, 1),
    image_dtype="float32",
)  # fmt: skip


def test_a_ray_meets_no_other_unit_shape() -> None:
    """All shapes are in one unit scene, but each may only be hit inside its bounding sphere.

    Without a room, so that nothing stops a ray that passes its object.
    """
    truth = render(pack(SHAPES_SPEC, turned_shapes(None)))
    for depth, object_id in zip(truth.depth, truth.object_id, strict=True):
        points = pixel_directions(96, 96, 12.0) * depth[..., None]
        off_center = np.linalg.norm(points[object_id == 1] - [0, 0, -2], axis=-1)
        assert off_center.max() < 0.2 * (1 + 1e-4)
        assert len(off_center) > 500


def test_a_shadow_ray_meets_no_other_unit_shape() -> None:
    """Shadows are the same without the other shapes, except a few pixels on outlines."""
    scenes, differ = turned_shapes(GREY), []
    spec = replace(SHAPES_SPEC, shadows=True)
    together, lit = render(pack(spec, scenes)), render(pack(SHAPES_SPEC, scenes))
    for first, name in enumerate(SHAPE_NAMES):
        rows = slice(first, None, len(SHAPE_NAMES))
        alone = render(pack(replace(spec, shapes=(name,)), scenes[rows]))
        differ.append(abs(alone.image - together.image[rows]).max(axis=-1) > 1e-3)
    assert (abs(together.image - lit.image).max(axis=-1) > 1e-3).mean() > 0.03
    assert np.mean(differ) < 1e-4


@pytest.mark.parametrize("scale", [0.2, 0.05, 0.02, 0.01, 0.005])
def test_a_ball_of_any_size_has_no_holes_and_the_depth_of_a_ball(scale: float) -> None:
    """The exact quadric, against its own formula, up to its outline."""
    rng, wrong = np.random.default_rng(2), []
    spec = DatasetSpec(height=64, width=64, objects=(1, 1), shapes=("sphere",))
    fov = float(np.degrees(2 * np.arctan(1.1 * scale / 1.5)))
    for index in range(8):
        center, away = rng.uniform(0.1, 0.8, 3), abs(rng.standard_normal(3))
        eye = center + 1.5 * away / np.linalg.norm(away)
        camera = Camera(tuple(eye.tolist()), tuple(center.tolist()), fov)
        ball = PlacedObject("sphere", tuple(center.tolist()), (1.0, 0.0, 0.0, 0.0), scale, GREY)
        scene = SceneSpec(index, (camera,), (ball,), (), (0.1,) * 3, (0.5, 0.5), None)
        truth = render(pack(spec, [scene]))
        rays = pixel_directions(64, 64, fov)
        squared = (rays**2).sum(axis=-1)
        middle = 1.5 / squared  # where the ray, -z = 1, passes the centre at (0, 0, -1.5)
        inside = scale**2 - (1.5**2 - middle**2 * squared)
        shown = inside > (0.1 * scale) ** 2
        depth = middle - np.sqrt(np.maximum(inside, 0) / squared)
        assert shown.mean() > 0.5
        wrong.append((abs(truth.depth[0] - depth)[shown] > 1e-5).sum())
    assert wrong == [0] * 8


@pytest.mark.parametrize("room", [GREY, None])
@pytest.mark.parametrize("shape", ["cone", "sphere"])
@pytest.mark.parametrize("z", [0.9, 0.5])
def test_what_is_behind_the_camera_or_around_it_is_not_in_front(
    z: float, shape: str, room: Any
) -> None:
    """The camera stands at z = 0.5 and looks towards z = 0; at 0.5, its object is around it."""
    camera = Camera((0.5, 0.5, 0.5), (0.5, 0.5, 0.1), 30.0)
    item = PlacedObject(shape, (0.5, 0.5, z), (1.0, 0.0, 0.0, 0.0), 0.2, GREY)
    scene = SceneSpec(0, (camera,), (item,), (), (0.1,) * 3, (0.5, 0.5), room)
    spec = DatasetSpec(height=32, width=32, objects=(0, 1), shapes=("cone", "sphere"))
    truth = render(pack(spec, [scene]))
    assert not (truth.depth <= 0).any()
    if z == 0.9:
        assert (truth.object_id == (0 if room else -1)).all()


def test_the_rooms_very_corner_is_lit() -> None:
    camera = Camera((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), 30.0)
    scene = SceneSpec(0, (camera,), (), (), (0.1,) * 3, (0.5, 0.5), GREY)
    spec = DatasetSpec(height=9, width=9, objects=(0, 0), lights=(0, 1), image_dtype="float32",
                       min_visible_pixels=0)  # fmt: skip
    np.testing.assert_allclose(render(pack(spec, [scene])).image, 0.08, rtol=1e-5)

"""Scenes as arrays: each number in its slot, and nothing in the others."""

from dataclasses import replace

import numpy as np
import pytest

from scenegen.camera import Camera
from scenegen.errors import SpecError
from scenegen.packing import pack, pixel_size
from scenegen.scenes import Light, PlacedObject, SceneSpec
from scenegen.shapes import world_from_object
from scenegen.specs import DatasetSpec

SPEC = DatasetSpec(objects=(0, 3), lights=(0, 2), shapes=("cone", "box"), height=50, width=80)
TURN = (0.5, 0.5, 0.5, 0.5)
CONE = PlacedObject("cone", (0.1, 0.2, 0.3), TURN, 0.15, (0.1, 0.2, 0.3))
BOX = PlacedObject("box", (0.4, 0.5, 0.6), (1.0, 0.0, 0.0, 0.0), 0.05, (0.4, 0.5, 0.6))
LAMP = Light((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
VIEWS = (
    Camera((1.5, 1.0, 1.2), (0.3, 0.3, 0.3), 28.0),
    Camera((1.0, 1.1, 1.9), (0.2, 0.3, 0.3), 33.0),
)
FULL = SceneSpec(
    4, VIEWS, (BOX, CONE), (LAMP, LAMP), (0.1, 0.2, 0.3), (0.5, 0.6), (0.7, 0.8, 0.9), (1, 2, 3)
)
BARE = replace(FULL, index=5, objects=(), lights=(), room_reflectance=None)
LAST = replace(FULL, index=6, objects=(CONE,), lights=(LAMP,))


def test_every_number_is_in_its_slot() -> None:
    batch = pack(SPEC, [FULL, BARE, LAST])
    assert len(batch) == 3
    assert batch.object_count.tolist() == [2, 0, 1]
    assert batch.light_count.tolist() == [2, 0, 1]
    assert batch.shape.tolist() == [[1, 0, -1], [-1, -1, -1], [0, -1, -1]]
    assert batch.object_scale.tolist() == [[0.05, 0.15, 0], [0, 0, 0], [0.15, 0, 0]]
    for row, slot, item in ((0, 0, BOX), (0, 1, CONE), (2, 0, CONE)):
        expected = world_from_object(item.position, item.rotation, item.scale)
        np.testing.assert_array_equal(batch.world_from_object[row, slot], expected)
        assert batch.reflectance[row, 1 + slot].tolist() == list(item.reflectance)
    assert not batch.world_from_object[batch.shape < 0].any()
    assert batch.reflectance[:, 0].tolist() == [[0.7, 0.8, 0.9], [0, 0, 0], [0.7, 0.8, 0.9]]
    assert not batch.reflectance[1, 1:].any()
    assert batch.has_room.tolist() == [True, False, True]
    assert batch.background.tolist() == [[1, 2, 3]] * 3
    assert batch.ambient.tolist() == [[0.1, 0.2, 0.3]] * 3
    assert batch.attenuation.tolist() == [[0.5, 0.6]] * 3
    lit = [[True, True], [False, False], [True, False]]
    assert batch.light_position[lit].tolist() == [[1, 2, 3]] * 3
    assert batch.light_color[lit].tolist() == [[4, 5, 6]] * 3
    assert not batch.light_color[np.logical_not(lit)].any()


@pytest.mark.parametrize("view", [0, 1])
def test_the_view_asked_for_is_the_one_packed(view: int) -> None:
    batch = pack(SPEC, [FULL, LAST], (view,))
    expected = VIEWS[view].world_from_camera
    np.testing.assert_array_equal(batch.world_from_camera, [expected, expected])
    assert batch.fov_y_degrees.tolist() == [VIEWS[view].fov_y_degrees] * 2


def test_empty_rooms_alone_can_be_packed() -> None:
    batch = pack(replace(SPEC, objects=(0, 0), lights=(0, 0)), [BARE])
    assert batch.world_from_object.shape == (1, 1, 4, 4)
    assert batch.light_position.shape == (1, 1, 3)
    assert batch.shape.tolist() == [[-1]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"objects": (BOX,) * 4}, "scene 4: found 4 objects, the spec allows 3"),
        ({"lights": (LAMP,) * 3}, "scene 4: found 3 lights, the spec allows 2"),
        ({"objects": (replace(BOX, shape="torus"),)}, "'torus'"),
    ],
)
def test_a_scene_beyond_the_request_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(SpecError, match=words):
        pack(SPEC, [BARE, replace(FULL, **change)])


def test_pixel_size_at_depth_one() -> None:
    np.testing.assert_allclose(pixel_size(np.array([90.0, 60.0]), 10), [0.2, 0.2 / 3**0.5])

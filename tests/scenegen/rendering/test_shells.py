"""Depth, normals and ids of closed rooms, against planes that are cut by hand."""

import numpy as np
import pytest

from scenegen.camera import Camera, pixel_directions
from scenegen.description.interiors import WALLS, Interior, Opening
from scenegen.description.presets import preset_spec
from scenegen.description.scenes import SceneSpec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import launch_fields

SIZE = (4.0, 2.5, 3.0)
SPEC = preset_spec("interiors", height=48, width=64, objects=(1, 3), min_visible_pixels=0)
NAMES = ("depth", "normal", "object_id")


def scene(camera, openings=()):
    """Return an empty room."""
    room = Interior(SIZE, openings, (), 12.0, 0.0, False)
    return SceneSpec(0, (camera,), (), (), (0,) * 3, (0.5, 0.5), (0.8,) * 3, interior=room)


def rendered(camera, openings=()):
    batch = pack(SPEC, [scene(camera, openings)])
    return {name: values[0] for name, values in launch_fields(batch, NAMES)().items()}


def planes(camera):
    """Return depth and normals of the box's inside, where skirting and light do not count."""
    local = pixel_directions(SPEC.height, SPEC.width, camera.fov_y_degrees)
    matrix = camera.world_from_camera
    rays, origin = local @ matrix[:3, :3].T, matrix[:3, 3]
    ends = np.where(rays > 0, (np.array(SIZE) - origin) / rays, -origin / rays)
    axis = ends.argmin(axis=-1)
    normal = -np.sign(rays) * np.eye(3)[axis]
    return ends.min(axis=-1), normal @ matrix[:3, :3]


@pytest.mark.parametrize("target", [(0.2, 1.3, 0.4), (3.9, 0.9, 2.9), (0.1, 1.2, 2.9)])
def test_an_empty_box_has_the_depth_of_its_planes(target):
    camera = Camera((2.0, 1.2, 1.5), target, 60.0)
    pixels = rendered(camera)
    depth, normal = planes(camera)
    assert (pixels["object_id"] == 0).all()
    flat = np.isclose(pixels["depth"], depth, atol=1e-5)
    # The rest is skirting, at most 16 mm before a wall, and the ceiling light.
    assert flat.mean() > 0.9
    assert (pixels["depth"] <= depth + 1e-5).all()
    np.testing.assert_allclose(pixels["normal"][flat], normal[flat], atol=1e-5)


@pytest.mark.parametrize("wall", WALLS)
def test_only_a_windows_opening_shows_nothing(wall):
    window = Opening("window", wall, 1.0, 2.0, 0.9, 2.0)
    ahead = {"west": (0, 1.45, 1.5), "east": (4, 1.45, 1.5),
             "north": (1.5, 1.45, 0), "south": (1.5, 1.45, 3)}[wall]  # fmt: skip
    start = (1.5, 1.45, 1.5) if wall in ("north", "south") else (2.0, 1.45, 1.5)
    camera = Camera(start, ahead, 70.0)
    pixels = rendered(camera, (window,))
    nothing = pixels["object_id"] < 0
    assert np.isnan(pixels["depth"][nothing]).all()
    assert (pixels["normal"][nothing] == 0).all()
    assert nothing[SPEC.height // 2 - 4, SPEC.width // 2 - 6]
    depth, _ = planes(camera)
    inside = np.flatnonzero(nothing.any(axis=0))
    away = depth[SPEC.height // 2, SPEC.width // 2]
    pixel = 2 * np.tan(np.radians(35)) / SPEC.height
    assert (inside[-1] - inside[0]) * pixel * away < 1.0  # its width
    door = rendered(camera, (Opening("door", wall, 1.0, 2.0, 0.0, 2.0),))
    assert (door["object_id"] == 0).all()

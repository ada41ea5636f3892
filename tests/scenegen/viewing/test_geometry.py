"""What is drawn, as arrays: against the file's own depth, normals and shapes."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from scenegen import open_rooms
from scenegen.camera import back_project
from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.objects.catalogue import built_in_shape
from scenegen.viewing.geometry import (
    FARTHEST,
    RIGHT,
    TOO_FAR,
    TOO_NEAR,
    UNKNOWN,
    check_camera,
    error_colors,
    hit_by,
    pictured,
    pixel_colors,
    scene_meshes,
    shapes_of,
    surfels_of,
    thinned,
)


@pytest.fixture(scope="module")
def rooms(rooms_path):
    with open_rooms(rooms_path) as file:
        yield file


def surfels(room, depth=None):
    depth = room.depth if depth is None else depth
    return surfels_of(room, back_project(depth, room.fov_y_degrees))


def test_pixels_without_a_depth_in_view_have_no_surfel(rooms):
    depth = rooms[0].depth.copy()
    depth[0, :6] = np.nan, np.inf, 0, -1, FARTHEST * 1.1, FARTHEST
    shown = surfels(rooms[0], depth)
    assert shown.pixels[0].tolist() == [0, 5]
    assert len(shown.points) == depth.size - 5
    assert np.isfinite(shown.points).all()
    np.testing.assert_allclose(
        shown.points[1:], rooms[0].points_world.reshape(-1, 3)[6:], atol=1e-6
    )
    assert len(surfels(rooms[0], depth * np.nan).points) == 0


def test_colours_of_errors_tell_sign_and_size():
    colors = error_colors(np.array([-9.0, -0.1, 0.0, 0.05, 0.1, np.inf, np.nan]), 0.1)
    half = np.rint(np.add(RIGHT, TOO_FAR) / 2 + 1e-9)
    assert np.abs(colors[3] - half).max() <= 1
    others = [TOO_NEAR, TOO_NEAR, RIGHT, TOO_FAR, UNKNOWN, UNKNOWN]
    assert colors[[0, 1, 2, 4, 5, 6]].tolist() == [list(color) for color in others]


@pytest.mark.parametrize("angle", [0.0, 0.001])
def test_a_click_hits_the_surfel_of_its_pixel(rooms, angle):
    room = rooms[0]
    shown, eye = surfels(room), room.world_from_camera[:3, 3]
    for i in range(0, len(shown.points), 97):
        way = shown.points[i] - eye
        length = np.linalg.norm(way)
        hit = hit_by(shown, eye, way / length, angle)
        assert hit[0] == i
        assert hit[1] == pytest.approx(length, abs=shown.spacing)
        assert hit_by(shown, eye, -way / length, angle) is None
    both = replace(shown, points=np.concatenate([shown.points, eye + 0.5 * (shown.points - eye)]))
    assert hit_by(both, eye, way / length)[0] == len(shown.points) + i, "the nearer of two surfaces"


def test_normals_have_one_colour_in_all_views(make_rooms, tmp_path):
    with open_rooms(make_rooms(tmp_path / "x.h5", 1, views=(0, 40))) as rooms:
        floors = []
        for room in rooms:
            floor = (room.object_id == 0) & (np.abs(room.points_world[..., 1]) < 1e-6)
            floors.append(pixel_colors(room, "Normal")[floor])
    for colors in floors:
        assert len(colors) > 10
        assert np.abs(colors - (127.5, 255, 127.5)).max() <= 0.5


def test_meshes_are_where_the_surfels_are(rooms):
    shape_of = shapes_of(rooms.spec)
    for room in rooms:
        meshes, missing = scene_meshes(room.scene, shape_of)
        assert missing == []
        assert [mesh.object_id for mesh in meshes] == list(range(1, len(room.scene.objects) + 1))
        for mesh in meshes:
            seen = room.points_world[room.object_id == mesh.object_id][::29, None]
            low, high = mesh.triangles.min(axis=1) - 0.01, mesh.triangles.max(axis=1) + 0.01
            a, b, c = mesh.triangles.swapaxes(0, 1)
            normal = np.cross(b - a, c - a)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            beside = np.abs(((seen - a) * normal).sum(axis=2))
            near = ((seen >= low) & (seen <= high)).all(axis=2) & (beside < 0.005)
            assert near.any(axis=1).all()


def test_meshes_that_are_not_there_are_named_once(meshes, make_rooms, tmp_path):
    from scenegen.objects.sources import object_source

    told = {"objects_root": str(meshes), "cache_dir": str(tmp_path / "cache")}
    source = object_source("shapes", classes=("bowl",), **told)
    how = {"objects": source.objects}
    path = make_rooms(tmp_path / "x.h5", 2, how, objects=(2, 2), **source.settings)
    with open_rooms(path) as rooms:
        shown, missing = scene_meshes(rooms[0].scene, shapes_of(rooms.spec))
        assert (shown, len(missing)) == ([], 1)
        assert "--objects-root" in missing[0]
        shown, missing = scene_meshes(rooms[0].scene, shapes_of(rooms.spec, **told))
        assert (len(shown), missing) == (2, [])
        with pytest.raises(SceneGenError):
            shapes_of(rooms.spec, objects_root=str(tmp_path), cache_dir=told["cache_dir"])


def test_large_meshes_are_thinned_out_on_their_surface():
    box, sphere = (built_in_shape(name).triangles for name in ("box", "sphere"))
    assert thinned(box) is box
    fewer = thinned(sphere)
    assert 1000 < len(fewer) < len(sphere) / 6
    assert np.abs(np.linalg.norm(fewer, axis=2) - 1).max() < 2e-3
    a, b, c = fewer.swapaxes(0, 1)
    outwards = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1)
    assert (outwards > 0).mean() > 0.99
    mesh = trimesh.Trimesh(fewer.reshape(-1, 3), np.arange(3 * len(fewer)).reshape(-1, 3))
    assert mesh.is_watertight, "no slit where the turned profile closes"


@pytest.mark.parametrize(
    "changes",
    [
        {"world_from_camera": np.eye(4) * np.nan},
        {"world_from_camera": np.diag([2.0, 1, 1, 1])},
        {"world_from_camera": np.diag([-1.0, 1, 1, 1])},
        {"fov_y_degrees": 180.0},
    ],
)
def test_impossible_cameras_are_refused(rooms, changes):
    check_camera(rooms[0])
    with pytest.raises(FileFormatError):
        check_camera(replace(rooms[0], **changes))


def test_meshes_of_closed_rooms_look_as_their_pictures(interior_path):
    with open_rooms(interior_path) as rooms:
        room = rooms[0]
        meshes, _ = scene_meshes(room.scene, shapes_of(rooms.spec))
    shown = {mesh.object_id: mesh.color for mesh in pictured(meshes, [room])}
    for k in np.unique(room.object_id[room.object_id > 0]):
        mean = room.image[room.object_id == k].mean(axis=0)
        assert np.abs(shown[k] - mean).max() <= 1.5

"""Files of rooms whose principal point is off-centre and whose pixels are wide."""

import json

import numpy as np
import pytest

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.scene_mesh import world_from_object
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.verify import verify_file
from scenegen.rooms.withheld import withhold_truth

HEIGHT, WIDTH, POINT, ASPECT = 48, 56, (0.3, 0.625), 1.25


@pytest.fixture(scope="module")
def path(make_rooms, tmp_path_factory):
    return make_rooms(tmp_path_factory.mktemp("crops") / "x.h5", 3, views=(0.0, 20.0), stereo=0.05,
                      height=HEIGHT, width=WIDTH, principal_point=POINT, pixel_aspect=ASPECT,
                      truth=("amodal", "coordinates", "flow", "layers"))  # fmt: skip


def matrix(room):
    """The pinhole matrix by hand, of a camera with y down."""
    focal = HEIGHT / 2 / np.tan(np.radians(room.fov_y_degrees) / 2)
    rows = [focal / ASPECT, 0, POINT[0] * WIDTH], [0, focal, POINT[1] * HEIGHT], [0, 0, 1]
    return np.array(rows)


def test_files_are_verified(path):
    with open_rooms(path) as rooms:
        assert all(check.ok for check in verify_file(rooms))


def test_points_are_where_the_matrix_puts_them(path):
    with open_rooms(path) as rooms:
        assert len(rooms) == 12
        for room in rooms:
            k = rooms.read("camera/intrinsics", room.index)
            np.testing.assert_allclose(k, matrix(room), rtol=1e-12)
            places = room.points * (1, -1, -1) @ k.T
            rows, columns = np.indices(room.depth.shape) + 0.5
            hit = room.object_id >= 0
            np.testing.assert_allclose((places[..., 0] / places[..., 2])[hit], columns[hit])
            np.testing.assert_allclose((places[..., 1] / places[..., 2])[hit], rows[hit])


def test_objects_are_inside_the_image(path):
    with open_rooms(path) as rooms:
        for room in rooms[::2]:  # those of left eyes
            for item in room.scene.objects:
                placed = world_from_object(item.position, item.rotation, item.scale)
                placed = np.linalg.inv(room.world_from_camera) @ placed
                points = unit_shape(item.name).triangles.reshape(-1, 3)
                x, y, z = (
                    matrix(room)
                    @ np.diag([1, -1, -1])
                    @ (placed[:3, :3] @ points.T + placed[:3, 3:])
                )
                assert (x > -z).all()
                assert (x < z * (WIDTH + 1)).all()
                assert (y > -z).all()
                assert (y < z * (HEIGHT + 1)).all()


def test_disparity_follows_from_the_horizontal_focal_length(path):
    with open_rooms(path) as rooms:
        pair = rooms.stereo(0)
        k = matrix(pair.left)
        np.testing.assert_allclose(pair.disparity[0], k[0, 0] * 0.05 / pair.left.depth)
        x = (pair.left.points[..., 0] - 0.05) / pair.left.depth * k[0, 0] + k[0, 2]
        columns = np.indices(pair.left.depth.shape)[1] + 0.5
        np.testing.assert_allclose(columns - x, pair.disparity[0], atol=1e-9)


def test_cameras_are_given_without_truth(path, tmp_path):
    withhold_truth(path, tmp_path / "images.h5")
    with open_rooms(path) as rooms, open_rooms(tmp_path / "images.h5") as images:
        name = "camera/intrinsics"
        np.testing.assert_array_equal(images.read(name, 0), rooms.read(name, 0))


def test_exports_have_the_matrix_or_are_refused(path, tmp_path):
    with open_rooms(path) as rooms:
        k = matrix(rooms[0])
        export_folder(rooms, "nerfstudio", tmp_path / "nerfstudio", [0])
        told = json.loads((tmp_path / "nerfstudio/scene-000000/transforms.json").read_text())
        told = [told[name] for name in ("fl_x", "fl_y", "cx", "cy")]
        np.testing.assert_allclose(told, [k[0, 0], k[1, 1], k[0, 2], k[1, 2]])
        with pytest.raises(SpecError) as caught:
            export_folder(rooms, "glb", tmp_path / "glb", [0])
        assert caught.value.where == "principal point"
        assert not (tmp_path / "glb").exists()

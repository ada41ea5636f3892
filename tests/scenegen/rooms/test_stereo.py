"""Stereo pairs: geometry by hand, occlusion by Embree, and the right image warped into the left."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.description.presets import preset_spec
from scenegen.objects.scene_mesh import scene_parts
from scenegen.rooms.export.encoding import Encoding
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.verify import verify_file
from scenegen.sampling.scenes import most_attempts, sample_scene
from tests.support.loaders import check_srgb

BASELINE = 0.1


@pytest.fixture(scope="module")
def path(make_rooms, tmp_path_factory):
    """Two scenes in two views, each a pair: eight images."""
    return make_rooms(tmp_path_factory.mktemp("stereo") / "x.h5", 2, stereo=BASELINE, seed=3,
                      views=(0.0, 35.0), image_dtype="float32", height=56, width=64,
                      objects=(3, 3), shapes=("box", "sphere"), min_visible_pixels=5)  # fmt: skip


@pytest.fixture(scope="module")
def pairs(path):
    with open_rooms(path) as rooms:
        assert len(rooms) == 8
        assert [room.view_angle_degrees for room in rooms[:4]] == [0, 0, 35, 35]
        return [rooms.stereo(row) for row in (0, 3, 4, 6)]


def local(room, points):
    """World points in the camera frame, by SciPy's and numpy's inverse."""
    inverse = np.linalg.inv(room.world_from_camera)
    return points @ inverse[:3, :3].T + inverse[:3, 3]


def test_the_right_camera_is_moved_along_x(pairs):
    for pair in pairs:
        left, right = pair.left.world_from_camera, pair.right.world_from_camera
        np.testing.assert_allclose(np.linalg.inv(left) @ right,
                                   trimesh.transformations.translation_matrix((BASELINE, 0, 0)),
                                   atol=1e-12)  # fmt: skip


def test_disparity_is_where_the_other_camera_sees_a_point(pairs):
    for pair in pairs:
        for i, (one, other) in enumerate([(pair.left, pair.right), (pair.right, pair.left)]):
            x, y, z = np.moveaxis(local(other, one.points_world), -1, 0)
            height, width = one.depth.shape
            focal = height / 2 / np.tan(np.radians(one.fov_y_degrees / 2))
            rows, columns = np.indices(one.depth.shape) + 0.5
            sign = 1 - 2 * i
            d = sign * (columns - (width / 2 - focal * x / z))
            np.testing.assert_allclose(pair.disparity[i], d, atol=1e-9)
            below = height / 2 + focal * y / z
            known = np.isfinite(one.depth)
            np.testing.assert_allclose(below[known], rows[known], atol=1e-9)


def test_what_the_other_eye_sees(pairs):
    engine = pytest.importorskip("trimesh.ray.ray_pyembree")
    agree, hidden = [], 0
    for pair in pairs:
        mesh = trimesh.util.concatenate([part.mesh for part in scene_parts(pair.left.scene)])
        caster = engine.RayMeshIntersector(mesh)
        for i, (one, other) in enumerate([(pair.left, pair.right), (pair.right, pair.left)]):
            points, eye = one.points_world.reshape(-1, 3), other.world_from_camera[:3, 3]
            away = eye - np.nan_to_num(points)
            start = np.nan_to_num(points) + 2e-3 * away
            free = ~caster.intersects_any(start, away)
            x, y, z = local(other, points).T
            height, width = one.depth.shape
            edge = np.tan(np.radians(one.fov_y_degrees / 2))
            inside = (np.abs(y / z) < edge) & (np.abs(x / z) < edge * width / height)
            agree.append((free & inside) == pair.visible[i].ravel())
            hidden += int((inside & ~free).sum())
    assert np.mean(agree) > 0.985
    assert hidden > 50


def test_the_right_image_warped_by_the_disparity_is_the_left_one(pairs):
    for pair in pairs:
        left, right = pair.left, pair.right
        rows, columns = np.indices(left.depth.shape)
        at = np.nan_to_num(columns - pair.disparity[0], nan=-1.0)
        first = np.floor(at).astype(int)
        usable = pair.visible[0] & (first >= 0) & (first + 1 < left.depth.shape[1])
        first = first.clip(0, left.depth.shape[1] - 2)
        share = (at - first)[..., None]
        for k in (0, 1):  # both neighbours show the same face
            usable &= right.object_id[rows, first + k] == left.object_id
            usable &= (right.normal[rows, first + k] * left.normal).sum(axis=-1) > 0.9
        warped = (1 - share) * right.image[rows, first] + share * right.image[rows, first + 1]
        assert usable.mean() > 0.7
        off = np.abs(warped - left.image)[usable]
        assert np.quantile(off, 0.99) < 0.005  # shading of a sphere bends between two pixels
        assert off.mean() < 0.001


def test_pairs_are_verified_and_single_images_are_none(path, rooms_path):
    with open_rooms(path) as rooms, open_rooms(rooms_path) as single:
        assert all(check.ok for check in verify_file(rooms, 8))
        with pytest.raises(SpecError):
            single.stereo(0)


def test_middlebury(path, pairs, tmp_path):
    with open_rooms(path) as rooms:
        export_folder(rooms, "stereo", tmp_path / "out", [1, 2], encoding=Encoding(exposure=0.5))
    assert len(list((tmp_path / "out").glob("scene-*"))) == 2
    folder, pair = tmp_path / "out" / "scene-000000-view-0", pairs[0]
    told = dict(line.split("=", 1) for line in (folder / "calib.txt").read_text().splitlines())
    matrix = np.array([row.split() for row in told["cam0"][1:-1].split(";")], float)
    assert told["cam0"] == told["cam1"]
    assert (float(told["doffs"]), int(told["width"]), int(told["height"])) == (0, 64, 56)
    assert matrix[:2, 2].tolist() == [31.5, 27.5]
    for i, room in enumerate((pair.left, pair.right)):
        disparity = np.asarray(Image.open(folder / f"disp{i}.pfm"))
        assert disparity.shape == (56, 64)
        depth = float(told["baseline"]) * matrix[0, 0] / (disparity + float(told["doffs"])) / 1000
        hit = room.object_id >= 0
        assert np.isinf(disparity[~hit]).all()
        np.testing.assert_allclose(depth[hit], room.depth[hit], rtol=1e-6)
        assert float(told["vmin"]) <= disparity[hit].min() <= disparity[hit].max()
        assert disparity[hit].max() <= min(float(told["vmax"]), float(told["ndisp"]) - 1)
        mask = np.asarray(Image.open(folder / f"mask{i}nocc.png"))
        np.testing.assert_array_equal(mask == 255, pair.visible[i])
        np.testing.assert_array_equal(mask == 0, ~hit)
        image = np.asarray(Image.open(folder / f"im{i}.png")).astype(float)
        check_srgb(image, 0.5 * room.radiance)


def test_both_cameras_of_interiors_are_free():
    spec = preset_spec("interiors", stereo=0.25, objects=(6, 6), views=(0.0, 20.0), seed=2)
    scenes = (sample_scene(spec, 0, attempt) for attempt in range(most_attempts(spec)))
    scene = next(scene for scene in scenes if scene is not None)
    assert len(scene.cameras) == 4
    for left, right in (scene.cameras[:2], scene.cameras[2:]):
        moved = np.subtract(right.position, left.position)
        np.testing.assert_allclose(moved, 0.25 * left.world_from_camera[:3, 0], atol=1e-12)
        for x, size in zip(right.position, scene.interior.size, strict=True):
            assert 0.3 <= x <= size - 0.3

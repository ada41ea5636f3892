"""Panoramas of interiors: Embree on the whole room, rays by hand, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.description.presets import preset_spec
from scenegen.objects.catalogue import mesh_to_cast, objects_of
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import launch_fields
from scenegen.rendering.shells import with_shells
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.export.single import export_paths, export_room
from scenegen.rooms.make import make_dataset
from scenegen.rooms.verify import verify_file
from scenegen.sampling.scenes import sample_scene

SPEC = preset_spec(
    "interiors", height=64, width=128, spp=4, denoise=False, projection="equirectangular",
    truth=("amodal", "coordinates", "albedo"),
)  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("panoramas") / "x.h5"
    make_dataset(path, SPEC, 1)
    return path


@pytest.fixture(scope="module")
def room(path):
    with open_rooms(path) as rooms:
        return rooms[0]


def rays_by_hand(spec, fov_y_degrees):
    """Directions of the pixels of an OpenGL camera: of longitudes and latitudes, or by a matrix."""
    height, width = spec.height, spec.width
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    if spec.projection == "equirectangular":
        right, up = np.radians(360 * columns / width - 180), np.radians(90 - 180 * rows / height)
        ahead = -np.cos(right) * np.cos(up)
        return np.stack([np.sin(right) * np.cos(up), np.sin(up), ahead], axis=-1)
    focal = height / 2 / np.tan(np.radians(fov_y_degrees) / 2)
    x, y = spec.principal_point[0] * width, spec.principal_point[1] * height
    matrix = np.array([[focal / spec.pixel_aspect, 0, x], [0, focal, y], [0, 0, 1]])
    places = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
    return places @ np.linalg.inv(matrix).T * (1, -1, -1)


def whole_room(batch):
    """Return one mesh of a room, and the object ids of its triangles."""
    slots, batch = batch.spec.object_slots, with_shells(batch)
    triangles, ids = [], []
    for slot in np.flatnonzero(batch.shape[0] >= 0):
        mesh = mesh_to_cast(batch.shape_of, batch.names[batch.shape[0, slot]])
        matrix = batch.world_from_object[0, slot]
        corners = mesh.vertices.astype(float)[mesh.faces]
        triangles.append(corners @ matrix[:3, :3].T + matrix[:3, 3])
        ids.append(np.full(len(corners), 0 if slot == slots else slot + 1))
    corners = np.concatenate(triangles).reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return trimesh.Trimesh(corners, faces, process=False), np.concatenate(ids)


def by_embree(spec, scene):
    """Return depth and object ids of a scene's first view."""
    mesh, ids = whole_room(pack(spec, [scene], (0,), objects_of(spec)))
    camera = scene.cameras[0]
    pose, local = camera.world_from_camera, rays_by_hand(spec, camera.fov_y_degrees)
    rays = local.reshape(-1, 3) @ pose[:3, :3].T
    places, hit, faces = RayMeshIntersector(mesh).intersects_location(
        np.broadcast_to(pose[:3, 3], rays.shape), rays, multiple_hits=False
    )
    away = places - pose[:3, 3]
    depth, object_id = np.full(len(rays), np.nan), np.full(len(rays), -1)
    panorama = spec.projection == "equirectangular"
    depth[hit] = np.linalg.norm(away, axis=1) if panorama else -away @ pose[:3, 2]
    object_id[hit] = ids[faces]
    return depth.reshape(local.shape[:2]), object_id.reshape(local.shape[:2])


def differing(truth, expected):
    """Count the pixels whose depth or object id differs."""
    far = ~np.isclose(truth[0], expected[0], rtol=0, atol=1e-4, equal_nan=True)
    return np.count_nonzero(far | (truth[1] != expected[1]))


def test_distances_and_ids_are_those_of_embree(room):
    assert differing((room.depth, room.object_id), by_embree(SPEC, room.scene)) <= 1
    assert len(np.unique(room.object_id)) > 4
    rays = rays_by_hand(SPEC, 180.0)
    np.testing.assert_allclose(room.points, rays * room.depth[..., None], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "camera",
    [{"projection": "equirectangular", "height": 160, "width": 320},
     {"principal_point": (0.3, 0.35), "pixel_aspect": 1.2, "height": 200, "width": 250}],
    ids=str,
)  # fmt: skip
def test_many_rooms_agree_with_embree(camera):
    spec = preset_spec("interiors", min_visible_pixels=0, **camera)
    wrong = []
    for index in range(20):
        scene = next(filter(None, (sample_scene(spec, index, attempt) for attempt in range(99))))
        pixels = launch_fields(pack(spec, [scene]), ("depth", "object_id"))()
        truth = pixels["depth"][0], pixels["object_id"][0]
        wrong.append(differing(truth, by_embree(spec, scene)))
    assert sum(wrong) <= 1e-5 * len(wrong) * spec.height * spec.width


def test_files_are_verified(path):
    with open_rooms(path) as rooms:
        assert all(check.ok for check in verify_file(rooms))


def test_images_show_what_the_truth_does(room):
    """The base colour of a picture on the wall changes where its object id does."""
    albedo, ids = room.truth["albedo"], room.object_id
    assert (np.isnan(albedo).any(axis=-1) == (ids < 0)).mean() > 0.99
    largest = np.bincount(ids[ids > 0]).argmax()
    spread = [np.nanstd(albedo[ids == k], axis=0).mean() for k in (largest, 0)]
    assert spread[0] < spread[1]


def test_exports_say_that_depth_is_distance(room, tmp_path):
    paths = export_paths(0, tmp_path, "x", "png")
    export_room(room, paths, "png")
    told = json.loads(paths[-1].read_text())
    assert told["projection"] == "equirectangular"
    assert told["depth"]["kind"] != "planar"


@pytest.mark.parametrize("form", ["nerfstudio", "colmap", "bop", "moge", "stereo", "glb"])
def test_layouts_of_perspective_cameras_are_refused(path, form, tmp_path):
    with open_rooms(path) as rooms, pytest.raises(SpecError) as caught:
        export_folder(rooms, form, tmp_path / form)
    assert caught.value.found == "equirectangular"


@pytest.mark.parametrize(
    "change",
    [{"width": 96}, {"stereo": 0.1}, {"pixel_aspect": 2.0}, {"principal_point": (0.4, 0.5)},
     {"truth": ("layers",)}, {"truth": ("flow",), "views": (0.0, 20.0)}],
    ids=str,
)  # fmt: skip
def test_what_needs_a_plane_is_refused(change):
    with pytest.raises(SpecError):
        replace(SPEC, **change)

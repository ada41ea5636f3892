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
from scenegen.rendering.shells import with_shells
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.export.single import export_paths, export_room
from scenegen.rooms.make import make_dataset
from scenegen.rooms.verify import verify_file

HEIGHT, WIDTH = 64, 128
SPEC = preset_spec(
    "interiors", height=HEIGHT, width=WIDTH, spp=4, denoise=False, projection="equirectangular",
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


def directions():
    """Longitude to the right and latitude upwards, of an OpenGL camera."""
    longitude = np.radians(np.linspace(-180, 180, WIDTH, endpoint=False) + 180 / WIDTH)
    latitude = np.radians(np.linspace(90, -90, HEIGHT, endpoint=False) - 90 / HEIGHT)[:, None]
    x, z = np.sin(longitude) * np.cos(latitude), -np.cos(longitude) * np.cos(latitude)
    return np.stack([x, np.broadcast_to(np.sin(latitude), x.shape), z], axis=-1)


def whole_room(batch):
    """Return one mesh of a room, and the object ids of its triangles."""
    batch = with_shells(batch)
    triangles, ids = [], []
    for slot in np.flatnonzero(batch.shape[0] >= 0):
        mesh = mesh_to_cast(batch.shape_of, batch.names[batch.shape[0, slot]])
        matrix = batch.world_from_object[0, slot]
        corners = mesh.vertices.astype(float)[mesh.faces]
        triangles.append(corners @ matrix[:3, :3].T + matrix[:3, 3])
        ids.append(np.full(len(corners), 0 if slot == SPEC.object_slots else slot + 1))
    corners = np.concatenate(triangles).reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return trimesh.Trimesh(corners, faces, process=False), np.concatenate(ids)


def test_distances_and_ids_are_those_of_embree(room):
    mesh, ids = whole_room(pack(SPEC, [room.scene], (0,), objects_of(SPEC)))
    pose, rays = room.world_from_camera, directions().reshape(-1, 3)
    places, hit, faces = RayMeshIntersector(mesh).intersects_location(
        np.broadcast_to(pose[:3, 3], rays.shape), rays @ pose[:3, :3].T, multiple_hits=False
    )
    depth, object_id = np.full(len(rays), np.nan), np.full(len(rays), -1)
    depth[hit] = np.linalg.norm(places - pose[:3, 3], axis=1)
    object_id[hit] = ids[faces]
    assert (object_id != room.object_id.ravel()).sum() <= 1
    assert (~np.isclose(depth, room.depth.ravel(), atol=1e-4, equal_nan=True)).sum() <= 1
    assert len(np.unique(object_id)) > 4
    np.testing.assert_allclose(room.points, directions() * room.depth[..., None], atol=1e-6)


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

"""Single rooms as other tools read them: here OpenEXR, pypng, trimesh and Embree."""

import numpy as np
import OpenEXR
import png
import pytest
import trimesh

from scenegen import open_rooms
from scenegen.camera import pixel_directions, transform_vectors
from scenegen.description.scenes import SHAPE_NAMES
from scenegen.objects.scene_mesh import scene_mesh
from scenegen.rooms.export import PNG_DEPTH_UNIT, export_paths, export_room


@pytest.fixture(scope="module")
def room(float_path):
    with open_rooms(float_path) as file:
        return max(file, key=lambda room: len(room.scene.objects))


@pytest.fixture
def holey(room):
    """The room with a corner where nothing was hit."""
    from dataclasses import replace

    hole = np.zeros(room.depth.shape, bool)
    hole[:5, :7] = True
    return replace(
        room,
        depth=np.where(hole, np.float32(np.nan), room.depth),
        normal=np.where(hole[..., None], np.float32(0), room.normal),
        object_id=np.where(hole, -1, room.object_id).astype(np.int8),
    )


def export(room, folder, form, overwrite=False):
    """Write a room as row 7 of "a.h5"; return the files written."""
    paths = export_paths(7, folder, "a", form)
    export_room(room, paths, form, overwrite)
    return paths


def test_exr_has_the_standard_channels(tmp_path, holey):
    (path,) = export(holey, tmp_path, "exr")
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(channels) == {"R", "G", "B", "Z", "N.X", "N.Y", "N.Z", "id"}
    assert {c.dtype for c in channels.values()} == {np.dtype(np.float32)}
    for i, name in enumerate("RGB"):
        np.testing.assert_array_equal(channels[name], holey.image[..., i])
    for i, name in enumerate("XYZ"):
        np.testing.assert_array_equal(channels[f"N.{name}"], holey.normal[..., i])
    hit = holey.object_id >= 0
    assert 0 < (~hit).sum() < hit.size
    np.testing.assert_array_equal(channels["Z"][hit], holey.depth[hit])
    assert np.isposinf(channels["Z"][~hit]).all()
    np.testing.assert_array_equal(channels["id"], holey.object_id)


def test_png_has_16_bits(tmp_path, holey):
    paths = export(holey, tmp_path, "png")
    assert [p.name for p in paths] == [
        f"a-000007-{kind}.png" for kind in ("image", "depth", "normal", "object_id")
    ]
    pictures = {}
    for path, planes in zip(paths, (3, 1, 3, 1), strict=True):
        width, height, rows, info = png.Reader(bytes=path.read_bytes()).read()
        assert (width, height, info["bitdepth"], info["planes"]) == (40, 48, 16, planes)
        values = np.array([list(row) for row in rows]).reshape(height, width, planes)
        pictures[path.stem[9:]] = values.squeeze()
    assert PNG_DEPTH_UNIT == 1e-4
    hit = holey.object_id >= 0
    depth = pictures["depth"]
    assert np.abs(depth * 1e-4 - holey.depth)[hit].max() <= 0.5e-4 + 1e-7
    assert (depth[~hit] == 0).all()
    image = np.clip(holey.radiance, 0, 1)
    assert np.abs(pictures["image"] / 65535 - image).max() <= 0.5 / 65535 + 1e-7
    normal = pictures["normal"] / 65535 * 2 - 1
    assert np.abs(normal - holey.normal).max() <= 1 / 65535 + 1e-7
    np.testing.assert_array_equal(pictures["object_id"].astype(int) - 1, holey.object_id)


def test_ply_has_the_surfels(tmp_path, holey):
    (path,) = export(holey, tmp_path, "ply")
    cloud = trimesh.load(path)
    hit = holey.object_id >= 0
    assert cloud.vertices.shape == (hit.sum(), 3)
    np.testing.assert_allclose(cloud.vertices, holey.points_world[hit], atol=1e-6)
    elements = cloud.metadata["_ply_raw"]["vertex"]["data"]
    ids = elements["object_id"].ravel()
    np.testing.assert_array_equal(ids, holey.object_id[hit])
    on_room = np.abs(np.asarray(cloud.vertices)[ids == 0]).min(axis=1)
    assert on_room.max() < 1e-5
    normals = np.stack([elements[name].ravel() for name in ("nx", "ny", "nz")], axis=1)
    expected = transform_vectors(holey.world_from_camera, holey.normal)[hit]
    np.testing.assert_allclose(normals, expected, atol=1e-6)
    np.testing.assert_allclose(np.abs(normals[ids == 0]).max(axis=1), 1, atol=1e-5)
    colours = np.stack([elements[name].ravel() for name in ("red", "green", "blue")], axis=1)
    assert colours.dtype == np.uint8
    radiance = holey.radiance[hit].mean(axis=1)
    assert np.corrcoef(colours.mean(axis=1), radiance)[0, 1] > 0.98


def embree_depth(mesh, room):
    """Cast the room's pixel rays at a mesh with Embree; return planar depth."""
    ray = pytest.importorskip("trimesh.ray.ray_pyembree")
    directions = pixel_directions(*room.depth.shape, room.fov_y_degrees).reshape(-1, 3)
    rays = transform_vectors(room.world_from_camera, directions)
    origins = np.broadcast_to(room.world_from_camera[:3, 3], rays.shape)
    points, index, _ = ray.RayMeshIntersector(mesh).intersects_location(
        origins, rays, multiple_hits=False
    )
    depth = np.full(len(rays), np.nan)
    back = room.world_from_camera[:3, 2]
    depth[index] = (room.world_from_camera[:3, 3] - points) @ back
    return depth.reshape(room.depth.shape)


def check_depth_by_embree(path, mesh_of):
    """On 99.9% of the pixels to 1e-4; where they differ is on silhouettes."""
    close, edges, kinds = [], [], set()
    with open_rooms(path) as rooms:
        for room in rooms:
            close.append(np.abs(embree_depth(mesh_of(room), room) - room.depth) < 1e-4)
            ids = np.pad(room.object_id, 1, mode="edge")
            shifted = [ids[1 + y : 65 + y, 1 + x : 65 + x] for y in (-1, 0, 1) for x in (-1, 0, 1)]
            edges.append(np.any([s != room.object_id for s in shifted], axis=0))
            kinds |= {item.shape for item in room.scene.objects}
    close, edges = np.array(close), np.array(edges)
    assert close.mean() >= 0.999
    assert (close | edges).mean() > 0.9999
    return kinds


def test_obj_cast_by_another_engine_gives_the_depth(tmp_path, make_rooms):
    def mesh_of(room):
        (obj,) = export(room, tmp_path, "obj", overwrite=True)
        return trimesh.load(obj, force="mesh", process=False)

    path = make_rooms(tmp_path / "x.h5", 3, height=64, width=64, seed=11)
    assert len(check_depth_by_embree(path, mesh_of)) >= 4


@pytest.mark.slow
def test_meshes_of_100_rooms_give_the_depth(tmp_path, make_rooms):
    path = make_rooms(tmp_path / "x.h5", 100, height=64, width=64, seed=12)
    assert check_depth_by_embree(path, lambda room: scene_mesh(room.scene)) == set(SHAPE_NAMES)


@pytest.mark.parametrize("form", ["exr", "png", "ply", "obj"])
def test_existing_files_are_kept_without_overwrite(tmp_path, room, form):
    paths = export(room, tmp_path, form)
    paths[-1].write_text("mine")
    with pytest.raises(FileExistsError):
        export(room, tmp_path, form)
    assert paths[-1].read_text() == "mine"
    export(room, tmp_path, form, overwrite=True)
    assert paths[-1].read_bytes()[:4] != b"mine"
    assert sorted(tmp_path.iterdir()) == sorted(paths), "no temporary files"


def test_the_command_names_what_it_wrote(run, rooms_path):
    result = run("export", rooms_path, "--items", "3,5-6", "--format", "ply")
    assert result.exit_code == 0
    names = result.output.splitlines()
    assert names == [f"rooms-{i:06d}.ply" for i in (3, 5, 6)]
    with open_rooms(rooms_path) as rooms:
        cloud = trimesh.load(names[1])
        np.testing.assert_allclose(cloud.vertices, rooms[5].points_world.reshape(-1, 3), atol=1e-6)

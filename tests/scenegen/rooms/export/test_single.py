"""Single rooms as other tools read them: here OpenEXR, pypng, trimesh and Embree."""

import json
from dataclasses import replace

import numpy as np
import OpenEXR
import png
import pytest
import trimesh

from scenegen import open_rooms
from scenegen.camera import pixel_directions, transform_vectors
from scenegen.common.errors import SpecError
from scenegen.rooms.export.encoding import Encoding
from scenegen.rooms.export.formats import PICTURES
from scenegen.rooms.export.single import export_paths, export_room


@pytest.fixture(scope="module")
def simple(make_rooms, tmp_path_factory):
    """A room with a box and a prism of other materials, whose meshes are small."""
    path = tmp_path_factory.mktemp("simple") / "x.h5"
    make_rooms(path, 8, shapes=("box", "prism"), objects=(2, 2), random_reflectance=True,
               specular=(0.2, 0.4), shininess=(5, 20))  # fmt: skip
    with open_rooms(path) as file:
        return next(r for r in file if {i.shape for i in r.scene.objects} == {"box", "prism"})


@pytest.fixture(scope="module")
def holey(float_path):
    """A room with a corner where nothing was hit."""
    with open_rooms(float_path) as file:
        room = max(file, key=lambda room: len(room.scene.objects))
    hole = np.zeros(room.depth.shape, bool)
    hole[:5, :7] = True
    return replace(
        room,
        depth=np.where(hole, np.float32(np.nan), room.depth),
        normal=np.where(hole[..., None], np.float32(0), room.normal),
        object_id=np.where(hole, -1, room.object_id).astype(np.int8),
    )


def export(room, folder, form, overwrite=False, encoding=None):
    """Write a room as row 7 of "a.h5"; return the files written."""
    paths = export_paths(7, folder, "a", form)
    export_room(room, paths, form, overwrite, encoding=encoding)
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


def read_png(path):
    """Return pixels and bits of a PNG file, by pypng."""
    width, height, rows, about = png.Reader(bytes=path.read_bytes()).read()
    values = np.array([list(row) for row in rows]).reshape(height, width, about["planes"])
    return values.squeeze(), about["bitdepth"]


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("curve", ["srgb", "linear"])
def test_png_files_are_decoded_as_their_json_says(tmp_path, holey, curve, bits):
    *paths, about = export(holey, tmp_path, "png", encoding=Encoding(curve, bits, 0.9, 2e-4))
    assert [p.name for p in paths] == [f"a-000007-{name}.png" for name in PICTURES]
    about = json.loads(about.read_text())
    pictures = {}
    for name, path in zip(PICTURES, paths, strict=True):
        pictures[name], stored = read_png(path)
        assert stored == about[name]["bits"]
    step = 1 / (2**bits - 1)
    hit = holey.object_id >= 0
    depth = pictures["depth"] * about["depth"]["unit"]
    assert np.abs(depth - holey.depth)[hit].max() <= 1e-4 + 1e-6
    assert (pictures["depth"] == about["depth"]["nothing"])[~hit].all()
    normal = pictures["normal"] * about["normal"]["scale"] + about["normal"]["offset"]
    assert np.abs(normal - holey.normal).max() <= step + 1e-6
    ids = pictures["object_id"].astype(int) + about["object_id"]["offset"]
    np.testing.assert_array_equal(ids, holey.object_id)
    image = pictures["image"] * step
    if about["image"]["encoding"] == "srgb":
        slope = np.where(
            image <= 0.04045, 1 / 12.92, 2.4 / 1.055 * ((image + 0.055) / 1.055) ** 1.4
        )
        step = step * np.maximum(slope, 0.1)
        image = np.where(image <= 0.04045, image / 12.92, ((image + 0.055) / 1.055) ** 2.4)
    radiance = image / about["image"]["exposure"]
    assert (np.abs(radiance - holey.radiance) <= 0.56 * step + 1e-6).all(), "within half a step"
    np.testing.assert_array_equal(about["world_from_camera"], holey.world_from_camera)


def test_what_does_not_fit_is_refused_before_a_file_is_written(tmp_path, holey):
    far = replace(holey, depth=holey.depth + np.float32(6))
    bright = replace(holey, image=holey.image * np.float32(9))
    for form, room, field in [
        ("png", far, "depth"),
        ("png", bright, "radiance"),
        ("ply", bright, "radiance"),
    ]:
        with pytest.raises(SpecError) as refused:
            export(room, tmp_path, form)
        assert field in refused.value.where
        option, number = refused.value.hint.split()[1:3]
        assert list(tmp_path.iterdir()) == []
        change = {"--depth-unit": "depth_unit", "--exposure": "exposure"}[option]
        export(
            room, tmp_path, form, encoding=replace(Encoding(), **{change: float(number.strip(","))})
        )
        for path in tmp_path.iterdir():
            path.unlink()


def test_ply_has_the_surfels(tmp_path, holey):
    (path,) = export(holey, tmp_path, "ply")
    cloud = trimesh.load(path)
    hit = holey.object_id >= 0
    assert cloud.vertices.shape == (hit.sum(), 3)
    np.testing.assert_allclose(cloud.vertices, holey.points_world[hit], atol=1e-6)
    elements = cloud.metadata["_ply_raw"]["vertex"]["data"]
    ids = elements["object_id"].ravel()
    assert ids.dtype == np.uint8, "a type that Open3D reads"
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
        obj, _ = export(room, tmp_path, "obj", overwrite=True)
        return trimesh.load(obj, force="mesh", process=False)

    flat = ("box", "prism", "octahedron", "dodecahedron", "icosahedron")
    path = make_rooms(tmp_path / "x.h5", 6, height=64, width=64, seed=11, shapes=flat)
    assert len(check_depth_by_embree(path, mesh_of)) >= 4


def words(path, key):
    """The words after a keyword, line by line."""
    lines = [line.split() for line in path.read_text().splitlines() if line.startswith(f"{key} ")]
    return [line[1:] for line in lines]


def test_obj_has_names_and_materials(tmp_path, simple):
    """Read by trimesh, and by hand."""
    obj, mtl = export(simple, tmp_path, "obj")
    meshes = trimesh.load(obj, process=False).geometry  # by material
    names = [f"object_{k}_{item.shape}" for k, item in enumerate(simple.scene.objects, start=1)]
    assert [name for [name] in words(obj, "o")] == ["floor", "wall_x", "wall_z", *names]
    materials = [words(mtl, key) for key in ("newmtl", "Kd", "Ks", "Ns")]
    assert materials[0] == [["room"], ["object_1"], ["object_2"]]
    assert set(meshes) == {"room", "object_1", "object_2"}
    assert words(obj, "usemtl") == [["room"]] * 3 + materials[0][1:]
    assert words(obj, "mtllib") == [[mtl.name]]
    for k, item in enumerate(simple.scene.objects, start=1):
        assert [float(x) for x in materials[1][k]] == list(item.reflectance)
        assert [float(x) for x in materials[2][k]] == [item.specular] * 3
        assert [float(x) for x in materials[3][k]] == [item.shininess]
        mesh = meshes[f"object_{k}"]
        color = np.clip(np.array(item.reflectance) * 255, 0, 255)
        np.testing.assert_allclose(mesh.visual.material.diffuse[:3], color, atol=1)
        if item.shape == "box":
            sides = np.unique(mesh.vertex_normals.round(4), axis=0)
            assert len(sides) == 6, "flat sides stay flat"


def test_normals_of_obj_are_those_of_the_corners(tmp_path, simple):
    """Of both ends of each face's line `f v//n v//n v//n`, against the surface they lie on."""
    upright = (1.0, 0.0, 0.0, 0.0)
    item = replace(simple.scene.objects[0], shape="cylinder", rotation=upright)
    scene = replace(simple.scene, objects=(item,))
    obj, _ = export(replace(simple, scene=scene), tmp_path, "obj")
    v, vn = (np.array(words(obj, key), float) for key in ("v", "vn"))
    corners = " ".join(" ".join(face) for face in words(obj, "f")).replace("//", " ")
    corners = np.array(corners.split(), int).reshape(-1, 3, 2) - 1
    assert (corners.reshape(-1, 2).max(axis=0) == [len(v) - 1, len(vn) - 1]).all()
    points, normals = v[corners[..., 0]], vn[corners[..., 1]]
    face = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    assert (np.einsum("fi,fki->fk", face, normals) > 0).all(), "wound and facing alike"
    side = np.abs(normals[..., 1]) < 1e-6
    side[:6] = False  # two triangles of each plane of the room
    radial = (points - np.array(item.position))[side] * (1, 0, 1)
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    assert side.mean() > 0.3
    np.testing.assert_allclose(normals[side], radial, atol=1e-4)
    flat = np.abs(normals[6:][~side[6:]])
    np.testing.assert_allclose(flat, np.broadcast_to((0, 1, 0), flat.shape), atol=1e-6)


def test_the_command_names_what_it_wrote(run, rooms_path):
    result = run("export", rooms_path, "--items", "3,5-6", "--format", "ply")
    assert result.exit_code == 0
    names = result.output.splitlines()
    assert names == [f"rooms-{i:06d}.ply" for i in (3, 5, 6)]
    with open_rooms(rooms_path) as rooms:
        cloud = trimesh.load(names[1])
        np.testing.assert_allclose(cloud.vertices, rooms[5].points_world.reshape(-1, 3), atol=1e-6)

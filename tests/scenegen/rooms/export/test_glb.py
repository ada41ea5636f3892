"""Scenes as glTF: read by hand and by trimesh, cast by Embree, they give our depth and albedo."""

import io
import json
import struct

import numpy as np
import pytest
import trimesh
from PIL import Image

from scenegen import open_rooms
from scenegen.camera import pixel_directions, transform_vectors
from scenegen.description.presets import preset_spec
from scenegen.rendering.pictures.sun import sunlight_of
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.make import make_dataset

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TYPES = {5123: "<u2", 5125: "<u4", 5126: "<f4"}


@pytest.fixture(scope="module", params=["interiors", "shapes"])
def made(request, make_rooms, tmp_path_factory):
    """A file of rooms in two views, and its folder of GLB files."""
    folder = tmp_path_factory.mktemp(request.param)
    path = folder / "x.h5"
    if request.param == "shapes":
        make_rooms(path, 2, seed=5, views=(0.0, 30.0), random_reflectance=True, truth=("albedo",),
                   shapes=("box", "pyramid", "torus"), objects=(2, 3))  # fmt: skip
    else:
        how = {"spp": 1, "objects": (8, 12), "truth": ("albedo",), "views": (0.0, 20.0), "seed": 4}
        make_dataset(path, preset_spec("interiors", height=32, width=48, hours=(12.0, 20.0),
                                       **how), 1)  # fmt: skip
    with open_rooms(path) as rooms:
        export_folder(rooms, "glb", folder / "glb")
    return path, folder / "glb"


def parsed(path):
    """Its JSON, and a function that returns the values of an accessor."""
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack("<4sII I4s", data[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    about, rest = json.loads(data[20 : 20 + size]), data[20 + size :]
    (count, kind), buffer = struct.unpack("<I4s", rest[:8]), rest[8:]
    assert (count, kind) == (len(buffer), b"BIN\0")
    assert len(data) % 4 == size % 4 == count % 4 == 0
    assert about["buffers"] == [{"byteLength": count}]

    def values(index):
        told = about["accessors"][index]
        view = about["bufferViews"][told["bufferView"]]
        part = buffer[view["byteOffset"] :][: view["byteLength"]]
        return np.frombuffer(part, TYPES[told["componentType"]]).reshape(
            told["count"], WIDTHS[told["type"]])  # fmt: skip

    return about, buffer, values


def matrices(about):
    """World matrices of all nodes, from the scene's roots on; each is reached once."""
    found = {}

    def visit(node, above):
        assert node not in found
        told, local = about["nodes"][node], np.eye(4)
        x, y, z, w = told.get("rotation", (0, 0, 0, 1))
        local[:3, :3] = trimesh.transformations.quaternion_matrix((w, x, y, z))[:3, :3]
        local[:3, :3] *= told.get("scale", [1, 1, 1])
        local[:3, 3] = told.get("translation", (0, 0, 0))
        found[node] = above @ local
        for child in told.get("children", ()):
            visit(child, found[node])

    for root in about["scenes"][about["scene"]]["nodes"]:
        visit(root, np.eye(4))
    assert len(found) == len(about["nodes"])
    return found


def test_structure(made):
    for path in sorted(made[1].glob("*.glb")):
        assert path.stat().st_size < 20e6
        about, buffer, values = parsed(path)
        ends = [0]
        for view in about["bufferViews"]:
            assert view["byteOffset"] % 4 == 0
            assert ends[-1] <= view["byteOffset"] < ends[-1] + 4
            ends.append(view["byteOffset"] + view["byteLength"])
        assert ends[-1] <= len(buffer) < ends[-1] + 4
        used = set()
        for mesh in about["meshes"]:
            for part in mesh["primitives"]:
                held = {name: values(i) for name, i in part["attributes"].items()}
                faces = values(part["indices"])[:, 0]
                used |= {*part["attributes"].values(), part["indices"]}
                assert len(faces) % 3 == 0
                assert (np.unique(faces) == np.arange(len(held["POSITION"]))).all()
                box = about["accessors"][part["attributes"]["POSITION"]]
                assert held["POSITION"].min(axis=0).tolist() == box["min"]
                assert held["POSITION"].max(axis=0).tolist() == box["max"]
                for name in ("NORMAL", "TANGENT"):
                    if name in held:
                        length = np.linalg.norm(held[name][:, :3], axis=1)
                        np.testing.assert_allclose(length, 1, atol=1e-5)
                if "TANGENT" in held:
                    assert (np.abs(held["TANGENT"][:, 3]) == 1).all()
                    across = (held["TANGENT"][:, :3] * held["NORMAL"]).sum(axis=1)
                    assert np.abs(across).max() < 1e-5
                material = json.dumps(about["materials"][part["material"]])
                assert ("Texture" in material) <= ("TEXCOORD_0" in held)
                assert ("normalTexture" in material) == ("TANGENT" in held)
                for name, number in part["attributes"].items():
                    view = about["bufferViews"][about["accessors"][number]["bufferView"]]
                    assert (view["target"], view["byteStride"]) == (34962, held[name].strides[0])
        assert used == set(range(len(about["accessors"])))
        told = {"KHR_lights_punctual", "KHR_materials_specular", "KHR_materials_emissive_strength"}
        assert set(about["extensionsUsed"]) <= told


def test_nodes_are_views_objects_and_lights(made):
    with open_rooms(made[0]) as rooms:
        for row in range(0, len(rooms), 2):
            room = rooms[row]
            about, _, _ = parsed(made[1] / f"scene-{room.scene.index:06d}.glb")
            world, nodes = matrices(about), about["nodes"]
            number = {node["name"]: i for i, node in enumerate(nodes)}
            for i in range(2):
                view = rooms[row + i]
                node = number[f"view_{i}"]
                np.testing.assert_allclose(world[node], view.world_from_camera, atol=1e-9)
                lens = about["cameras"][nodes[node]["camera"]]["perspective"]
                assert lens["yfov"] == pytest.approx(np.radians(view.fov_y_degrees))
                assert lens["aspectRatio"] == view.depth.shape[1] / view.depth.shape[0]
            objects = {n["extras"]["object_id"]: i for i, n in enumerate(nodes) if "extras" in n}
            above = {child: i for i, n in enumerate(nodes) for child in n.get("children", ())}
            on = room.scene.interior.stands_on if room.scene.interior else [0] * len(objects)
            for k, item in enumerate(room.scene.objects, start=1):
                node = objects[k]
                assert nodes[node]["extras"]["instance"] == item.shape
                np.testing.assert_allclose(world[node][:3, 3], item.position, atol=1e-9)
                assert above[node] == (objects[on[k - 1]] if on[k - 1] else number["room"])
            lights = about["extensions"]["KHR_lights_punctual"]["lights"]
            kinds = {light["type"] for light in lights}
            if room.scene.interior is None:
                assert kinds == {"point"}
                for light, told in zip(room.scene.lights, lights, strict=True):
                    d = np.linalg.norm(np.subtract(light.position, rooms.spec.camera_target))
                    k_l, k_q = room.scene.attenuation
                    at_target = np.array(told["color"]) * told["intensity"] / d**2 / np.pi
                    np.testing.assert_allclose(at_target, light.color / (k_l * d + k_q * d * d))
            else:
                assert ("sun" in number) == (room.scene.interior.hour < 17.8)
                glow = any("emissiveFactor" in material for material in about["materials"])
                scale = about["scenes"][0]["extras"]["light_scale"]
                for light in lights:
                    most = np.pi if light["type"] == "directional" else np.pi * 1.5**2
                    assert light["intensity"] <= most * 1.001
                    if light["name"] == "sun":
                        sun = sunlight_of(room.scene.interior)[1]
                        assert light["intensity"] == pytest.approx(scale * sun.max())
                assert room.scene.interior.lit == glow == ("ceiling_light" in number)


def test_cast_by_embree_it_has_our_depth_and_albedo(made):
    """Each ray meets the nearest triangle; at silhouettes both casters may take another one."""
    engine = pytest.importorskip("trimesh.ray.ray_pyembree")
    with open_rooms(made[0]) as rooms:
        for room in rooms:
            path = made[1] / f"scene-{room.scene.index:06d}.glb"
            about, buffer, values = parsed(path)
            corners, colors, uv, part = triangles(about, buffer, values)
            faces = np.arange(3 * len(corners)).reshape(-1, 3)
            mesh = trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False)
            rays = pixel_directions(*room.depth.shape, room.fov_y_degrees).reshape(-1, 3)
            away = transform_vectors(room.world_from_camera, rays)
            eye = np.broadcast_to(room.world_from_camera[:3, 3], away.shape)
            hits, ray, face = engine.RayMeshIntersector(mesh).intersects_location(
                eye, away, multiple_hits=False
            )
            depth = np.full(len(rays), np.nan)
            depth[ray] = ((hits - eye[ray]) * away[ray]).sum(axis=1) / (away[ray] ** 2).sum(axis=1)
            known = np.isfinite(room.depth.ravel())
            assert (np.isfinite(depth) == known).mean() > 0.998
            off = np.abs(depth - room.depth.ravel())[known]
            assert (off < 1e-4).mean() > 0.998
            weights = trimesh.triangles.points_to_barycentric(mesh.triangles[face], hits)
            place = (uv[face] * weights[..., None]).sum(axis=1)
            found = np.array([colors[part[f]](*p) for f, p in zip(face, place, strict=True)])
            expected = room.truth["albedo"].reshape(-1, 3)[ray]
            off, ids = found - expected, room.object_id.ravel()[ray]
            assert (np.abs(off).max(axis=1) < 0.05).mean() > 0.88  # of reduced, compressed images
            for i in np.flatnonzero(np.bincount(ids) > 30):
                np.testing.assert_allclose(off[ids == i].mean(axis=0), 0, atol=0.01)


def triangles(about, buffer, values):
    """Corners in the world, samplers of colour by part, coordinates, and each triangle's part."""
    corners, colors, uv, part = [], [], [], []
    for node, matrix in matrices(about).items():
        mesh = about["nodes"][node].get("mesh")
        for primitive in about["meshes"][mesh]["primitives"] if mesh is not None else ():
            index = values(primitive["indices"])[:, 0]
            held = {name: values(i)[index] for name, i in primitive["attributes"].items()}
            place = held["POSITION"] @ matrix[:3, :3].T + matrix[:3, 3]
            corners.append(place.reshape(-1, 3, 3))
            uv.append(held.get("TEXCOORD_0", np.zeros((len(index), 2))).reshape(-1, 3, 2))
            part += [len(colors)] * (len(index) // 3)
            colors.append(sampler(about, buffer, about["materials"][primitive["material"]]))
    return np.concatenate(corners), colors, np.concatenate(uv), part


def sampler(about, buffer, material):
    """A function from texture coordinates to the linear base colour, of the nearest pixel."""
    surface = material["pbrMetallicRoughness"]
    if "baseColorTexture" not in surface:
        return lambda u, v: surface["baseColorFactor"][:3]
    texture = about["textures"][surface["baseColorTexture"]["index"]]
    view = about["bufferViews"][about["images"][texture["source"]]["bufferView"]]
    data = buffer[view["byteOffset"] :][: view["byteLength"]]
    srgb = np.asarray(Image.open(io.BytesIO(data))) / 255
    height, width = srgb.shape[:2]
    assert max(height, width) <= 512
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return lambda u, v: linear[int(v * height) % height, int(u * width) % width]


def test_trimesh_reads_it_and_it_is_the_same_again(made, tmp_path):
    with open_rooms(made[0]) as rooms:
        export_folder(rooms, "glb", tmp_path / "again", list(range(len(rooms))))
        for path in sorted(made[1].glob("*.glb")):
            assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes()
            scene = trimesh.load_scene(path)
            about, _, _ = parsed(path)
            names = {node["name"] for node in about["nodes"] if "mesh" in node}
            assert names <= set(scene.graph.nodes)
            assert sum(len(mesh.faces) for mesh in scene.dump()) > 4

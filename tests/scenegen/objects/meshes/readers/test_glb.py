"""GLB files: transforms of nodes against trimesh's reader, and hostile files."""

import base64
import json
import struct

import numpy as np
import pytest
import trimesh
from known_meshes import SPHERE

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.read import parse_mesh


def glb(document, binary=b""):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary if binary else b""
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


TRIANGLES = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)], "<f4").tobytes()
DOCUMENT = {
    "asset": {"version": "2.0"},
    "buffers": [{"byteLength": len(TRIANGLES)}],
    "bufferViews": [{"buffer": 0, "byteLength": len(TRIANGLES)}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}],
    "nodes": [{"mesh": 0}],
}


def test_glb_with_transforms_against_trimesh():
    """Two meshes at five places, under turned, scaled, mirrored and nested nodes."""
    scene = trimesh.Scene()
    rng = np.random.default_rng(3)
    parts = {"ball": SPHERE, "box": trimesh.creation.box((1, 2, 3))}
    parent = scene.graph.base_frame
    for i in range(5):
        matrix = trimesh.transformations.random_rotation_matrix(rng.random(3))
        matrix[:3, :3] *= rng.uniform(0.5, 2) * (-1) ** i
        matrix[:3, 3] = rng.uniform(-4, 4, 3)
        name = ("ball", "box")[i % 2]
        node = f"{name}{i}"
        scene.add_geometry(parts[name], node, node, parent_node_name=parent, transform=matrix)
        parent = node if i % 2 else parent
    expected = scene.to_mesh()
    vertices, faces = parse_mesh(scene.export(file_type="glb"), ".glb")
    assert len(faces) == len(expected.faces)
    middles = [t.mean(axis=1) for t in (vertices[faces], expected.triangles)]
    ours, theirs = (some[np.lexsort(some.round(3).T)] for some in middles)
    np.testing.assert_allclose(ours, theirs, atol=1e-4)


def test_glb_by_hand():
    vertices, faces = parse_mesh(glb(DOCUMENT, TRIANGLES), ".glb")
    assert faces.tolist() == [[0, 1, 2], [1, 2, 3]], "a strip"
    uri = "data:application/octet-stream;base64," + base64.b64encode(TRIANGLES).decode()
    fan = {"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}
    lines = {"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}
    node = {"mesh": 0, "translation": [0, 0, 5], "rotation": [0, 0, 0.5**0.5, 0.5**0.5]}
    changed = DOCUMENT | {
        "buffers": [{"uri": uri, "byteLength": 48}],
        "meshes": [{"primitives": fan["primitives"] + lines["primitives"]}],
        "nodes": [node, {"mesh": 0}],
        "scenes": [{"nodes": [1]}, {"nodes": [0]}],
        "scene": 1,
        "images": [{"uri": "/no/such/file.png"}, {"uri": "https://127.0.0.1:9/x.png"}],
    }
    vertices, faces = parse_mesh(glb(changed), ".glb")
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    np.testing.assert_allclose(vertices, [(0, 0, 5), (0, 1, 5), (-1, 0, 5), (-1, 1, 6)], atol=1e-6)


def test_glb_indices_do_not_reach_into_the_next_part():
    """The next part may be another primitive of the mesh or of another node."""
    indices = np.array([0, 1, 2, 0, 1, 4], "<u2").tobytes()
    part = {"attributes": {"POSITION": 0}, "indices": 1}
    view = {"buffer": 0, "byteOffset": len(TRIANGLES), "byteLength": len(indices)}
    order = {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6}
    changed = DOCUMENT | {
        "bufferViews": [*DOCUMENT["bufferViews"], view],
        "accessors": [*DOCUMENT["accessors"], order],
        "meshes": [{"primitives": [part, part]}],
        "nodes": [{"mesh": 0}, {"mesh": 0}],
    }
    vertices, faces = parse_mesh(glb(changed, TRIANGLES + indices), ".glb")
    assert len(vertices) == 16
    assert (faces[1::2].min(axis=1) < 0).all()
    assert faces[::2].tolist() == [[i, i + 1, i + 2] for i in (0, 4, 8, 12)]


def tables(*arrays):
    """Return accessors, from number 1 on, and the bytes of `TRIANGLES` and these arrays."""
    kinds = {"u1": 5121, "f4": 5126}
    types = {2: {1: "SCALAR", 3: "VEC3", 4: "VEC4"}, 3: {4: "MAT4"}}
    views, accessors, data = [*DOCUMENT["bufferViews"]], [*DOCUMENT["accessors"]], TRIANGLES
    for values in arrays:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes})
        kind, form = kinds[values.dtype.str[1:]], types[values.ndim][values.shape[-1]]
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": kind,
                "type": form,
                "count": len(values),
            }
        )
        data += values.tobytes()
    return {"bufferViews": views, "accessors": accessors}, data


POINTS = np.frombuffer(TRIANGLES, "<f4").reshape(4, 3).astype(float)


def test_glb_instances_stand_where_their_attributes_say():
    places = np.array([(0, 0, 0), (5, 0, 0), (0, 7, 0)], "<f4")
    sizes = np.array([(1, 1, 1), (2, 2, 2), (1, 1, 3)], "<f4")
    more, data = tables(places, sizes)
    attributes = {"TRANSLATION": 1, "SCALE": 2, "_COLOR": 1}
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    node = {"mesh": 0, "translation": [0, 0, 1], "extensions": instancing}
    required = {"extensionsRequired": ["EXT_mesh_gpu_instancing"], "nodes": [node]}
    vertices, faces = parse_mesh(glb(DOCUMENT | more | required, data), ".glb")
    expected = [
        POINTS * size + place + (0, 0, 1) for size, place in zip(sizes, places, strict=True)
    ]
    np.testing.assert_allclose(vertices, np.concatenate(expected))
    assert len(faces) == 6


def test_glb_skin_places_vertices_by_their_joints_not_by_their_node():
    """Two joints, one moved and one scaled; the last point belongs to both by halves."""
    joints = np.array([(0, 1, 0, 0)] * 4, "<u1")
    weights = np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 3, 0, 0), (1, 1, 0, 0)], "<f4")
    inverse = np.stack([np.eye(4), np.diag([0.5, 0.5, 0.5, 1])]).astype("<f4")
    inverse[0, 3, :3] = 0, 0, -1  # stored by columns
    more, data = tables(joints, weights, inverse)
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    skinned = {
        "meshes": [{"primitives": [{"attributes": attributes, "mode": 5}]}],
        "nodes": [
            {"mesh": 0, "skin": 0, "scale": [100, 100, 100]},
            {"translation": [3, 0, 0]},
            {"scale": [4, 4, 4]},
        ],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 3}],
    }
    vertices, _ = parse_mesh(glb(DOCUMENT | more | skinned, data), ".glb")
    by_first, by_second = POINTS + np.array([3, 0, -1]), POINTS * 2
    expected = [by_first[0], by_second[1], by_second[2], (by_first[3] + by_second[3]) / 2]
    np.testing.assert_allclose(vertices, expected, rtol=1e-6)
    away = skinned | {"scenes": [{"nodes": [0, 1]}]}
    with pytest.raises(BadMeshError, match="joint 2"):
        parse_mesh(glb(DOCUMENT | more | away, data), ".glb")


def test_glb_morph_weights_move_points_and_hidden_nodes_are_left_out():
    """The second target is sparse: only its last point moves."""
    first = np.array([(0, 0, 1)] * 4, "<f4")
    more, data = tables(first, np.array([[3]], "<u1"), np.array([(8, 0, 0)], "<f4"))
    index, value = ({"bufferView": 2, "componentType": 5121}, {"bufferView": 3})
    sparse = {"count": 1, "indices": index, "values": value}
    more["accessors"][2] = {"componentType": 5126, "type": "VEC3", "count": 4, "sparse": sparse}
    targets = [{"POSITION": 1}, {"POSITION": 2}]
    mesh = {"primitives": [{"attributes": {"POSITION": 0}, "mode": 5, "targets": targets}]}
    hidden = {"mesh": 0, "extensions": {"KHR_node_visibility": {"visible": False}}}
    nodes = [{"mesh": 0}, {"mesh": 0, "weights": [0, 0.5]}, hidden]
    morphed = {"meshes": [mesh | {"weights": [2, 0]}], "nodes": nodes}
    vertices, _ = parse_mesh(glb(DOCUMENT | more | morphed, data), ".glb")
    np.testing.assert_allclose(vertices[:4], POINTS + np.array([0, 0, 2]))
    np.testing.assert_allclose(vertices[4:], POINTS + np.outer([0, 0, 0, 1], [4, 0, 0]))


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"buffers": [{"uri": "../../secret.bin"}]}, "another file, '../../secret.bin'"),
        ({"buffers": [{"uri": "file:///etc/passwd"}]}, "another file"),
        ({"buffers": [{"uri": "https://127.0.0.1:9/x.bin"}]}, "another file"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "compression by KHR_draco"),
        ({"nodes": [{"children": [0], "mesh": 0}], "scenes": [{"nodes": [0]}]}, "more"),
        ({"nodes": [{"mesh": 0, "children": [1, 1]}, {"children": [2, 2]}, {}]}, "more"),
        ({"nodes": [{"mesh": 7}]}, "IndexError"),
        ({"accessors": [DOCUMENT["accessors"][0] | {"count": 5}]}, "longer than its data"),
        ({"accessors": [DOCUMENT["accessors"][0] | {"count": 10**12}]}, "longer than its data"),
        ({"accessors": [DOCUMENT["accessors"][0] | {"byteOffset": -12}]}, "longer than its data"),
        ({"accessors": [{"componentType": 5126, "type": "VEC3", "count": 9}]}, "empty tables"),
        ({"accessors": [DOCUMENT["accessors"][0] | {"type": "MAT5"}]}, "KeyError"),
        ({"extensionsRequired": ["VENDOR_geometry"]}, "the extension VENDOR_geometry"),
        ({"extensionsRequired": ["KHR_materials_unlit", "EXT_x"]}, "the extension EXT_x"),
    ],
)
def test_glb_that_is_hostile(change, found):
    with pytest.raises(BadMeshError) as refused:
        parse_mesh(glb(DOCUMENT | change, TRIANGLES), ".glb")
    assert refused.value.where.startswith("GLB file")
    assert found in refused.value.found


def test_glb_that_multiplies_is_stopped_before_it_fills_the_memory():
    points = np.zeros((3000, 3), "<f4").tobytes()
    many = DOCUMENT | {
        "bufferViews": [{"buffer": 0, "byteLength": len(points)}],
        "accessors": [DOCUMENT["accessors"][0] | {"count": 3000}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * 50_000}],
        "nodes": [{"mesh": 0}] * 50_000,
    }
    with pytest.raises(BadMeshError) as refused:
        parse_mesh(glb(many, points), ".glb")
    assert (refused.value.where, refused.value.expected) == ("faces", "at most 2000000")
    deep = b'{"nodes":' + b"[" * 200_000 + b"]" * 200_000 + b"}"
    data = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(deep), len(deep), b"JSON") + deep
    with pytest.raises(BadMeshError, match="RecursionError"):
        parse_mesh(data, ".glb")

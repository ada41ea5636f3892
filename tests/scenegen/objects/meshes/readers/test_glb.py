"""GLB files: transforms of nodes against trimesh's reader, and hostile files."""

import base64
import json
import struct
from typing import Any

import numpy as np
import pytest
import trimesh
from known_meshes import SPHERE

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.read import parse_mesh


def glb(document: dict[str, Any], binary: bytes = b"") -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary if binary else b""
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


TRIANGLES = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)], "<f4").tobytes()
DOCUMENT: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "buffers": [{"byteLength": len(TRIANGLES)}],
    "bufferViews": [{"buffer": 0, "byteLength": len(TRIANGLES)}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}],
    "nodes": [{"mesh": 0}],
}


def test_glb_with_transforms_against_trimesh() -> None:
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


def test_glb_by_hand() -> None:
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


def test_glb_indices_do_not_reach_into_the_next_part() -> None:
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
        ({"accessors": [DOCUMENT["accessors"][0] | {"type": "MAT4"}]}, "KeyError"),
    ],
)
def test_glb_that_is_hostile(change: dict[str, Any], found: str) -> None:
    with pytest.raises(BadMeshError) as refused:
        parse_mesh(glb(DOCUMENT | change, TRIANGLES), ".glb")
    assert refused.value.where.startswith("GLB file")
    assert found in refused.value.found


def test_glb_that_multiplies_is_stopped_before_it_fills_the_memory() -> None:
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

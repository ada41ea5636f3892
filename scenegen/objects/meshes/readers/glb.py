"""GLB files (binary glTF 2.0): the triangles of a scene's nodes, placed by their transforms.

Other files are not opened and images not decoded. What a few bytes could make huge (a mesh used a
million times, nodes that contain each other) is counted before it is built.
"""

import base64
import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from scenegen.common.rotations import rotation_matrix
from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError, check_most
from scenegen.objects.solids import Array

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}


def read_glb(data: bytes) -> tuple[Array, Array]:
    """Return vertices (V, 3) and triangles (F, 3) of the default scene, or else of all nodes.

    Raises:
        BadMeshError: the file is no GLB file of version 2, is broken or compressed, needs other
            files, or has more than MOST_FACES faces.
    """
    document, binary = _chunks(data)
    used = _COMPRESSED & set(document.get("extensionsRequired", ()))
    if used:
        raise BadMeshError("GLB file", f"compression by {', '.join(used)}", "none")
    buffers = [_buffer(one, binary) for one in document.get("buffers", ())]
    known: dict[tuple[int, int], tuple[Array, Array]] = {}
    vertices, faces, first, count = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0, 0
    for mesh, matrix in _placed_meshes(document):
        for i, one in enumerate(document["meshes"][mesh]["primitives"]):
            if (mesh, i) not in known:
                known[mesh, i] = _primitive(document, buffers, one)
            points, triangles = known[mesh, i]
            count += max(1, len(triangles), len(points) // 3)  # even an empty one costs time
            check_most("faces", count, limits.MOST_FACES)
            if not len(points):
                continue
            vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
            faces.append(triangles + first)
            first += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    if data[:4] != b"glTF" or len(data) < 20:
        raise BadMeshError("GLB file", "a file that does not begin with glTF", "a binary glTF file")
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2:
        raise BadMeshError("GLB file", f"version {version}", "version 2", "export it again")
    if length > len(data):
        raise BadMeshError("GLB file", f"{len(data)} bytes", length, "it is cut short")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    document = json.loads(chunks.get(b"JSON", b"null"))
    if not isinstance(document, dict):
        raise BadMeshError("GLB file", "no JSON chunk")
    return document, chunks.get(b"BIN\0", b"")


def _buffer(one: dict[str, Any], binary: bytes) -> bytes:
    uri = one.get("uri")
    if uri is None:
        return binary
    if not uri.startswith("data:") or ";base64," not in uri:
        found, hint = f"geometry in another file, {uri[:80]!r}", "export it as one GLB file"
        raise BadMeshError("GLB file", found, "geometry inside", hint)
    return base64.b64decode(uri.partition(";base64,")[2])


def _placed_meshes(document: dict[str, Any]) -> Iterator[tuple[int, Array]]:
    """Yield mesh number and world transform of each node that has a mesh."""
    nodes = document.get("nodes", [])
    scenes = document.get("scenes", [])
    if scenes:
        roots = scenes[document.get("scene", 0)].get("nodes", [])
    else:
        held = {child for node in nodes for child in node.get("children", ())}
        roots = [i for i in range(len(nodes)) if i not in held]
    waiting = [(root, np.eye(4)) for root in reversed(roots)]
    seen = 0
    while waiting:
        index, above = waiting.pop()
        seen += 1
        if seen > min(len(nodes), limits.MOST_NODES):  # a node has one parent at most
            expected = f"at most {limits.MOST_NODES}, none inside itself"
            raise BadMeshError("GLB file's nodes", "more", expected)
        node = nodes[index]
        matrix = above @ _transform(node)
        if "mesh" in node:
            yield node["mesh"], matrix
        waiting.extend((child, matrix) for child in reversed(node.get("children", [])))


def _transform(node: dict[str, Any]) -> Array:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T  # stored by columns
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix((w, x, y, z)) * np.array(node.get("scale", (1, 1, 1)), float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _primitive(
    document: dict[str, Any], buffers: list[bytes], one: dict[str, Any]
) -> tuple[Array, Array]:
    """Return points and triangles of a primitive; none if it consists of points or lines."""
    mode, attributes = one.get("mode", _TRIANGLES), one.get("attributes", {})
    none = np.empty((0, 3)), np.empty((0, 3), np.int64)
    if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
        return none
    points = _accessor(document, buffers, attributes["POSITION"]).astype(np.float64)
    if "indices" in one:
        order = _accessor(document, buffers, one["indices"]).reshape(-1).astype(np.int64)
    else:
        order = np.arange(len(points))
    # An index beyond its own points would refer to the points of the next primitive.
    order = np.where(order < len(points), order, -(1 << 40))
    if mode == _TRIANGLES:
        return points, order[: len(order) // 3 * 3].reshape(-1, 3)
    head = order[:-2] if mode == _STRIP else np.broadcast_to(order[:1], (max(len(order) - 2, 0),))
    return points, np.stack([head, order[1:-1], order[2:]], axis=1)


def _accessor(document: dict[str, Any], buffers: list[bytes], index: int) -> Array:
    """Return an accessor as a table, (n, width); normalised integers become fractions."""
    one = document["accessors"][index]
    kind, width, count = np.dtype(_TYPES[one["componentType"]]), _WIDTHS[one["type"]], one["count"]
    if "sparse" in one or "bufferView" not in one:
        raise BadMeshError("GLB file", "sparse or empty tables", hint="export it without them")
    view = document["bufferViews"][one["bufferView"]]
    data = buffers[view["buffer"]]
    start = view.get("byteOffset", 0) + one.get("byteOffset", 0)
    row = kind.itemsize * width
    stride = view.get("byteStride", row)
    if min(start, count, stride - row) < 0 or start + stride * (count - 1) + row > len(data):
        found, hint = "a table longer than its data", "it is cut short, or broken"
        raise BadMeshError("GLB file", found, hint=hint)
    table = np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))
    if one.get("normalized") and kind.kind in "iu":
        return np.maximum(table / np.iinfo(kind).max, -1.0)
    return table

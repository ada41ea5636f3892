"""GLB files (binary glTF 2.0): the triangles of a scene's nodes, placed by their transforms.

Other files are not opened and images not decoded. What a few bytes could make huge (a mesh used a
million times, nodes that contain each other) is counted before it is built.
"""

import base64
import json
import struct
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from scenegen.common.rotations import rotation_matrix
from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError, check_most
from scenegen.objects.solids import Array

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}
# Extensions that a file may require: those that change no geometry, and those that are applied.
_HARMLESS = (
    "KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_",
    "KHR_xmp", "KHR_mesh_quantization", "KHR_node_visibility", "EXT_mesh_gpu_instancing",
)  # fmt: skip
Table = Callable[[int], Array]  # from the number of an accessor to its values


def read_glb(data: bytes) -> tuple[Array, Array]:
    """Return vertices (V, 3) and triangles (F, 3) of the default scene, or else of all nodes.

    Node transforms, instances (EXT_mesh_gpu_instancing), morph weights and skins are applied; the
    pose is that of the nodes, without animations. Nodes that KHR_node_visibility hides are left
    out.

    Raises:
        BadMeshError: the file is no GLB file of version 2, is broken or compressed, needs other
            files or an unknown extension, or has more than MOST_FACES faces.
    """
    document, binary = _chunks(data)
    for name in document.get("extensionsRequired", ()):
        if not name.startswith(_HARMLESS):
            found = f"compression by {name}" if name in _COMPRESSED else f"the extension {name}"
            raise BadMeshError("GLB file", found, "a file without it", "export it without this")
    buffers = [_buffer(buffer, binary) for buffer in document.get("buffers", ())]

    def table(index: int) -> Array:
        return _accessor(document, buffers, index)

    worlds = _world_from_node(document)
    cache: dict[tuple[int, int, tuple[float, ...]], tuple[Array, Array]] = {}
    vertices, faces, first, count = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0, 0
    for index, world in worlds.items():
        node = document["nodes"][index]
        if "mesh" not in node:
            continue
        mesh = document["meshes"][node["mesh"]]
        weights = tuple(map(float, node.get("weights", mesh.get("weights", ()))))
        for i, primitive in enumerate(mesh["primitives"]):
            key = node["mesh"], i, weights
            if key not in cache:
                cache[key] = _primitive(table, primitive, weights)
            points, triangles = cache[key]
            for matrix in _placements(document, table, node, primitive, worlds, world):
                count += max(1, len(triangles), len(points) // 3)  # even an empty one costs time
                check_most("faces", count, limits.MOST_FACES)
                if not len(points):
                    continue
                vertices.append(_moved(points, matrix))
                faces.append(triangles + first)
                first += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def _moved(points: Array, matrix: Array) -> Array:
    """Apply one transform (4, 4), or one for each point (V, 4, 4)."""
    if matrix.ndim == 2:
        return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])
    return np.asarray(np.einsum("vab,vb->va", matrix[:, :3, :3], points) + matrix[:, :3, 3])


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


def _buffer(buffer: dict[str, Any], binary: bytes) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        return binary
    if not uri.startswith("data:") or ";base64," not in uri:
        found, hint = f"geometry in another file, {uri[:80]!r}", "export it as one GLB file"
        raise BadMeshError("GLB file", found, "geometry inside", hint)
    return base64.b64decode(uri.partition(";base64,")[2])


def _world_from_node(document: dict[str, Any]) -> dict[int, Array]:
    """Return the transform of each visible node of the scene, by number, parents first."""
    nodes = document.get("nodes", [])
    scenes = document.get("scenes", [])
    if scenes:
        roots = scenes[document.get("scene", 0)].get("nodes", [])
    else:
        held = {child for node in nodes for child in node.get("children", ())}
        roots = [i for i in range(len(nodes)) if i not in held]
    waiting = [(root, np.eye(4)) for root in reversed(roots)]
    worlds: dict[int, Array] = {}
    seen = 0
    while waiting:
        index, above = waiting.pop()
        seen += 1
        if seen > min(len(nodes), limits.MOST_NODES):  # a node has one parent at most
            expected = f"at most {limits.MOST_NODES}, none inside itself"
            raise BadMeshError("GLB file's nodes", "more", expected)
        node = nodes[index]
        if not _extension(node, "KHR_node_visibility").get("visible", True):
            continue
        worlds[index] = above @ _transform(node)
        waiting.extend((child, worlds[index]) for child in reversed(node.get("children", [])))
    return worlds


def _extension(holder: dict[str, Any], name: str) -> dict[str, Any]:
    extension: dict[str, Any] = holder.get("extensions", {}).get(name, {})
    return extension


def _placements(
    document: dict[str, Any],
    table: Table,
    node: dict[str, Any],
    primitive: dict[str, Any],
    worlds: dict[int, Array],
    world: Array,
) -> Iterator[Array]:
    """Yield the transforms that place a primitive: one (4, 4), or (V, 4, 4) where a skin bends it.

    A skin takes the place of the node's own transform (glTF 2.0, section 3.7.3.3).
    """
    instances = _extension(node, "EXT_mesh_gpu_instancing").get("attributes")
    if "skin" in node and "JOINTS_0" in primitive.get("attributes", {}):
        yield _bent(document["skins"][node["skin"]], table, primitive["attributes"], worlds)
    elif instances is None:
        yield world
    else:
        names = [name for name in ("TRANSLATION", "ROTATION", "SCALE") if name in instances]
        tables = {name.lower(): table(instances[name]) for name in names}
        for i in range(min(map(len, tables.values()), default=0)):
            yield world @ _transform({name: values[i] for name, values in tables.items()})


def _bent(
    skin: dict[str, Any], table: Table, attributes: dict[str, Any], worlds: dict[int, Array]
) -> Array:
    """Return the transform of each vertex of a skinned mesh, (V, 4, 4)."""
    hidden = [joint for joint in skin["joints"] if joint not in worlds]
    if hidden:
        raise BadMeshError(
            "GLB file's skin", f"joint {hidden[0]}, outside the scene", "a node of it"
        )
    joints = np.stack([worlds[joint] for joint in skin["joints"]])
    if "inverseBindMatrices" in skin:
        inverse = table(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        joints = joints @ inverse[: len(joints)]
    sets = [i for i in range(8) if f"JOINTS_{i}" in attributes and f"WEIGHTS_{i}" in attributes]
    numbers = np.concatenate([table(attributes[f"JOINTS_{i}"]) for i in sets], axis=1)
    weights = np.concatenate([table(attributes[f"WEIGHTS_{i}"]) for i in sets], axis=1)
    total = weights.sum(axis=1, keepdims=True, dtype=np.float64)
    weights = weights / np.where(total > 0, total, 1)
    bent = np.zeros((len(weights), 4, 4))
    for weight, number in zip(weights.T, numbers.T.astype(np.int64), strict=True):
        bent += weight[:, None, None] * joints[number]
    return bent


def _transform(node: dict[str, Any]) -> Array:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T  # stored by columns
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix((w, x, y, z)) * np.array(node.get("scale", (1, 1, 1)), float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _primitive(
    table: Table, primitive: dict[str, Any], weights: tuple[float, ...]
) -> tuple[Array, Array]:
    """Return points, morphed by weights, and triangles; none if it consists of points or lines."""
    mode, attributes = primitive.get("mode", _TRIANGLES), primitive.get("attributes", {})
    if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
        return np.empty((0, 3)), np.empty((0, 3), np.int64)
    points = table(attributes["POSITION"]).astype(np.float64)
    for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
        if weight and "POSITION" in target:
            points = points + weight * table(target["POSITION"])
    if "indices" in primitive:
        order = table(primitive["indices"]).reshape(-1).astype(np.int64)
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
    accessor = document["accessors"][index]
    kind, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
    count = accessor["count"]

    def view(part: dict[str, Any], kind: np.dtype[Any], width: int, count: int) -> Array:
        place = document["bufferViews"][part["bufferView"]]
        data = buffers[place["buffer"]]
        start = place.get("byteOffset", 0) + part.get("byteOffset", 0)
        row = kind.itemsize * width
        stride = place.get("byteStride", row)
        if min(start, count, stride - row) < 0 or start + stride * (count - 1) + row > len(data):
            found, hint = "a table longer than its data", "it is cut short, or broken"
            raise BadMeshError("GLB file", found, hint=hint)
        return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))

    if "bufferView" in accessor:
        values = view(accessor, kind, width, count)
    elif "sparse" in accessor:  # zeros, some of them replaced
        check_most("corners", count, limits.MOST_CORNERS)
        values = np.zeros((count, width), kind)
    else:
        raise BadMeshError("GLB file", "empty tables", hint="export it without them")
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        number = np.dtype(_TYPES[sparse["indices"]["componentType"]])
        places = view(sparse["indices"], number, 1, sparse["count"])[:, 0]
        values = values.copy()
        values[places] = view(sparse["values"], kind, width, sparse["count"])
    if accessor.get("normalized") and kind.kind in "iu":
        return np.maximum(values / np.iinfo(kind).max, -1.0)
    return values

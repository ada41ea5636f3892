"""Own colours of a mesh: what its file says at each corner of each triangle, read by trimesh.

Base colours, vertex colours, face colours, and textures sampled at the corners. Only the file
itself is read, so pictures and materials in files beside it do not count.
"""

import io
import re
import warnings
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from scenegen.common.srgb import decoded
from scenegen.objects.meshes.appearance.materials import (
    MeshMaterial,
    Unread,
    glb_material,
    mtl_material,
    plain_glb,
)
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.text import utf8

Array = NDArray[Any]
NEAR = 1e-5  # distance of centres of the same triangle, in bounding radii; or more, of others
SAME_PLANE = 1e-4  # distance of corners from a triangle's plane, in bounding radii
CANDIDATES = 8, 64  # triangles that may be of the same polygon; first few, then many
HEAD = 2**16  # bytes of an OBJ file that are searched for colours beyond 1
_NUMBER = rb"[ \t]+[-+.\deE]+"
LARGE_COLOR = re.compile(
    rb"(?m)^v(?:%b){3}(?=(?:%b){3}\s*$)(?:%b){0,2}[ \t]+0*([2-9]|[1-9]\d)" % ((_NUMBER,) * 3)
)


class Piece(NamedTuple):
    """A mesh of trimesh's, what its file says about its surface, and where pictures lie, (V, 2)."""

    mesh: trimesh.Trimesh
    material: MeshMaterial | None
    uv: Array | None


def corner_colors(
    data: bytes, suffix: str, up: str, vertices: Array, faces: Array, unread: Unread
) -> NDArray[np.float32]:
    """Return linear RGB, 0 to 1, at the corners of a cleaned mesh's faces, (F, 3, 3).

    Without colours in the file all are 1.

    Args:
        data, suffix: content of the file, and the suffix of its name.
        up: the axis, "y" or "z", that points up in the file.
        vertices, faces: of the cleaned mesh, (V, 3) and (F, 3).
        unread: gets what is not read.

    Raises BadMeshError as `read_triangles` and `matched`.
    """
    triangles, pieces = read_triangles(data, suffix.lower(), unread)
    if not len(triangles):
        return np.ones((len(faces), 3, 3), np.float32)
    is_linear = suffix.lower() == ".glb"
    colors = np.concatenate([colors_of(piece, is_linear) for piece in pieces])
    face, theirs, ours = matched(triangles, up, vertices, faces)
    corner = np.linalg.norm(ours[:, :, None] - theirs[:, None], axis=-1).argmin(axis=2)
    return np.asarray(colors[face[:, None], corner].astype(np.float32))


def read_triangles(
    data: bytes, suffix: str, unread: Unread, resolver: Any = None
) -> tuple[Array, list[Piece]]:
    """Return a file's triangles in its own frame, (n, 3, 3), and the pieces that have them.

    Raises BadMeshError where trimesh cannot read the file. `resolver` finds the files beside it.
    """
    triangles, pieces = [np.zeros((0, 3, 3))], list[Piece]()
    materials: dict[int, MeshMaterial] = {}
    try:
        if suffix == ".glb":
            data = plain_glb(data, unread)
        elif suffix == ".obj":
            data = utf8(data)
            if LARGE_COLOR.search(data, 0, HEAD):
                words = "has colours of vertices above 1, which are taken for 1"
                unread.setdefault("colours", f"{words}: divide them by 255")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's of many pixels, which are counted
            scene: Any = trimesh.load_scene(
                io.BytesIO(data), file_type=suffix[1:], resolver=resolver, process=False
            )
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            mesh = scene.geometry[name]
            if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
                placed = trimesh.transform_points(mesh.triangles.reshape(-1, 3), matrix)
                triangles.append(placed.reshape(-1, 3, 3))
                told, uv = (getattr(mesh.visual, name, None) for name in ("material", "uv"))
                if told is not None and id(told) not in materials:
                    is_linear, glb = getattr(resolver, "is_linear", False), suffix == ".glb"
                    made = glb_material(told, unread) if glb else mtl_material(told, is_linear)
                    materials[id(told)] = made
                material = materials.get(id(told))
                uv = material.moved(uv) if material and uv is not None else None
                pieces.append(Piece(mesh, material, uv))
    except BadMeshError:
        raise
    except Exception as error:  # trimesh raises what its parsers meet
        problem = f"{type(error).__name__}: {error}"
        raise BadMeshError("colours", problem, hint="export it without them") from error
    return np.concatenate(triangles), pieces


def matched(triangles: Array, up: str, vertices: Array, faces: Array) -> tuple[Array, Array, Array]:
    """Return which of a file's triangles each face of the cleaned mesh is, (F,), and the corners of
    both, (F, 3, 3), in the cleaned mesh's frame.

    They are matched by their centres, as cleaning merges and drops some. Of a polygon that is cut
    in another way, the nearest triangle in the face's plane is taken.

    Raises BadMeshError where the file's triangles have another pose than the mesh.
    """
    cleaned = clean_mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)), up)
    theirs = cleaned.vertices.astype(np.float64)[cleaned.faces]
    ours = vertices.astype(np.float64)[faces]
    low, high = (np.abs(f(theirs, (0, 1)) - f(ours, (0, 1))).max() for f in (np.min, np.max))
    if max(low, high) > 1e-3:
        found = "triangles in another pose than trimesh finds"
        raise BadMeshError("colours", found, hint="export it without bones")
    tree, centres = cKDTree(theirs.mean(axis=1)), ours.mean(axis=1)
    distance, match = (np.asarray(x) for x in tree.query(centres))
    across = np.cross(theirs[:, 1] - theirs[:, 0], theirs[:, 2] - theirs[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    far = np.flatnonzero(distance > NEAR)
    for most in CANDIDATES:
        count = min(most, len(theirs))
        near = np.asarray(tree.query(centres[far], np.arange(1, count + 1))[1])
        offset = ours[far, None] - theirs[near][:, :, :1]
        height = np.abs((offset * across[near][:, :, None]).sum(axis=3)).max(axis=2)
        nearest = np.argmin(np.maximum(height, SAME_PLANE), axis=1)  # the first of equals
        match[far] = near[np.arange(len(far)), nearest]
        far = far[height.min(axis=1, initial=np.inf) > SAME_PLANE]
    return cleaned.kept[match], theirs[match], ours


def colors_of(piece: Piece, vertex_colors_are_linear: bool) -> Array:
    """Return the linear colours of the corners of a piece's triangles, (n, 3, 3)."""
    mesh, material, uv = piece
    visual, faces = mesh.visual, mesh.faces
    colors = np.ones((len(faces), 3, 3))
    if visual.kind in ("vertex", "face"):
        stored = visual.vertex_colors[faces] if visual.kind == "vertex" else visual.face_colors
        rgb = np.asarray(stored, np.float64)[..., :3] / 255
        linear = rgb if vertex_colors_are_linear else decoded(rgb)
        return colors * (linear if linear.ndim == 3 else linear[:, None])
    if material is None:
        return colors
    if material.factor is not None:
        colors = colors * material.factor
    more = visual.vertex_attributes.get("color")  # those of glTF beside a material
    if more is not None and vertex_colors_are_linear:
        most = np.iinfo(more.dtype).max if more.dtype.kind == "u" else 1
        colors = colors * (more[faces][..., :3].astype(np.float64) / most)
    if material.picture is None or uv is None:
        return colors
    kept = np.clip(uv, 0, 1)
    away = np.where(uv == kept, uv, uv - np.floor(uv)), kept, np.abs(uv - 2 * np.round(uv / 2))
    uv = np.stack([away[wrap][:, axis] for axis, wrap in enumerate(material.wrap)], axis=1)
    texels = trimesh.visual.color.uv_to_interpolated_color(uv, material.picture)
    return np.asarray(colors * decoded(texels[:, :3].astype(np.float64) / 255)[faces])

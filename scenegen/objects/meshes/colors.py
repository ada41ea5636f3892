"""Own colours of a mesh: what its file says at each corner of each triangle, read by trimesh.

Base colours, vertex colours, face colours, and textures sampled at the corners. Only the file
itself is read, so pictures and materials in files beside it do not count.
"""

import io
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from scenegen.common.srgb import decoded
from scenegen.objects.meshes.clean import normalised
from scenegen.objects.meshes.errors import BadMeshError

Array = NDArray[Any]


def corner_colors(
    data: bytes, suffix: str, up: str, vertices: Array, faces: Array
) -> NDArray[np.float32]:
    """Return linear RGB, 0 to 1, at the corners of a cleaned mesh's faces, (F, 3, 3).

    Without colours in the file all are 1.

    Args:
        data, suffix: content of the file, and the suffix of its name.
        up: the axis, "y" or "z", that points up in the file.
        vertices, faces: of the cleaned mesh, (V, 3) and (F, 3).

    Raises BadMeshError as `read_triangles`.
    """
    triangles, meshes = read_triangles(data, suffix.lower())
    if not len(triangles):
        return np.ones((len(faces), 3, 3), np.float32)
    is_linear = suffix.lower() == ".glb"
    colors = np.concatenate([colors_of(mesh, is_linear) for mesh in meshes])
    face, theirs, ours = matched(triangles, up, vertices, faces)
    corner = np.linalg.norm(ours[:, :, None] - theirs[:, None], axis=-1).argmin(axis=2)
    return np.asarray(colors[face[:, None], corner].astype(np.float32))


def read_triangles(
    data: bytes, suffix: str, resolver: Any = None
) -> tuple[Array, list[trimesh.Trimesh]]:
    """Return a file's triangles in its own frame, (n, 3, 3), and trimesh's meshes that have them.

    Raises BadMeshError where trimesh cannot read the file. `resolver` finds the files beside it.
    """
    triangles, meshes = [np.zeros((0, 3, 3))], []
    try:
        scene: Any = trimesh.load_scene(
            io.BytesIO(data), file_type=suffix[1:], resolver=resolver, process=False
        )
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            mesh = scene.geometry[name]
            if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
                placed = trimesh.transform_points(mesh.triangles.reshape(-1, 3), matrix)
                triangles.append(placed.reshape(-1, 3, 3))
                meshes.append(mesh)
    except Exception as error:  # trimesh raises what its parsers meet
        problem = f"{type(error).__name__}: {error}"
        raise BadMeshError("colours", problem, hint="export it without them") from error
    return np.concatenate(triangles), meshes


def matched(triangles: Array, up: str, vertices: Array, faces: Array) -> tuple[Array, Array, Array]:
    """Return which of a file's triangles each face of the cleaned mesh is, (F,), and the corners of
    both, (F, 3, 3), in the cleaned mesh's frame.

    They are matched by their centres, as cleaning merges and drops some.
    """
    points = triangles.reshape(-1, 3)
    if up == "z":
        points = points[:, [0, 2, 1]] * (1, 1, -1)
    count = len(triangles)
    theirs = normalised(points, np.arange(3 * count).reshape(-1, 3)).reshape(-1, 3, 3)
    ours = vertices.astype(np.float64)[faces]
    match = np.asarray(cKDTree(theirs.mean(axis=1)).query(ours.mean(axis=1))[1])
    return match, theirs[match], ours


def colors_of(mesh: Any, vertex_colors_are_linear: bool) -> Array:
    """Return the linear colours of the corners of trimesh's triangles, (n, 3, 3)."""
    visual, faces = mesh.visual, mesh.faces
    ones = np.ones((len(faces), 3, 3))
    if visual.kind in ("vertex", "face"):
        stored = visual.vertex_colors[faces] if visual.kind == "vertex" else visual.face_colors
        rgb = np.asarray(stored, np.float64)[..., :3] / 255
        linear = rgb if vertex_colors_are_linear else decoded(rgb)
        return ones * (linear if linear.ndim == 3 else linear[:, None])
    if visual.kind != "texture":
        return ones
    material = visual.material
    factor = getattr(material, "baseColorFactor", None)  # linear, as glTF has it
    image = getattr(material, "baseColorTexture", getattr(material, "image", None))
    colors = ones if factor is None else ones * (np.asarray(factor, np.float64)[:3] / 255)
    if image is not None and visual.uv is not None:
        texels = trimesh.visual.color.uv_to_interpolated_color(visual.uv, image)
        return np.asarray(colors * decoded(texels[:, :3].astype(np.float64) / 255)[faces])
    if factor is None and image is None and hasattr(material, "diffuse"):
        return np.asarray(ones * decoded(np.asarray(material.diffuse, np.float64)[:3] / 255))
    return colors

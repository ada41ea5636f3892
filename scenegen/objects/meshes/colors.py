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
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError

Array = NDArray[Any]
NEAR = 1e-5  # distance of centres of the same triangle, in bounding radii; or more, of others
SAME_PLANE = 1e-4  # distance of corners from a triangle's plane, in bounding radii
CANDIDATES = 8, 64  # triangles that may be of the same polygon; first few, then many


def corner_colors(
    data: bytes, suffix: str, up: str, vertices: Array, faces: Array
) -> NDArray[np.float32]:
    """Return linear RGB, 0 to 1, at the corners of a cleaned mesh's faces, (F, 3, 3).

    Without colours in the file all are 1.

    Args:
        data, suffix: content of the file, and the suffix of its name.
        up: the axis, "y" or "z", that points up in the file.
        vertices, faces: of the cleaned mesh, (V, 3) and (F, 3).

    Raises BadMeshError as `read_triangles` and `matched`.
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
    more = visual.vertex_attributes.get("color")  # those of glTF beside a material
    if more is not None and vertex_colors_are_linear:
        most = np.iinfo(more.dtype).max if more.dtype.kind == "u" else 1
        colors = colors * (more[faces][..., :3].astype(np.float64) / most)
    if image is not None and visual.uv is not None:
        texels = trimesh.visual.color.uv_to_interpolated_color(visual.uv, image)
        return np.asarray(colors * decoded(texels[:, :3].astype(np.float64) / 255)[faces])
    if factor is None and image is None and hasattr(material, "diffuse"):
        return np.asarray(ones * decoded(np.asarray(material.diffuse, np.float64)[:3] / 255))
    return colors

"""Models of a folder as furniture: each takes the place of a built-in family."""

import zlib

import numpy as np

from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.objects.families.members import MEMBERS
from scenegen.objects.families.parts.surfaces import Part
from scenegen.objects.furniture.furnishing import (
    FAMILIES_FACTS,
    MESH,
    WHOLE,
    Furnishing,
    Paint,
    furnishing,
    whole_kind,
)
from scenegen.objects.furniture.shapes import furniture_shape
from scenegen.objects.furniture.unwrapping import corner_uv
from scenegen.objects.meshes.store import MeshStore
from scenegen.objects.solids import Array, UnitShape

OBJECT = "object"  # stands for families of which nothing is known
SMALLEST, LARGEST = 0.15, 0.4  # metres of their models' diagonals
# Built-in families in whose places classes of other names stand; most names are of ShapeNet.
_ALIKE = {
    "ashcan": "basket", "bench": "sofa", "bookcase": "shelf", "bookshelf": "shelf",
    "couch": "sofa", "dishwasher": "cabinet", "display": "screen", "dresser": "cabinet",
    "file": "nightstand", "flowerpot": "plant", "jar": "vase", "monitor": "screen",
    "piano": "cabinet", "pillow": "cushion", "pot": "plant", "stove": "nightstand",
    "television": "screen", "trash_bin": "basket", "wardrobe": "cabinet", "washer": "nightstand",
}  # fmt: skip
# Where fronts look, as signs and columns of the axes that become x and z.
_TURNED = {"shapenet-v1": ((-1, 2), (1, 0)), "shapenet-v2": ((-1, 0), (-1, 2))}


def family_like(name: str) -> str:
    """Return the family in whose place a class stands: itself, one alike, or OBJECT."""
    word = name.lower().replace(" ", "_").replace("-", "_")
    return word if word in FAMILIES_FACTS else _ALIKE.get(word, OBJECT)


def mesh_furniture(store: MeshStore, name: str) -> UnitShape:
    """Return a model as furniture. Raises BadMeshError where it cannot be used.

    Its front looks along +z, if those of the folder look as its layout says. It is as large as a
    member of the family in whose place it stands, and of the textures and colours that its file
    tells or else of a material of that family.
    """
    family, number = family_like(name.partition("/")[0]), zlib.crc32(name.encode())
    shape = store.shape(name)
    points = shape.mesh.vertices.astype(np.float64)
    if store.folder.kind in _TURNED:
        (sign_x, x), (sign_z, z) = _TURNED[store.folder.kind]
        points = np.stack([sign_x * points[:, x], points[:, 1], sign_z * points[:, z]], axis=1)
    vertices = rounded(points * (_size(family, number) / _diagonal(points)), POINT_STEP)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices -= [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]
    paint, faces = store.paint(name), shape.mesh.faces
    kinds: tuple[str, ...]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    if paint is None:
        kinds = (whole_kind(family, number / 2**32),)
        part = Part(vertices, faces, vertices, vertices, vertices[:, 0])
        uv = corner_uv(part, vertices, whole=kinds[0] in WHOLE)
        paint = Paint((), np.zeros(len(faces), np.int16), uv)
    else:
        kinds = (OBJECT,) * len(paint.textures)
    return furniture_shape(
        name,
        Furnishing(
            family, MESH, vertices, faces, paint.uv.astype(np.float32),
            np.broadcast_to(normals[:, None], corners.shape), paint.texture.astype(np.int16),
            np.broadcast_to(np.int32(0), len(faces)), kinds, paint.textures,
        ),
    )  # fmt: skip


def _size(family: str, number: int) -> float:
    """Return the diagonal, metres, of a model in the place of a family."""
    if family == OBJECT:
        return SMALLEST + (LARGEST - SMALLEST) * number / 2**32
    return _diagonal(furnishing(family, number % MEMBERS).vertices)


def _diagonal(points: Array) -> float:
    x, y, z = np.ptp(points, axis=0).tolist()
    return float((x * x + y * y + z * z) ** 0.5)

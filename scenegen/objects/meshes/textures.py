"""The surface of a mesh as its file and those beside it tell: textures and colours, by trimesh."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from scenegen.common.srgb import decoded
from scenegen.objects.furnishing import Paint, Texture
from scenegen.objects.meshes.colors import colors_of, matched, read_triangles
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.read import read_bytes
from scenegen.objects.solids import Array

MOST_PIXELS = 8192  # of a texture's side
KEPT_PIXELS = 512  # to which larger ones are reduced
ROUGHNESS = 0.5  # where a file does not tell


class _Beside(trimesh.resolvers.Resolver):  # type: ignore[misc]
    """Finds the files that a model names, in its folder and in those beside and below that."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.absolute()

    def get(self, name: str) -> bytes:
        path = Path(os.path.normpath(self.folder / name.strip().replace("\\", "/")))
        if not path.is_relative_to(self.folder.parent):
            raise FileNotFoundError(path)
        return read_bytes(path)

    def keys(self) -> list[str]:
        return []

    def namespaced(self, _namespace: str) -> "_Beside":
        return self

    def write(self, name: str, _data: Any) -> None:
        raise PermissionError(name)


def paint_of(path: Path, up: str, vertices: Array, faces: Array) -> Paint | None:
    """Return what a mesh file says about its surface; None if it says nothing.

    Colours without a picture become one, with a texel for each of them. Opacity is not read.

    Args:
        path, up: the file, and the axis, "y" or "z", that points up in it.
        vertices, faces: of the cleaned mesh, (V, 3) and (F, 3).

    Raises BadMeshError where trimesh cannot read the file or a picture.
    """
    suffix = path.suffix.lower()
    triangles, meshes = read_triangles(read_bytes(path), suffix, _Beside(path.parent))
    if not any(_is_told(mesh) for mesh in meshes):
        return None
    face, theirs, ours = matched(triangles, up, vertices, faces)
    textures: list[Texture] = []
    which, places, colors = [], [], []
    for mesh in meshes:
        number, uv = -1, np.zeros((len(mesh.faces), 3, 2))
        if (texture := _texture(mesh)) is not None:
            number, uv = len(textures), mesh.visual.uv[mesh.faces]
            textures.append(texture)
        which.append(np.full(len(mesh.faces), number))
        places.append(uv)
        colors.append(colors_of(mesh, suffix == ".glb").mean(axis=1))
    texture_of = np.concatenate(which)[face]
    where = _carried_over(np.concatenate(places)[face], theirs, ours)
    plain = texture_of < 0
    if plain.any():
        palette, where[plain] = _palette(np.concatenate(colors)[face[plain]])
        texture_of = np.where(plain, len(textures), texture_of)
        textures.append(palette)
    return Paint(tuple(textures), texture_of, where)


def _is_told(mesh: Any) -> bool:
    """Return whether a mesh has colours of its own, which are not trimesh's for those without."""
    visual = mesh.visual
    if visual.kind != "texture":
        return visual.kind in ("vertex", "face")
    material = visual.material
    told = ("image", "baseColorTexture", "baseColorFactor")
    return "kd" in getattr(material, "kwargs", ()) or any(
        getattr(material, name, None) is not None for name in told
    )


def _texture(mesh: Any) -> Texture | None:
    """Return a mesh's picture, times its colour; None if it has none."""
    visual = mesh.visual
    if visual.kind != "texture" or visual.uv is None:
        return None
    material = visual.material
    image = getattr(material, "baseColorTexture", getattr(material, "image", None))
    if image is None:
        return None
    if max(image.size) > MOST_PIXELS:
        found = f"{image.size[0]} x {image.size[1]} pixels"
        raise BadMeshError("texture", found, f"at most {MOST_PIXELS} a side")
    try:
        picture = image.convert("RGB")
        if max(picture.size) > KEPT_PIXELS:
            picture = picture.reduce(-(-max(picture.size) // KEPT_PIXELS))
    except Exception as error:  # Pillow raises what its formats meet
        raise BadMeshError("texture", f"{type(error).__name__}: {error}", "a picture") from error
    color = decoded(np.asarray(picture, np.float64)[::-1] / 255)
    factor = getattr(material, "baseColorFactor", None)
    color = color if factor is None else color * (np.asarray(factor, np.float64)[:3] / 255)
    return Texture(
        np.ascontiguousarray(color, np.float32),
        _number(material, "roughnessFactor", ROUGHNESS),
        _number(material, "metallicFactor", 0.0),
    )


def _number(material: Any, name: str, otherwise: float) -> float:
    found = getattr(material, name, None)
    return otherwise if found is None else min(max(float(found), 0.0), 1.0)


def _palette(colors: Array) -> tuple[Texture, Array]:
    """Return linear colours, (n, 3), as a picture of one row, and their corners' places in it."""
    steps = np.rint(np.sqrt(colors) * 255).astype(np.int64)  # as `Material.texels` keeps them
    seen, number = np.unique(steps @ [1 << 16, 1 << 8, 1], return_inverse=True)
    kept = np.stack([seen >> 16, seen >> 8 & 255, seen & 255], axis=1) / 255
    u = (number.reshape(-1) + 0.5) / len(seen)
    uv = np.stack([u, np.full(len(u), 0.5)], axis=1)
    picture = np.square(kept, dtype=np.float64).astype(np.float32)[None]
    return Texture(picture, ROUGHNESS, 0.0), uv[:, None].repeat(3, axis=1)


def _carried_over(uv: Array, theirs: Array, ours: Array) -> Array:
    """Return texture coordinates, (F, 3, 2), of triangles that lie in the planes of others.

    The same polygon may be cut in two ways, so corners need not be the same.
    """
    a, b = theirs[:, 1] - theirs[:, 0], theirs[:, 2] - theirs[:, 0]
    offset = ours - theirs[:, :1]
    aa, ab, bb = ((x * y).sum(axis=1)[:, None] for x, y in ((a, a), (a, b), (b, b)))
    along_a, along_b = ((offset * edge[:, None]).sum(axis=2) for edge in (a, b))
    size = np.maximum(aa * bb - ab * ab, 1e-30)
    s, t = (bb * along_a - ab * along_b) / size, (aa * along_b - ab * along_a) / size
    first, second = uv[:, 1:2] - uv[:, :1], uv[:, 2:] - uv[:, :1]
    return np.asarray(uv[:, :1] + s[..., None] * first + t[..., None] * second)

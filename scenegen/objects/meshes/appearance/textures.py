"""The surface of a mesh as its file and those beside it tell: textures and colours, by trimesh."""

import io
import os
import sys
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh

from scenegen.common.srgb import decoded
from scenegen.files.images.pictures import opened_picture
from scenegen.objects.furniture.furnishing import CLAMP, MIRROR, REPEAT, Paint, Texture
from scenegen.objects.meshes.appearance.colors import Piece, colors_of, matched, read_triangles
from scenegen.objects.meshes.appearance.materials import (
    OPTION,
    ROUGHNESS,
    MeshMaterial,
    Unread,
    reduced,
)
from scenegen.objects.meshes.clean import MOST_COORDINATE
from scenegen.objects.meshes.read import read_bytes
from scenegen.objects.meshes.readers.text import utf8
from scenegen.objects.solids import Array

# After how many pictures one begins anew; where it does not, coordinates stay as they are.
PERIODS = {REPEAT: 1, CLAMP: 0, MIRROR: 2}


class _Beside(trimesh.resolvers.Resolver):  # type: ignore[misc]
    """Finds the files that a model names, in its folder and in those beside and below that."""

    def __init__(self, folder: Path, unread: Unread) -> None:
        self.folder, self.unread = folder.absolute(), unread
        self.is_linear = False  # whether colours of materials are, as Blender writes them

    def get(self, name: str) -> bytes:
        name = name.strip()
        while option := OPTION.match(name):
            name = name[option.end() :]
        try:
            path = self._path(name)
            path = path if path.exists() else self._path(unquote(name))
            data = read_bytes(path)
            if path.suffix.lower() == ".mtl":
                data = utf8(data)
                self.is_linear = data.startswith(b"# Blender")
            else:
                with opened_picture(io.BytesIO(data), sys.maxsize):
                    pass
        except Exception:  # trimesh goes on without it
            words = f"names {name!r}, which cannot be read; such meshes get no texture"
            self.unread.setdefault("picture", words)
            raise
        return data

    def _path(self, name: str) -> Path:
        path = Path(os.path.normpath(self.folder / name.replace("\\", "/")))
        if not path.is_relative_to(self.folder.parent):
            raise FileNotFoundError(path)
        return path

    def keys(self) -> list[str]:
        return []

    def namespaced(self, _namespace: str) -> "_Beside":
        return self

    def write(self, name: str, _data: Any) -> None:
        raise PermissionError(name)


def paint_of(path: Path, up: str, vertices: Array, faces: Array, unread: Unread) -> Paint | None:
    """Return what a mesh file says about its surface; None if it says nothing.

    Colours without a picture become one, with a texel for each of them. Opacity is not read.

    Args:
        path, up: the file, and the axis, "y" or "z", that points up in it.
        vertices, faces: of the cleaned mesh, (V, 3) and (F, 3).
        unread: gets what is not read.

    Raises BadMeshError where trimesh cannot read the file, and what Pillow meets in a picture.
    """
    suffix, data = path.suffix.lower(), read_bytes(path)
    triangles, pieces = read_triangles(data, suffix, unread, _Beside(path.parent, unread))
    if not any(map(_is_told, pieces)):
        return None
    face, theirs, ours = matched(triangles, up, vertices, faces)
    textures: list[Texture] = []
    numbers: dict[int, int] = {}  # of textures, by the pictures that pieces share
    which, places, colors = [], [], []
    for piece in pieces:
        count, material = len(piece.mesh.faces), piece.material
        number, uv, color = -1, np.zeros((count, 3, 2)), np.zeros((count, 3))
        if material is not None and material.picture is not None and piece.uv is not None:
            if "color" in piece.mesh.visual.vertex_attributes:
                unread.setdefault(
                    "both", "has vertex colours on top of textures, which are ignored"
                )
            if id(material) not in numbers:
                numbers[id(material)] = len(textures)
                textures.append(_texture(material))
            number, uv = numbers[id(material)], piece.uv[piece.mesh.faces]
            period = np.array([PERIODS[wrap] for wrap in material.wrap])
            with np.errstate(invalid="ignore"):
                uv = uv - np.floor(uv[:, :1] / np.maximum(period, 1)) * period
        else:
            color = colors_of(piece, suffix == ".glb").mean(axis=1)
        which.append(np.full(count, number))
        places.append(uv)
        colors.append(color)
    texture_of = np.concatenate(which)[face]
    where = np.concatenate(places)[face]
    where[~(np.abs(where) < MOST_COORDINATE).all(axis=(1, 2))] = 0.0
    where = _carried_over(where, theirs, ours)
    plain = texture_of < 0
    if plain.any():
        palette, where[plain] = _palette(np.concatenate(colors)[face[plain]])
        texture_of = np.where(plain, len(textures), texture_of)
        textures.append(palette)
    return Paint(tuple(textures), texture_of, where)


def _is_told(piece: Piece) -> bool:
    """Return whether a piece has colours of its own, which are not trimesh's for those without."""
    visual, material = piece.mesh.visual, piece.material
    if material is None:
        return visual.kind in ("vertex", "face")
    told = material.factor, material.picture, visual.vertex_attributes.get("color")
    return any(x is not None for x in told)


def _texture(material: MeshMaterial) -> Texture:
    """Return a material's picture, times its colour."""
    picture = np.asarray(reduced(material.picture), np.float64)
    color = decoded(picture[::-1] / 255)
    color = color if material.factor is None else color * material.factor
    kept = np.ascontiguousarray(color, np.float32)
    return Texture(kept, material.roughness, material.metallic, material.wrap)


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

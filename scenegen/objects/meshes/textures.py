"""The surface of a mesh as its file and those beside it tell: textures and colours, by trimesh."""

import io
import json
import os
import re
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from scenegen.common.srgb import decoded
from scenegen.files.pictures import as_rgb
from scenegen.objects.furniture.furnishing import Paint, Texture
from scenegen.objects.meshes.clean import MOST_COORDINATE
from scenegen.objects.meshes.colors import colors_of, matched, read_triangles
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.read import read_bytes
from scenegen.objects.solids import Array

MOST_PIXELS = 8192  # of a texture's side
KEPT_PIXELS = 512  # to which larger ones are reduced
ROUGHNESS = 0.5  # where a file does not tell
_JSON = 0x4E4F534A  # "JSON", the type of a GLB file's first part
_OPTION = re.compile(r"-([a-z]+)((?: +(?:[-+.\de]+|on|off|[rgbmlz]))+) +")  # of MTL, before a name


class _Beside(trimesh.resolvers.Resolver):  # type: ignore[misc]
    """Finds the files that a model names, in its folder and in those beside and below that."""

    def __init__(self, folder: Path, lacking: list[str]) -> None:
        self.folder, self.lacking = folder.absolute(), lacking

    def get(self, name: str) -> bytes:
        name = name.strip()
        while option := _OPTION.match(name):
            name = name[option.end() :]
        path = Path(os.path.normpath(self.folder / name.replace("\\", "/")))
        try:
            if not path.is_relative_to(self.folder.parent):
                raise FileNotFoundError(path)
            data = read_bytes(path)
            if path.suffix.lower() != ".mtl":
                Image.open(io.BytesIO(data))
        except Exception:  # trimesh goes on without it
            self.lacking.append(name)
            raise
        return data

    def keys(self) -> list[str]:
        return []

    def namespaced(self, _namespace: str) -> "_Beside":
        return self

    def write(self, name: str, _data: Any) -> None:
        raise PermissionError(name)


def paint_of(
    path: Path, up: str, vertices: Array, faces: Array, lacking: list[str]
) -> Paint | None:
    """Return what a mesh file says about its surface; None if it says nothing.

    Colours without a picture become one, with a texel for each of them. Opacity is not read.

    Args:
        path, up: the file, and the axis, "y" or "z", that points up in it.
        vertices, faces: of the cleaned mesh, (V, 3) and (F, 3).
        lacking: gets the names of files beside it that cannot be read.

    Raises BadMeshError where trimesh cannot read the file, and what Pillow meets in a picture.
    """
    suffix, data = path.suffix.lower(), read_bytes(path)
    data, transforms = _with_numbers(data) if suffix == ".glb" else (data, {})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's of many pixels, which are counted below
        triangles, meshes = read_triangles(data, suffix, _Beside(path.parent, lacking))
    if not any(_is_told(mesh) for mesh in meshes):
        return None
    face, theirs, ours = matched(triangles, up, vertices, faces)
    textures: list[Texture] = []
    numbers: dict[int, int] = {}  # of textures, by the materials that meshes share
    which, places, colors = [], [], []
    for mesh in meshes:
        count = len(mesh.faces)
        number, uv, color = -1, np.zeros((count, 3, 2)), np.zeros((count, 3))
        if _is_pictured(mesh):
            material = mesh.visual.material
            if id(material) not in numbers:
                numbers[id(material)] = len(textures)
                textures.append(_texture(material))
            number, uv = numbers[id(material)], _transformed(mesh, transforms)[mesh.faces]
        else:
            color = colors_of(mesh, suffix == ".glb").mean(axis=1)
        which.append(np.full(count, number))
        places.append(uv)
        colors.append(color)
    texture_of = np.concatenate(which)[face]
    where = np.concatenate(places)[face]
    where[~(np.abs(where) < MOST_COORDINATE).all(axis=(1, 2))] = 0.0
    where = _carried_over(where - np.floor(where[:, :1]), theirs, ours)
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
    return (
        "kd" in getattr(visual.material, "kwargs", ())
        or getattr(visual.material, "baseColorFactor", None) is not None
        or "color" in visual.vertex_attributes
        or _picture(visual.material) is not None
    )


def _picture(material: Any) -> Any:
    """Return the picture of a material that comes from a file, as trimesh makes some up."""
    image = getattr(material, "baseColorTexture", getattr(material, "image", None))
    return None if image is None or image.format is None else image


def _is_pictured(mesh: Any) -> bool:
    visual = mesh.visual
    is_laid_out = visual.kind == "texture" and visual.uv is not None
    return is_laid_out and _picture(visual.material) is not None


def _rgb(image: Any) -> Any:
    """Return a picture in 8 bits, reduced where it is large. Raises BadMeshError."""
    if max(image.size) > MOST_PIXELS:
        found = f"{image.size[0]} x {image.size[1]} pixels"
        raise BadMeshError("texture", found, f"at most {MOST_PIXELS} a side")
    picture = as_rgb(image)
    longest = max(picture.size)
    return picture.reduce(-(-longest // KEPT_PIXELS)) if longest > KEPT_PIXELS else picture


def _texture(material: Any) -> Texture:
    """Return a material's picture, times its colour."""
    color = decoded(np.asarray(_rgb(_picture(material)), np.float64)[::-1] / 255)
    factor = getattr(material, "baseColorFactor", None)
    color = color if factor is None else color * (np.asarray(factor, np.float64)[:3] / 255)
    return Texture(
        np.ascontiguousarray(color, np.float32),
        _number(material, "roughnessFactor", 1, ROUGHNESS),
        _number(material, "metallicFactor", 2, 0.0),
    )


def _with_numbers(data: bytes) -> tuple[bytes, dict[str, dict[str, Any]]]:
    """Return a GLB file for trimesh, and the transforms of its materials' pictures, by name.

    In it materials have numbers as names, and the texture coordinates of pictures are the first
    set. trimesh knows neither other sets nor KHR_texture_transform.
    """
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20:end])
    transforms, sets = {}, []
    for number, material in enumerate(document.get("materials", ())):
        texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
        transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
        material["name"], transforms[str(number)] = str(number), transform
        sets.append(transform.get("texCoord", texture.get("texCoord", 0)))
    for part in (part for mesh in document.get("meshes", ()) for part in mesh["primitives"]):
        own = f"TEXCOORD_{sets[part['material']]}" if "material" in part else ""
        if own in part["attributes"]:
            part["attributes"]["TEXCOORD_0"] = part["attributes"][own]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, len(text) + len(data) - end + 20, len(text), _JSON)
    return head + text + data[end:], transforms


def _transformed(mesh: Any, transforms: dict[str, dict[str, Any]]) -> Array:
    """Return a mesh's texture coordinates, (V, 2), moved as KHR_texture_transform or MTL tells."""
    uv, material = mesh.visual.uv, mesh.visual.material
    if transform := transforms.get(material.name):
        down = uv * (1, -1) + (0, 1)  # glTF counts rows from above, and turns against the clock
        cosine, sine = np.cos(transform.get("rotation", 0)), np.sin(transform.get("rotation", 0))
        turned = (down * transform.get("scale", 1)) @ [[cosine, -sine], [sine, cosine]]
        uv = (turned + transform.get("offset", 0)) * (1, -1) + (0, 1)
    told = dict(_OPTION.findall(_picture(material).info.get("file_path", "")))
    scale = np.array(told.get("s", "1").split()[:2], float)
    return np.asarray(uv * scale + np.array(told.get("o", "0").split()[:2], float))


def _number(material: Any, name: str, channel: int, otherwise: float) -> float:
    """Return a factor of glTF, times the mean of its channel of the picture that it goes with."""
    factor = getattr(material, name, None)
    image = getattr(material, "metallicRoughnessTexture", None)
    if image is not None:
        mean = float(np.asarray(_rgb(image))[..., channel].mean()) / 255
        factor = mean if factor is None else mean * factor
    return otherwise if factor is None else min(max(float(factor), 0.0), 1.0)


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

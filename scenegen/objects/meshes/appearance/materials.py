"""Materials of mesh files: colours, pictures, and how pictures lie, as far as they are read."""

import json
import re
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenegen.common.srgb import decoded
from scenegen.files.images.pictures import as_rgb
from scenegen.objects.furniture.furnishing import CLAMP, MIRROR, REPEAT
from scenegen.objects.meshes.errors import BadMeshError

Array = NDArray[Any]
MOST_PIXELS = 8192  # of a texture's side
KEPT_PIXELS = 512  # to which larger ones are reduced
ROUGHNESS = 0.5  # where a file does not tell
OPTION = re.compile(r"-([a-z]+)((?: +(?:[-+.\de]+|on|off|[rgbmlz]))+) +")  # of MTL, before a name
JSON = 0x4E4F534A  # "JSON", the type of a GLB file's first part
WRAPS = {33071: CLAMP, 33648: MIRROR}  # of samplers; others repeat
TRANSFORM, GLOSSY = "KHR_texture_transform", "KHR_materials_pbrSpecularGlossiness"
ROUGH = {  # in place of names of glossy materials
    "diffuseTexture": "baseColorTexture", "diffuseFactor": "baseColorFactor",
    "specularGlossinessTexture": "metallicRoughnessTexture",
}  # fmt: skip
DARK, SHINY = 0.04, 0.3  # linear: diffuse below, specular above, where a glossy material is metal
# Extensions of materials that are read, or leave the colour as it is; others are told.
SAME = "unlit", "ior", "anisotropy", "clearcoat", "dispersion", "emissive_strength"
QUIET = {TRANSFORM, GLOSSY, *(f"KHR_materials_{name}" for name in SAME)}
Unread = dict[str, str]  # what is not read of a file, by kind, in words that follow its name


class MeshMaterial(NamedTuple):
    """What a file says about a surface.

    Attributes:
        picture: of Pillow, 8 bits sRGB; None without one.
        factor: linear RGB, 0 to 1, which the picture is multiplied by; None where it is not told.
        transform: of the picture, as of KHR_texture_transform, whose rows are counted from above.
        wrap: how the picture goes on along u and v.
    """

    picture: Any = None
    factor: Array | None = None
    roughness: float = ROUGHNESS
    metallic: float = 0.0
    transform: dict[str, Any] | None = None
    wrap: tuple[int, ...] = (REPEAT, REPEAT)

    def moved(self, uv: Array) -> Array:
        """Return texture coordinates, (V, 2), rows counted from below, as the transform tells."""
        if not self.transform:
            return uv
        told, down = self.transform.get, uv * (1, -1) + (0, 1)  # it turns against the clock
        cosine, sine = np.cos(told("rotation", 0)), np.sin(told("rotation", 0))
        turned = (down * told("scale", 1)) @ [[cosine, -sine], [sine, cosine]]
        return np.asarray((turned + told("offset", 0)) * (1, -1) + (0, 1))


def rgb_of(image: Any) -> Any:
    """Return a picture in 8 bits. Raises BadMeshError for one that is too large."""
    if max(image.size) > MOST_PIXELS:
        found = f"{image.size[0]} x {image.size[1]} pixels"
        raise BadMeshError("texture", found, f"at most {MOST_PIXELS} a side")
    return as_rgb(image)


def reduced(picture: Any) -> Any:
    """Return a picture of 8 bits, smaller where it is large."""
    step = -(-max(picture.size) // KEPT_PIXELS)
    return picture.reduce(step) if step > 1 else picture


def mtl_material(told: Any, is_linear: bool) -> MeshMaterial:
    """Return trimesh's material of an OBJ or PLY file; pictures that it makes up have no format.

    Colours are linear, as Blender writes them, or else sRGB.
    """
    image = getattr(told, "image", None)
    if image is None or image.format is None:
        if "kd" not in getattr(told, "kwargs", ()):
            return MeshMaterial()
        color = np.asarray(told.kwargs["kd"], np.float64)[:3].clip(0, 1)
        return MeshMaterial(factor=color if is_linear else decoded(told.diffuse[:3] / 255))
    said = dict(OPTION.findall(image.info.get("file_path", "")))
    scale, offset = (np.array((said.get(k) or d).split()[:2], float) for k, d in ("s1", "o0"))
    scale, offset = np.broadcast_to(scale, 2), np.broadcast_to(offset, 2)
    # With rows from above, v becomes 1 - s (1 - v) - o.
    moved = {"scale": scale, "offset": [offset[0], 1 - scale[1] - offset[1]]}
    wrap = CLAMP if said.get("clamp", "").strip() == "on" else REPEAT
    transform = moved if said.keys() & {"s", "o"} else None
    return MeshMaterial(rgb_of(image), transform=transform, wrap=(wrap, wrap))


def glb_material(told: Any, unread: Unread) -> MeshMaterial:
    """Return trimesh's material of a file from `plain_glb`."""
    images, about = (told.baseColorTexture, told.metallicRoughnessTexture), json.loads(told.name)
    picture, other = (None if image is None else rgb_of(image) for image in images)
    factor = None if told.baseColorFactor is None else told.baseColorFactor[:3] / 255
    if about["picture"] and picture is None:
        words = f"names {about['picture']!r}, which cannot be read; such meshes get no texture"
        unread.setdefault("picture", words)
    both = picture, other
    means = [np.ones(3) if x is None else np.asarray(x).mean((0, 1)) / 255 for x in both]
    roughness, metallic = (
        otherwise if value is None and other is None
        else float(np.clip((1.0 if value is None else value) * mean, 0.0, 1.0))
        for value, mean, otherwise in (
            (told.roughnessFactor, means[1][1], ROUGHNESS), (told.metallicFactor, means[1][2], 0.0)
        )
    )  # fmt: skip
    if (gloss := about["gloss"]) is not None:
        # By default nothing is diffuse, which no writer means who tells a diffuse colour alone.
        specular = np.array(gloss.get("specularFactor", [float(other is not None)] * 3))
        has_gloss = other is not None and "A" in images[1].getbands()
        share = np.asarray(images[1].getchannel("A")).mean() / 255 if has_gloss else 1.0
        roughness = 1.0 - gloss.get("glossinessFactor", 1.0) * float(share)
        diffuse = decoded(means[0]) * (1.0 if factor is None else factor)
        metallic = float(diffuse.max() < DARK and (decoded(means[1]) * specular).max() > SHINY)
        picture, factor = (other, specular) if metallic else (picture, factor)
    wrap, transform = tuple(about["wrap"]), about["transform"]
    return MeshMaterial(picture, factor, roughness, metallic, transform, wrap)


def plain_glb(data: bytes, unread: Unread) -> bytes:
    """Return a GLB file for trimesh, which knows few extensions.

    In it names of materials tell how their pictures lie, glossy materials are rough ones, textures
    have one source, and the first set of texture coordinates is that of the picture.
    """
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    document, sets = json.loads(data[20:end]), []
    for texture in document.get("textures", ()):
        others = [x["source"] for x in texture.pop("extensions", {}).values() if "source" in x]
        texture.setdefault("source", next(iter(others), None))
    for material in document.get("materials", ()):
        extensions = material.pop("extensions", {})
        gloss = extensions.get(GLOSSY)
        if gloss is not None:
            rough = {ROUGH[name]: value for name, value in gloss.items() if name in ROUGH}
            material["pbrMetallicRoughness"] = rough
        base = material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
        own = base.get("extensions", {})
        texture = document["textures"][base["index"]] if base else {}
        sampler = document["samplers"][texture["sampler"]] if "sampler" in texture else {}
        image = document["images"][texture["source"]] if texture.get("source") is not None else {}
        name = image.get("uri", "data:")
        name = image.get("mimeType", "a picture") if name.startswith("data:") else name
        transform = own.get(TRANSFORM, {})
        sets.append(transform.get("texCoord", base.get("texCoord", 0)))
        told = {"picture": name if base else "", "transform": transform, "gloss": gloss}
        told["wrap"] = [WRAPS.get(sampler.get(key, 0), REPEAT) for key in ("wrapS", "wrapT")]
        material["name"] = json.dumps(told)
        for kind in {*extensions, *own} - QUIET:
            unread.setdefault(kind, f"has {kind}, which is not read")
        if max(material.get("emissiveFactor", (0,))) > 0:
            unread.setdefault("emission", "shines by its file, which is not read")
    for part in (part for mesh in document.get("meshes", ()) for part in mesh["primitives"]):
        key = f"TEXCOORD_{sets[part['material']]}" if "material" in part else ""
        if key in part["attributes"]:
            part["attributes"]["TEXCOORD_0"] = part["attributes"][key]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, len(text) + len(data) - end + 20, len(text), JSON)
    return head + text + data[end:]

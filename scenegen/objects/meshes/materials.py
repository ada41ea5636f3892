"""Materials of mesh files: colours, pictures, and how pictures lie, as far as they are read.

Those of GLB files are read here, for trimesh leaves out what many files have: extensions, further
sets of texture coordinates, and how a picture goes on beyond its edges.
"""

import base64
import io
import json
import re
import struct
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenegen.common.srgb import decoded, encoded
from scenegen.files.pictures import as_rgb, opened_picture
from scenegen.objects.furniture.furnishing import CLAMP, MIRROR, REPEAT
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.glb import buffer_bytes, chunks_of

Array = NDArray[Any]
MOST_PIXELS = 8192  # of a texture's side
MOST_OPENED = 2**31  # of a picture whose sides are then looked at
KEPT_PIXELS = 512  # to which larger ones are reduced
ROUGHNESS = 0.5  # where a file does not tell
OPTION = re.compile(r"-([a-z]+)((?: +(?:[-+.\de]+|on|off|[rgbmlz]))+) +")  # of MTL, before a name
JSON = 0x4E4F534A  # "JSON", the type of a GLB file's first part
WRAPS = {33071: CLAMP, 33648: MIRROR}  # of samplers; others repeat
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
TRANSFORM = "KHR_texture_transform"
# Extensions of materials that are read, or leave the colour as it is; others are told.
QUIET = {
    GLOSSY, TRANSFORM, "KHR_materials_unlit", "KHR_materials_ior", "KHR_materials_anisotropy",
    "KHR_materials_clearcoat", "KHR_materials_dispersion", "KHR_materials_emissive_strength",
}  # fmt: skip
DARK, SHINY = 0.04, 0.3  # linear: diffuse below, specular above, where a glossy material is metal
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
    transform: dict[str, Any] = {}  # noqa: RUF012
    wrap: tuple[int, int] = (REPEAT, REPEAT)

    def moved(self, uv: Array) -> Array:
        """Return texture coordinates, (V, 2), rows counted from below, as the transform tells."""
        if not self.transform:
            return uv
        down = uv * (1, -1) + (0, 1)  # the transform turns against the clock
        angle = self.transform.get("rotation", 0)
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = (down * self.transform.get("scale", 1)) @ [[cosine, -sine], [sine, cosine]]
        return np.asarray((turned + self.transform.get("offset", 0)) * (1, -1) + (0, 1))


def check_size(picture: Any) -> None:
    """Raise BadMeshError for a picture that is too large."""
    if max(picture.size) > MOST_PIXELS:
        found = f"{picture.size[0]} x {picture.size[1]} pixels"
        raise BadMeshError("texture", found, f"at most {MOST_PIXELS} a side")


def reduced(picture: Any) -> Any:
    """Return a picture of 8 bits, smaller where it is large."""
    step = -(-max(picture.size) // KEPT_PIXELS)
    return picture.reduce(step) if step > 1 else picture


def mtl_material(material: Any, is_linear: bool) -> MeshMaterial:
    """Return trimesh's material of an OBJ or PLY file; some it makes up, without a format.

    Args:
        is_linear: whether colours are, as Blender writes them; others are sRGB.
    """
    image = getattr(material, "image", None)
    if image is None or image.format is None:
        if "kd" not in getattr(material, "kwargs", ()):
            return MeshMaterial()
        linear = np.clip(np.asarray(material.kwargs["kd"], np.float64)[:3], 0, 1)
        coded = np.asarray(material.diffuse, np.float64)[:3] / 255
        return MeshMaterial(factor=linear if is_linear else decoded(coded))
    check_size(image)
    told = dict(OPTION.findall(image.info.get("file_path", "")))
    scale = np.array(told.get("s", "1").split()[:2], float)
    offset = np.array(told.get("o", "0").split()[:2], float)
    # With rows from above, v becomes 1 - s (1 - v) - o.
    down = [0.0, 1.0] - np.broadcast_to(scale, 2) * (0, 1) + np.broadcast_to(offset, 2) * (1, -1)
    wrap = CLAMP if told.get("clamp", "").strip() == "on" else REPEAT
    transform = {"scale": scale, "offset": down} if told.keys() & {"s", "o"} else {}
    return MeshMaterial(as_rgb(image), transform=transform, wrap=(wrap, wrap))


def glb_materials(
    data: bytes, beside: Callable[[str], bytes], unread: Unread
) -> tuple[bytes, list[MeshMaterial]]:
    """Return a GLB file for trimesh, and its materials, whose numbers are their names in it.

    In it they have no pictures, and the first set of texture coordinates is that of the picture.

    Args:
        beside: returns the bytes of a file beside it, or raises.
        unread: gets what is not read.
    """
    document, binary = chunks_of(data)
    reader = _Reader(document, binary, beside, unread)
    parts = [part for mesh in document.get("meshes", ()) for part in mesh["primitives"]]
    materials, sets = [], []
    for number, told in enumerate(document.get("materials", ())):
        is_used = any(part.get("material") == number for part in parts)
        material, own = reader.material(told) if is_used else (MeshMaterial(), 0)
        materials.append(material)
        sets.append(own)
    document["materials"] = [{"name": str(number)} for number in range(len(materials))]
    for name in ("textures", "images", "samplers"):
        document.pop(name, None)
    for part in parts:
        key = f"TEXCOORD_{sets[part['material']]}" if "material" in part else ""
        if key in part["attributes"]:
            part["attributes"]["TEXCOORD_0"] = part["attributes"][key]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    head = struct.pack("<4sIIII", b"glTF", 2, len(text) + len(data) - end + 20, len(text), JSON)
    return head + text + data[end:], materials


class _Reader:
    """Reads materials and pictures of one GLB file."""

    def __init__(
        self, document: Any, binary: bytes, beside: Callable[[str], bytes], unread: Unread
    ) -> None:
        self.document, self.binary, self.beside, self.unread = document, binary, beside, unread
        self.image = cache(self._image)

    def material(self, told: dict[str, Any]) -> tuple[MeshMaterial, int]:
        """Return a material, and the number of its set of texture coordinates."""
        extensions = told.get("extensions", {})
        self._tell(extensions)
        if max(told.get("emissiveFactor", (0,))) > 0:
            self.unread.setdefault("emission", "shines by its file, which is not read")
        glossy = extensions.get(GLOSSY)
        rough = told.get("pbrMetallicRoughness", {})
        base = rough.get("baseColorTexture", {}) if glossy is None else (
            glossy.get("diffuseTexture", {}))  # fmt: skip
        factor = rough.get("baseColorFactor") if glossy is None else glossy.get("diffuseFactor")
        self._tell(base.get("extensions", {}))
        transform = base.get("extensions", {}).get(TRANSFORM, {})
        picture, sampler = self._texture(base)
        made = MeshMaterial(
            None if picture is None else as_rgb(picture),
            None if factor is None else np.asarray(factor, np.float64)[:3],
            transform=transform,
            wrap=tuple(WRAPS.get(sampler.get(name), REPEAT) for name in ("wrapS", "wrapT")),  # type: ignore[arg-type]
        )
        made = self._with_roughness(made, rough) if glossy is None else self._glossy(made, glossy)
        return made, transform.get("texCoord", base.get("texCoord", 0))

    def _tell(self, extensions: dict[str, Any]) -> None:
        for name in extensions.keys() - QUIET:
            self.unread.setdefault(name, f"has {name}, which is not read")

    def _with_roughness(self, made: MeshMaterial, told: dict[str, Any]) -> MeshMaterial:
        picture, _ = self._texture(told.get("metallicRoughnessTexture", {}))
        means = [1.0] * 3 if picture is None else np.asarray(as_rgb(picture)).mean((0, 1)) / 255
        values = [ROUGHNESS, 0.0]
        for i, name in enumerate(("roughnessFactor", "metallicFactor")):
            if name in told or picture is not None:
                values[i] = min(max(told.get(name, 1.0) * float(means[1 + i]), 0.0), 1.0)
        return made._replace(roughness=values[0], metallic=values[1])

    def _glossy(self, made: MeshMaterial, told: dict[str, Any]) -> MeshMaterial:
        """Return a material of diffuse and specular colours as one of base colour.

        That is the diffuse colour, and where this is dark and the specular one is not, as of
        metals, the specular one.
        """
        picture, _ = self._texture(told.get("specularGlossinessTexture", {}))
        default = (0, 0, 0) if picture is None else (1, 1, 1)  # by which nothing would be diffuse
        specular = np.asarray(told.get("specularFactor", default), np.float64)
        diffuse = np.ones(3) if made.factor is None else made.factor
        gloss = told.get("glossinessFactor", 1.0)
        if picture is not None and "A" in picture.getbands():
            gloss *= float(np.asarray(picture.getchannel("A")).mean()) / 255
        pictures = [x and reduced(as_rgb(x)) for x in (made.picture, picture)]
        size = next((x.size for x in pictures if x), (1, 1))
        diffuse, specular = (
            np.broadcast_to(color, (*size[::-1], 3)) if image is None
            else decoded(np.asarray(image.resize(size), np.float64) / 255) * color
            for color, image in zip((diffuse, specular), pictures, strict=True)
        )  # fmt: skip
        metal = (diffuse.max(axis=2) < DARK) & (specular.max(axis=2) > SHINY)
        if metal.any():
            color = np.where(metal[..., None], specular, diffuse)
            coded = Image.fromarray(np.rint(encoded(color) * 255).astype(np.uint8))
            plain = {"picture": None, "factor": color[0, 0]}
            made = made._replace(**({"picture": coded, "factor": None} if any(pictures) else plain))
        return made._replace(roughness=1.0 - gloss, metallic=float(metal.mean()))

    def _texture(self, told: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Return the picture and the sampler of a texture: of several, the first that is read."""
        if "index" not in told:
            return None, {}
        texture = self.document["textures"][told["index"]]
        sampler = self.document["samplers"][texture["sampler"]] if "sampler" in texture else {}
        sources = [x.get("source") for x in (texture, *texture.get("extensions", {}).values())]
        failed = ""
        for source in sources:
            if source is not None:
                picture, name = self.image(source)
                if picture is not None:
                    return picture, sampler
                failed = failed or name
        names = ", ".join(texture.get("extensions", {}))
        words = f"names {failed or names or 'no picture'!r}, which cannot be read"
        self.unread.setdefault("picture", f"{words}; such models are plain")
        return None, sampler

    def _image(self, number: int) -> tuple[Any, str]:
        """Return a picture, None where it cannot be read, and a name of it."""
        image = self.document["images"][number]
        uri = image.get("uri", "")
        kind = image.get("mimeType", "a picture")
        name = uri if uri and not uri.startswith("data:") else f"{image.get('name', kind)}"
        try:
            with opened_picture(io.BytesIO(self._bytes(image, uri)), MOST_OPENED) as picture:
                if max(picture.size) <= MOST_PIXELS:
                    picture.load()
        except Exception:  # of broken tables, files and pictures
            return None, f"{name} ({kind})" if kind not in name else name
        check_size(picture)
        return picture, name

    def _bytes(self, image: dict[str, Any], uri: str) -> bytes:
        if "bufferView" in image:
            view = self.document["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            data = buffer_bytes(self.document["buffers"][view["buffer"]], self.binary)
            return data[start : start + view["byteLength"]]
        if not uri.startswith("data:"):
            return self.beside(uri)
        head, _, body = uri.partition(",")
        return base64.b64decode(unquote(body)) if ";base64" in head else unquote_to_bytes(body)

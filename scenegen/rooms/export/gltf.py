"""A binary file of glTF 2.0: lists of JSON, and one buffer that they point into."""

import io
import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Array = NDArray[Any]
VERTICES, INDICES = 34962, 34963  # targets of buffer views
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
COMPONENTS = {"<f4": 5126, "<u4": 5125, "<u2": 5123}
QUALITY = 90  # of JPEG files


class Gltf:
    """A file in the making. Equal contents are stored once."""

    def __init__(self) -> None:
        self.lists: dict[str, list[Any]] = {}
        self.data = bytearray()
        self.extensions: set[str] = set()
        self._seen: dict[Any, int] = {}

    def add(self, name: str, item: dict[str, Any]) -> int:
        """Return the index of an item of a list such as "nodes"; nodes are never shared."""
        key = name, json.dumps(item)
        if name == "nodes" or key not in self._seen:
            items = self.lists.setdefault(name, [])
            items.append(item)
            self._seen[key] = len(items) - 1
        return self._seen[key]

    def extended(self, name: str, values: dict[str, Any]) -> dict[str, Any]:
        """Return `extensions` of an item with one extension."""
        self.extensions.add(name)
        return {name: values}

    def view(self, content: bytes, **how: int) -> int:
        """Return the index of a buffer view of bytes; `how` is what else it tells."""
        key = content, *how.items()
        if key not in self._seen:
            self.data += bytes(-len(self.data) % 4)
            place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
            self.data += content
            self._seen[key] = self.add("bufferViews", {**place, **how})
        return self._seen[key]

    def accessor(self, values: Array, kind: str, bounds: bool = False) -> int:
        """Return the index of an accessor of attributes, (N, 2 to 4), or of indices, (N,)."""
        values = np.ascontiguousarray(values, kind)
        how = {"target": INDICES}
        if values.ndim > 1:  # positions and normals of a sphere are equal, and share a view
            how = {"target": VERTICES, "byteStride": values.strides[0]}
        told = {
            "bufferView": self.view(values.tobytes(), **how),
            "componentType": COMPONENTS[kind],
            "count": len(values),
            "type": TYPES[values.shape[1] if values.ndim > 1 else 1],
        }
        if bounds:
            told |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", told)

    def texture(self, pixels: Array, wrap: tuple[int, int]) -> dict[str, int]:
        """Return a reference to an image, (H, W, 3) uint8, as JPEG; `wrap` as of samplers."""
        file = io.BytesIO()
        Image.fromarray(pixels).save(file, "JPEG", quality=QUALITY, subsampling=0)
        image = {"bufferView": self.view(file.getvalue()), "mimeType": "image/jpeg"}
        sampler = {"magFilter": 9729, "minFilter": 9987, "wrapS": wrap[0], "wrapT": wrap[1]}
        both = {"source": self.add("images", image), "sampler": self.add("samplers", sampler)}
        return {"index": self.add("textures", both)}

    def file(self, about: dict[str, Any]) -> bytes:
        """Return the file. `about` has what is no list: asset, scene and extensions."""
        self.data += bytes(-len(self.data) % 4)
        content = {**about, **self.lists, "buffers": [{"byteLength": len(self.data)}]}
        if self.extensions:
            content["extensionsUsed"] = sorted(self.extensions)
        text = json.dumps(content, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.data), b"BIN\0") + bytes(self.data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

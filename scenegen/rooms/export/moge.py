"""A data set of MoGe: for each row a folder with image.jpg, depth.png and meta.json.

Depth is planar and coded by its logarithm: with near and far as texts of the PNG file, code c from
1 to 65534 is near (far / near)^((c - 1) / 65533). Steps are therefore the same share of the depth
everywhere, and no depth is out of range. MoGe's reader takes 0 for unknown and 65535 for infinite;
where a ray hits nothing, depth is infinite.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from scenegen.camera import intrinsics
from scenegen.rooms.export.encoding import write_json, write_png
from scenegen.rooms.reader import Room

STEPS = 65533  # between near and far
INFINITE = 65535
QUALITY = 95  # of JPEG files


def write(source: Any, folder: Path) -> dict[str, Any]:
    """Write a `folder.Source`; return its conventions. Raises SpecError as `Encoding`."""
    names = []
    for scene, views in source.views():
        for room in views:
            name = f"scene-{scene:06d}/{room.index:06d}"
            names.append(name)
            (folder / name).mkdir(parents=True)
            colors = source.encoding.color_bytes(room)
            picture = Image.fromarray(colors)
            picture.save(folder / name / "image.jpg", quality=QUALITY, subsampling=0)
            write_log_depth(folder / name / "depth.png", room.depth)
            shown = (room.object_id >= 0)[..., None]
            normal = np.where(shown, (room.normal * 0.5 + 0.5) * 65535, 0)
            write_png(folder / name / "normal.png", normal, 16)
            _write_segmentation(folder / name / "segmentation.png", room)
            height, width = room.depth.shape
            matrix = intrinsics(height, width, room.lens, pixel_centers="half")
            normalized = matrix / np.array([[width], [height], [1]])
            about = {
                "intrinsics": normalized.tolist(),
                "unit": source.unit.partition(":")[0],
                "row": room.index,
            }
            write_json(folder / name / "meta.json", about)
    (folder / ".index.txt").write_text("\n".join([*names, ""]), encoding="utf-8")
    return {
        "unit": source.unit,
        "camera": "intrinsics are divided by width and height; x right, y down, looks along +z",
        "pixel_centers": "+0.5, so that the middle of an image is 0.5",
        "depth": "planar; near (far / near)^((code - 1) / 65533), 65535 for nothing",
        "normal": "code / 65535 * 2 - 1: x right, y up, z to the viewer; 0 0 0 for nothing",
        "segmentation": "0 background (nothing), 1 the room, k + 1 the k-th object; the PNG's text"
        " has labels",
        "pictures": {"image": {**source.encoding.pictures()["image"], "jpeg_quality": QUALITY}},
    }


def write_log_depth(path: Path, depth: NDArray[Any]) -> None:
    """Write planar depth, (H, W), positive or NaN, as a PNG file of 16 bits coded by logarithm."""
    known = np.isfinite(depth)
    near = float(depth[known].min()) if known.any() else 1.0
    far = max(1.1 * near, float(depth[known].max())) if known.any() else 1.1
    share = np.log(np.where(known, depth, near).astype(float) / near) / np.log(far / near)
    codes = np.where(known, 1 + np.rint(share * STEPS), INFINITE).astype(np.uint16)
    texts = PngInfo()
    texts.add_text("near", repr(near))
    texts.add_text("far", repr(far))
    Image.fromarray(codes).save(path, "PNG", pnginfo=texts)


def log_depth(codes: NDArray[Any], texts: Mapping[Any, Any]) -> NDArray[np.float64]:
    """Return the depth of such a file from its pixels and texts, NaN where there is none.

    Raises KeyError and ValueError where the texts are not those.
    """
    near, far = float(texts["near"]), float(texts["far"])
    unit = float(texts.get("unit", 1.0))  # of older files, metres
    depth = unit * near * (far / near) ** ((codes.astype(np.float64) - 1.0) / STEPS)
    return np.where((codes > 0) & (codes < INFINITE), depth, np.nan)


def _write_segmentation(path: Path, room: Room) -> None:
    names = {f"object_{k}_{item.name}": k + 1 for k, item in enumerate(room.scene.objects, start=1)}
    texts = PngInfo()
    texts.add_text("labels", json.dumps({"background": 0, "room": 1, **names}))
    Image.fromarray((room.object_id + 1).astype(np.uint8)).save(path, "PNG", pnginfo=texts)

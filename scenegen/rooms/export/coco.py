"""A data set of COCO: images, and annotations.json with a mask, a box and an area of each object.

Masks show what is visible. Boxes count whole pixels: x and y of the first, width and height. An
object of which nothing is visible has no annotation.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.rooms.export.encoding import write_json, write_png

Array = NDArray[Any]


def write(source: Any, folder: Path) -> dict[str, Any]:
    """Write a `folder.Source`; return its conventions. Raises SpecError as `Encoding`."""
    encoding, names = source.encoding, source.rooms.spec.shapes
    (folder / "images").mkdir()
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for scene, views in source.views():
        for room in views:
            name = f"{room.index:06d}.png"
            write_png(
                folder / "images" / name, encoding.colors(room) * encoding.largest, encoding.bits
            )
            height, width = room.object_id.shape
            images.append(
                {
                    "id": room.index,
                    "file_name": name,
                    "width": width,
                    "height": height,
                    "scene": scene,
                }
            )
            for k, item in enumerate(room.scene.objects, start=1):
                mask = room.object_id == k
                if not mask.any():
                    continue
                annotations.append(
                    {
                        "id": len(annotations) + 1,
                        "image_id": room.index,
                        "category_id": names.index(item.name) + 1,
                        "object_id": k,
                        "segmentation": run_lengths(mask),
                        "area": int(mask.sum()),
                        "bbox": box(mask),
                        "iscrowd": 0,
                    }
                )
    about = {
        "info": {"description": f"rooms of {source.rooms.path.name}, pix2shape-bench"},
        "licenses": [],
        "categories": [
            {"id": i, "name": name, "supercategory": "object"}
            for i, name in enumerate(names, start=1)
        ],
        "images": images,
        "annotations": annotations,
    }
    write_json(folder / "annotations.json", about)
    return {
        "pixel_centers": "+0.5; a box begins at the left and upper border of its first pixel",
        "masks": "visible pixels, run lengths by columns",
        "object_id": "k is the k-th object of the scene, counting from 1",
        "pictures": {"image": encoding.pictures()["image"]},
    }


def run_lengths(mask: Array) -> dict[str, list[int]]:
    """Return a mask (H, W) as COCO's uncompressed RLE: runs by columns, zeros first."""
    flat = np.concatenate([[False], mask.ravel(order="F")])
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    counts = np.diff(np.concatenate([[0], changes, [mask.size]]))
    return {"size": list(mask.shape), "counts": counts.tolist()}


def box(mask: Array) -> list[int]:
    """Return x, y, width and height of a mask (H, W) that is not empty, in pixels."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    x, y = int(columns[0]), int(rows[0])
    return [x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1]

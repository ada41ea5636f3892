"""Folders of nerfstudio: one for each scene, with transforms.json, images, depth and normals.

Nerfstudio's world has z up, ours has y up: (x, y, z) becomes (x, -z, y). Its cameras are ours: x
right, y up, looking along -z. Pixel centres lie at +0.5, as here.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.camera import intrinsics, transform_points, transform_vectors
from scenegen.rooms.export.encoding import Encoding, write_json, write_png
from scenegen.rooms.export.single import write_points_ply
from scenegen.rooms.reader import Room

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from y up


def write(source: Any, folder: Path) -> dict[str, Any]:
    """Write a `folder.Source`; return its conventions. Raises SpecError as `Encoding`."""
    for scene, views in source.views():
        _write_scene(views, folder / f"scene-{scene:06d}", source.encoding)
    return {
        "world": "right-handed, z up: our (x, y, z) is (x, -z, y) here, as applied_transform says",
        "unit": source.unit,
        "camera": "transform_matrix is world from camera; x right, y up, looks along -z",
        "pixel_centers": "+0.5",
        "pictures": source.encoding.pictures(),
    }


def _write_scene(views: Sequence[Room], folder: Path, encoding: Encoding) -> None:
    for name in ("images", "depth", "normals"):
        (folder / name).mkdir(parents=True)
    frames = []
    for room in views:
        paths = {name: f"{name}/{room.index:06d}.png" for name in ("images", "depth", "normals")}
        write_png(folder / paths["images"], encoding.colors(room) * encoding.largest, encoding.bits)
        write_png(folder / paths["depth"], encoding.depth_steps(room), 16)
        write_png(folder / paths["normals"], encoding.normal_steps(room.normal), encoding.bits)
        frames.append(
            {
                "file_path": paths["images"],
                "depth_file_path": paths["depth"],
                "normal_file_path": paths["normals"],
                "transform_matrix": (Z_UP @ room.world_from_camera).tolist(),
            }
        )
    height, width = views[0].depth.shape
    matrix = intrinsics(height, width, views[0].lens, pixel_centers="half")
    about = {
        "camera_model": "OPENCV",
        "w": width,
        "h": height,
        "fl_x": matrix[0, 0],
        "fl_y": matrix[1, 1],
        "cx": matrix[0, 2],
        "cy": matrix[1, 2],
        **dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0),
        "applied_transform": Z_UP[:3].tolist(),
        "ply_file_path": "surfels.ply",
        "depth_unit_scale_factor": encoding.depth_unit,
        "frames": frames,
    }
    write_json(folder / "transforms.json", about)
    shown = [room.object_id >= 0 for room in views]
    points = [r.points_world[hit] for r, hit in zip(views, shown, strict=True)]
    normals = [
        transform_vectors(r.world_from_camera, r.normal[hit])
        for r, hit in zip(views, shown, strict=True)
    ]
    colors = [encoding.color_bytes(r)[hit] for r, hit in zip(views, shown, strict=True)]
    write_points_ply(
        folder / "surfels.ply",
        transform_points(Z_UP, np.concatenate(points)),
        transform_vectors(Z_UP, np.concatenate(normals)),
        np.concatenate(colors),
        [f"surfels of all views: world frame, z up, {views[0].unit}s"],
    )

"""Stereo pairs in the layout of Middlebury's data sets of 2014: a folder for each pair.

Lengths are millimetres; one scene unit counts as one metre. `im0` is the left image. Depth is
baseline * f / (disparity + doffs), with doffs = 0.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import intrinsics
from scenegen.rooms.export.encoding import write_png
from scenegen.rooms.reader import StereoPair

Array = NDArray[Any]
MILLIMETRES = 1000.0  # of a scene unit
BOTH, HIDDEN = 255, 128  # codes of masks; 0 where nothing is hit


def write(source: Any, folder: Path) -> dict[str, Any]:
    """Write the pairs of the rows of a `folder.Source`; return the conventions.

    Raises SpecError as `Encoding`, and where the rooms are no stereo pairs.
    """
    for scene, views in source.views():
        for row in sorted({room.index - room.index % 2 for room in views}):
            pair = source.rooms.stereo(row)
            place = folder / f"scene-{scene:06d}-view-{pair.left.view_index // 2}"
            place.mkdir()
            _write_pair(pair, place, source.encoding)
    return {
        "unit": f"millimetre; 1000 are 1 {source.unit}",
        "pixel_centers": "0: the centre of the first pixel is (0, 0)",
        "disparity": "x in im0 minus x in im1, pixels; infinite where nothing is hit",
        "masks": f"{BOTH} seen in both images, {HIDDEN} in this one only, 0 nothing",
        "pictures": {"image": source.encoding.pictures()["image"]},
    }


def _write_pair(pair: StereoPair, place: Path, encoding: Any) -> None:
    parts = zip((pair.left, pair.right), pair.disparity, pair.visible, strict=True)
    for i, (room, disparity, visible) in enumerate(parts):
        colors = encoding.colors(room) * encoding.largest
        write_png(place / f"im{i}.png", colors, encoding.bits)
        write_pfm(place / f"disp{i}.pfm", np.where(np.isnan(disparity), np.inf, disparity))
        codes = np.where(np.isnan(disparity), 0, np.where(visible, BOTH, HIDDEN))
        write_png(place / f"mask{i}nocc.png", codes, 8)
    height, width = pair.left.depth.shape
    matrix = intrinsics(height, width, pair.left.lens, pixel_centers="integer")
    rows = "; ".join(" ".join(map(repr, row)) for row in matrix.tolist())
    known = pair.disparity[np.isfinite(pair.disparity)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    lines = {
        "cam0": f"[{rows}]",
        "cam1": f"[{rows}]",
        "doffs": 0,
        "baseline": repr(pair.baseline * MILLIMETRES),
        "width": width,
        "height": height,
        "ndisp": math.ceil(high) + 1,
        "isint": 0,
        "vmin": math.floor(low),
        "vmax": math.ceil(high),
        "dyavg": 0,
        "dymax": 0,
    }
    text = "".join(f"{name}={value}\n" for name, value in lines.items())
    (place / "calib.txt").write_text(text, encoding="utf-8")


def write_pfm(path: Path, values: Array) -> None:
    """Write (H, W) values as a portable float map: the lowest row first, little-endian."""
    height, width = values.shape
    head = f"Pf\n{width} {height}\n-1.0\n".encode()
    path.write_bytes(head + np.ascontiguousarray(values[::-1], "<f4").tobytes())

"""Pixels to points: the pinhole camera of the benchmark.

Camera frame: x right, y up, looking along -z. Row 0 is the top row and pixel centres lie at +0.5.
Pixels are square; the vertical field of view fixes their size.
"""

import math

import numpy as np
from numpy.typing import NDArray


def pixel_pitch(height: int, fov_y_degrees: float) -> float:
    """Width of a pixel on the image plane at depth 1: 2 tan(fov_y / 2) / height."""
    if not 0.0 < fov_y_degrees < 180.0:
        raise ValueError(f"fov_y_degrees must lie between 0 and 180, got {fov_y_degrees}")
    return 2.0 * math.tan(math.radians(fov_y_degrees) / 2.0) / height


def image_plane(
    height: int, width: int, fov_y_degrees: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """X (width,) and y (height,) of the pixel centres on the image plane at depth 1."""
    pitch = pixel_pitch(height, fov_y_degrees)
    columns, rows = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)
    return (columns + 0.5 - width / 2.0) * pitch, (height / 2.0 - rows - 0.5) * pitch


def back_project(depth: NDArray[np.floating], fov_y_degrees: float) -> NDArray[np.float64]:
    """Points (..., H, W, 3) in the camera frame of planar depth (..., H, W).

    point = depth * (x, y, -1) with (x, y) the pixel centre on the image plane at depth 1, in the
    unit of the depth. Planar depth is -z, not the distance along the ray. Depth that is not finite
    gives NaN points. Source: the pinhole model, Hartley and Zisserman 2004, Multiple View Geometry,
    section 6.1.
    """
    planar = np.asarray(depth, dtype=np.float64)
    if planar.ndim < 2:
        raise ValueError(f"depth must have shape (..., H, W), got {planar.shape}")
    planar = np.where(np.isfinite(planar), planar, np.nan)  # infinity times 0 would warn
    x, y = image_plane(planar.shape[-2], planar.shape[-1], fov_y_degrees)
    return np.stack([x * planar, y[:, None] * planar, -planar], axis=-1)

"""Cameras, rays of pixels and back-projection. The conventions of frames and pixels are:

World: right-handed, y up; the room is the half-open unit box with floor y = 0 and walls x = 0 and
z = 0; its side length is the unit of length ("scene unit").
Camera: x right, y up, looking along -z (OpenGL). `world_from_camera` maps camera to world points.
Pixels: row 0 on top, column 0 on the left, centres at +0.5.
Depth: planar, -z in the camera frame. A pixel's ray is (x, y, -1) in the camera frame, so the ray
parameter of a hit IS its depth.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SpecError
from scenegen.common.records import Vector3, check
from scenegen.common.rotations import cos_sin, cross

Array = NDArray[Any]
_FIRST_CENTER = {"half": 0.5, "integer": 0.0}


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with square pixels, its principal point in the middle, and y up.

    Attributes:
        position: centre of projection, world, scene units.
        target: the point it looks at, world; not straight above or below `position`.
        fov_y_degrees: vertical field of view.
    """

    position: Vector3
    target: Vector3
    fov_y_degrees: float

    def __post_init__(self) -> None:
        check(0 < self.fov_y_degrees < 180, "fov_y_degrees", self.fov_y_degrees, "0 to 180")
        check(self.position != self.target, "camera", self.position, "a target elsewhere")

    @staticmethod
    def fov_y_from_square(fov_degrees: float, height: int, width: int) -> float:
        """Return the vertical field of view of an image with the diagonal of a square one."""
        diagonal = math.tan(math.radians(fov_degrees) / 2) * math.sqrt(2)
        half = diagonal * height / math.hypot(height, width)
        return fov_degrees if height == width else round(math.degrees(2 * math.atan(half)), 9)

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(4, 4) rigid transform from camera to world coordinates."""
        matrix = look_at(np.array(self.position, float), np.array(self.target, float))
        if not np.isfinite(matrix).all():
            raise SpecError(
                "camera",
                f"a view straight along y from {self.position}",
                "a direction of view that is not vertical",
            )
        return matrix


def look_at(position: Array, target: Array) -> NDArray[np.float64]:
    """Return the (..., 4, 4) `world_from_camera` of cameras at positions (..., 3), with y up.

    NaN where a camera looks straight along y. A matrix has the same bits on every machine.
    """
    x, y, z = np.moveaxis(position - target, -1, 0)
    length = np.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    across = np.sqrt(x * x + z * z)
    across = np.where(across < 1e-9, np.nan, across)
    right = z / across, np.zeros_like(x), -x / across  # y axis x back
    matrix = np.zeros((*np.shape(x), 4, 4))
    for column, values in enumerate((right, cross((x, y, z), right), (x, y, z))):
        for row in range(3):
            matrix[..., row, column] = values[row]
    matrix[..., :3, 3] = position
    matrix[..., 3, 3] = 1.0
    return matrix


@lru_cache(maxsize=1024)
def half_angle(fov_degrees: float) -> tuple[float, float]:
    """Return cosine and sine of half an angle, with the same bits on every machine."""
    cosine, sine = cos_sin(fov_degrees / 720)
    return float(cosine), float(sine)


def pixel_size(height: int, fov_y_degrees: float) -> float:
    """Return the side of a pixel on the plane at depth 1, in scene units."""
    cosine, sine = half_angle(fov_y_degrees)
    return 2 * (sine / cosine) / height


def pixel_directions(height: int, width: int, fov_y_degrees: float) -> NDArray[np.float64]:
    """Return the directions of the rays through the pixel centres: (height, width, 3).

    They are in the camera frame and have z = -1.
    """
    pixel = pixel_size(height, fov_y_degrees)
    directions = np.empty((height, width, 3))
    directions[..., 0] = (np.arange(width) + 0.5 - width / 2) * pixel
    directions[..., 1] = ((height / 2 - 0.5) - np.arange(height))[:, None] * pixel
    directions[..., 2] = -1.0
    return directions


def back_project(depth: Array, fov_y_degrees: float) -> NDArray[np.float64]:
    """Return the surface points of a planar depth map in the camera frame: (H, W) -> (H, W, 3).

    Points are NaN where the depth is not finite.
    """
    height, width = depth.shape
    directions = pixel_directions(height, width, fov_y_degrees)
    known = np.where(np.isfinite(depth), depth, np.nan)  # infinity times 0 would warn
    return np.asarray(directions * known[..., None])


def pixels_of(
    points: Array, shape: tuple[int, ...], fov_y_degrees: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return row and column of points (N, 3), camera frame, and which are in an image, (N,) each.

    The image has the shape (H, W). Row and column are 0 for points that are not in it.
    """
    height, width = shape
    ahead = points[:, 2] < 0.0
    depth = np.where(ahead, -points[:, 2], 1.0)
    pixel = pixel_size(height, fov_y_degrees)
    column = np.floor(points[:, 0] / depth / pixel + width / 2.0)
    row = np.floor(height / 2.0 - points[:, 1] / depth / pixel)
    inside = ahead & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    row, column = (np.where(inside, at, 0).astype(np.int64) for at in (row, column))
    return row, column, inside


def transform_points(matrix: Array, points: Array) -> NDArray[np.float64]:
    """Apply a (4, 4) `to_from` transform to points (..., 3)."""
    return transform_vectors(matrix, points) + matrix[:3, 3]


def transform_vectors(matrix: Array, vectors: Array) -> NDArray[np.float64]:
    """Apply the rotation of a rigid (4, 4) `to_from` transform to vectors (..., 3)."""
    x, y, z = (vectors[..., i, None] * matrix[:3, i] for i in range(3))
    return np.asarray(x + y + z)  # not `@`, whose bits depend on the processor


def intrinsics(
    height: int, width: int, fov_y_degrees: float, *, pixel_centers: str
) -> NDArray[np.float64]:
    """Return the (3, 3) camera matrix, in pixels, of tools with x right, y DOWN, z forward.

    Args:
        pixel_centers: where the tool puts the centre of the first pixel: "half" for (0.5, 0.5), as
            here, in COLMAP and in nerfstudio; "integer" for (0, 0), as in OpenCV and Open3D.

    Raises SpecError for another name.
    """
    check(pixel_centers in _FIRST_CENTER, "pixel_centers", pixel_centers, "half or integer")
    focal = height / 2 / math.tan(math.radians(fov_y_degrees) / 2)
    shift = _FIRST_CENTER[pixel_centers] - 0.5
    x, y = width / 2 + shift, height / 2 + shift
    return np.array([[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]])

"""Cameras, rays of pixels and back-projection. The conventions of frames and pixels are:

World: right-handed, y up; the room is the half-open unit box with floor y = 0 and walls x = 0 and
z = 0; its side length is the unit of length ("scene unit").
Camera: x right, y up, looking along -z (OpenGL). `world_from_camera` maps camera to world points.
Pixels: row 0 on top, column 0 on the left, centres at +0.5.
Depth: planar, -z in the camera frame. A pixel's ray is (x, y, -1) in the camera frame, so the ray
parameter of a hit IS its depth.
Panoramas: rays are unit vectors, so that their depth is the distance along the ray.
Lens: how pixels map to rays. Where a function takes a number in place of a `Lens`, the number is
the vertical field of view in degrees, pixels are square, and the principal point is the middle.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

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
        fov_y_degrees: vertical field of view; of panoramas, of the view ahead.
    """

    position: Vector3
    target: Vector3
    fov_y_degrees: float

    def __post_init__(self) -> None:
        check(0 < self.fov_y_degrees < 180, "fov_y_degrees", self.fov_y_degrees, "0 to 180")
        check(self.position != self.target, "camera", self.position, "a target elsewhere")

    @staticmethod
    def fov_y_from_square(fov_degrees: float, height: int, width: float) -> float:
        """Return the vertical field of view of an image with the diagonal of a square one.

        Height and width are in heights of a pixel.
        """
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


class Grid(NamedTuple):
    """The pixels of an image on the plane at depth 1. The numbers may be arrays of any library.

    Attributes:
        x, y: principal point, in pixels from the upper left corner.
        across, down: width and height of a pixel, in scene units.
    """

    x: Any
    y: Any
    across: Any
    down: Any

    def slopes(self, column: Any, row: Any) -> tuple[Any, Any]:
        """Return x and y on the plane of places in the image: the ray there is (x, y, -1)."""
        return (column - self.x) * self.across, (self.y - row) * self.down

    def places(self, x: Any, y: Any, depth: Any) -> tuple[Any, Any]:
        """Return column and row, in pixels from the upper left corner, of points."""
        return x / (depth * self.across) + self.x, self.y - y / (depth * self.down)


@dataclass(frozen=True)
class Lens:
    """How the pixels of an image map to rays.

    Attributes:
        fov_y_degrees: vertical field of view that the image has if its principal point is moved to
            the middle.
        principal_point: x and y, as fractions of width and height from the upper left corner.
        pixel_aspect: width of a pixel over its height.
        projection: "perspective", or "equirectangular" for a panorama. Its columns are longitudes
            from -180 to 180 degrees, 0 straight ahead, and its rows are latitudes from 90 to -90.
    """

    fov_y_degrees: float
    principal_point: tuple[float, float] = (0.5, 0.5)
    pixel_aspect: float = 1.0
    projection: str = "perspective"

    @property
    def is_flat(self) -> bool:
        """Whether the image is a plane, as of a pinhole camera."""
        return self.projection == "perspective"

    @property
    def is_centred(self) -> bool:
        """Whether the image is flat, pixels are square, and the principal point is the middle."""
        return self == Lens(self.fov_y_degrees)

    def edges(self, height: int, width: int) -> tuple[float, float, float, float]:
        """Return x of the left and right, y of the upper and lower edge on the plane at depth 1."""
        cosine, sine = half_angle(self.fov_y_degrees)
        high = sine / cosine
        wide = width / height * high * self.pixel_aspect
        x, y = self.principal_point
        return -2 * x * wide, 2 * (1 - x) * wide, 2 * y * high, -2 * (1 - y) * high

    def grid(self, height: int, width: int) -> Grid:
        """Return where the pixels of an image are on the plane at depth 1.

        Raises SpecError for panoramas, as does all that needs a plane.
        """
        check(self.is_flat, "projection", self.projection, "a perspective camera")
        cosine, sine = half_angle(self.fov_y_degrees)
        down = 2 * (sine / cosine) / height
        x, y = self.principal_point
        return Grid(x * width, y * height, down * self.pixel_aspect, down)


def as_lens(lens: Lens | float) -> Lens:
    """Return a lens, or the one that a number stands for."""
    return lens if isinstance(lens, Lens) else Lens(lens)


def pixel_size(height: int, lens: Lens | float) -> float:
    """Return the side of a pixel on the plane at depth 1, in scene units.

    Of pixels that are not square, it is the geometric mean of both sides.
    """
    grid = as_lens(lens).grid(height, height)
    return float(grid.down * math.sqrt(grid.across / grid.down))


def pixel_directions(height: int, width: int, lens: Lens | float) -> NDArray[np.float64]:
    """Return the directions of the rays through the pixel centres: (height, width, 3).

    They are in the camera frame and have z = -1; those of panoramas have length 1.
    """
    lens, directions = as_lens(lens), np.empty((height, width, 3))
    if not lens.is_flat:
        east, north = ((np.arange(n) + 0.5) / n - 0.5 for n in (width, height))
        (ahead, right), (level, down) = cos_sin(east), cos_sin(north / 2)
        level = level[:, None]
        directions[..., 0], directions[..., 1] = level * right, -down[:, None]
        directions[..., 2] = -level * ahead
        return directions
    grid = lens.grid(height, width)
    x, y = grid.slopes(np.arange(width) + 0.5, np.arange(height) + 0.5)
    directions[..., 0], directions[..., 1] = x, y[:, None]
    directions[..., 2] = -1.0
    return directions


def back_project(depth: Array, lens: Lens | float) -> NDArray[np.float64]:
    """Return the surface points of a depth map in the camera frame: (H, W) -> (H, W, 3).

    Points are NaN where the depth is not finite.
    """
    height, width = depth.shape
    directions = pixel_directions(height, width, lens)
    known = np.where(np.isfinite(depth), depth, np.nan)  # infinity times 0 would warn
    return np.asarray(directions * known[..., None])


def pixels_of(
    points: Array, shape: tuple[int, ...], lens: Lens | float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return row and column of points (N, 3), camera frame, and which are in an image, (N,) each.

    The image has the shape (H, W). Row and column are 0 for points that are not in it.
    """
    height, width = shape
    ahead = points[:, 2] < 0.0
    depth = np.where(ahead, -points[:, 2], 1.0)
    places = as_lens(lens).grid(height, width).places(points[:, 0], points[:, 1], depth)
    column, row = map(np.floor, places)
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
    height: int, width: int, lens: Lens | float, *, pixel_centers: str
) -> NDArray[np.float64]:
    """Return the (3, 3) camera matrix, in pixels, of tools with x right, y DOWN, z forward.

    Args:
        pixel_centers: where the tool puts the centre of the first pixel: "half" for (0.5, 0.5), as
            here, in COLMAP and in nerfstudio; "integer" for (0, 0), as in OpenCV and Open3D.

    Raises SpecError for another name, and for panoramas.
    """
    check(pixel_centers in _FIRST_CENTER, "pixel_centers", pixel_centers, "half or integer")
    lens = as_lens(lens)
    focal = height / 2 / math.tan(math.radians(lens.fov_y_degrees) / 2)
    shift, grid = _FIRST_CENTER[pixel_centers] - 0.5, lens.grid(height, width)
    x, y = grid.x + shift, grid.y + shift
    return np.array([[focal / lens.pixel_aspect, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]])

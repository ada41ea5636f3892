"""Pictures of many meshes at once, in numpy: z-buffer, one colour a triangle, no gradients.

The method of Rezende et al. (2016) renders with OpenGL, which can only be sampled. This is such a
renderer: arrays go in, arrays come out, and nothing can be differentiated through it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_size

Array = NDArray[Any]
NEAR = 0.05  # least depth of a triangle, as a share of the camera's distance from the origin


@dataclass(frozen=True, eq=False)
class Views:
    """What pictures depend on besides the mesh. Frame: axes of the camera, origin of the world.

    So the camera is at (0, 0, distance) and looks along -z at the origin. Lengths are in the
    unit of the file that the images come from, such as cube edges.

    Attributes:
        size: height and width of a picture, pixels.
        fov_y_degrees: field of view.
        distance: from the camera to the origin.
        reflectance, ambient, background: RGB of rho, L_a and the radiance of empty pixels, (3,).
        attenuation: (k_l, k_q) of the shading equation.
        light_position, light_color: l_j and L_j, (N, L, 3); unused lights have colour 0.
    """

    size: int
    fov_y_degrees: float
    distance: float
    reflectance: Array
    ambient: Array
    background: Array
    attenuation: tuple[float, float]
    light_position: Array
    light_color: Array


def rasterise(vertices: Array, faces: Array, views: Views) -> tuple[Array, Array]:
    """Return linear radiance, (N, S, S, 3), and planar depth, (N, S, S), of N meshes.

    A pixel shows the nearest triangle that its centre lies in, if that faces the camera; depth is
    infinite where there is none. Triangles nearer than NEAR are left out. Each triangle has one
    radiance, that of its centroid (see `shade_triangles`).

    Args:
        vertices: (N, V, 3) in the frame of `Views`.
        faces: (F, 3) indices, corners anticlockwise when seen from outside.
        views: with N rows of lights.
    """
    count, size = len(vertices), views.size
    vertices = np.asarray(vertices, np.float32)
    facing, shown, pixel, inverse = _visible(vertices, faces, views)
    radiance = np.empty((count * size * size, 3), np.float32)
    radiance[:] = views.background
    radiance[pixel] = shade_triangles(vertices, faces, views, facing)[shown]
    depth = np.full(count * size * size, np.inf, np.float32)
    depth[pixel] = 1 / inverse
    return radiance.reshape(count, size, size, 3), depth.reshape(count, size, size)


def project(vertices: Array, views: Views) -> tuple[Array, Array, Array]:
    """Return where vertices, (..., 3), lie on the picture: x, y and inverse depth, (...) each.

    x and y are in pixels, where whole numbers are the centres of pixels and row 0 is on top.
    Inverse depth is 0 for vertices nearer than NEAR, and x and y mean nothing then.
    """
    depth = views.distance - vertices[..., 2]
    inverse = np.where(depth > NEAR * views.distance, 1 / np.where(depth == 0, 1, depth), 0)
    scale = inverse / pixel_size(views.size, views.fov_y_degrees)
    middle = (views.size - 1) / 2
    return middle + vertices[..., 0] * scale, middle - vertices[..., 1] * scale, inverse


def shade_triangles(vertices: Array, faces: Array, views: Views, chosen: Array) -> Array:
    """Return the radiance of some triangles at their centroids, (T, 3).

    This is the shading equation of `scenegen.rendering.shading`, with the normal of the triangle.

    Args:
        chosen: (T,) numbers of triangles, which count those of all meshes.
    """
    mesh, face = np.divmod(chosen, len(faces))
    # Coordinates come first, (3, T): sums over them are then several times faster.
    a, b, c = (np.ascontiguousarray(vertices[mesh, faces[face, k]].T) for k in range(3))
    centre = (a + b + c) / 3
    normal = np.cross(b - a, c - a, axis=0)
    normal /= np.maximum(_length(normal), 1e-12)
    linear, quadratic = views.attenuation
    total = np.empty((len(chosen), 3), np.float32)
    total[:] = views.ambient
    for j in range(views.light_position.shape[1]):
        toward = views.light_position[mesh, j].T.astype(np.float32) - centre
        distance = np.maximum(_length(toward), 1e-6)
        x, y, z = toward * normal
        cosine = np.maximum(x + y + z, 0) / distance
        falloff = cosine / (linear * distance + quadratic * distance**2)
        total += falloff[:, None] * views.light_color[mesh, j].astype(np.float32)
    return total * np.asarray(views.reflectance, np.float32)


def _length(vectors: Array) -> Array:
    x, y, z = vectors
    return np.sqrt(x * x + y * y + z * z)


def _visible(vertices: Array, faces: Array, views: Views) -> tuple[Array, Array, Array, Array]:
    """Return which triangles face the camera, and which pixels show one of them.

    Returns the numbers of the triangles that face the camera, (T,), counting those of all meshes;
    and of each pixel that shows one: its place in that list, the number of the pixel, counting
    those of all pictures row by row, and inverse depth, (P,) each.
    """
    size = views.size
    x, y, inverse = project(vertices, views)
    ahead = inverse > 0
    cx, cy, cz = ([value[:, corner].ravel() for corner in faces.T] for value in (x, y, inverse))
    # Twice the area on the picture; as rows go down, it is negative for anticlockwise corners.
    area = (cx[1] - cx[0]) * (cy[2] - cy[0]) - (cx[2] - cx[0]) * (cy[1] - cy[0])
    facing = np.flatnonzero((area < -1e-6) & ahead[:, faces].all(axis=2).ravel())
    cx, cy, cz = ([value[facing] for value in values] for values in (cx, cy, cz))
    low_x, wide = _covered(cx, size)
    low_y, tall = _covered(cy, size)
    planes = _planes(cx, cy, cz, area[facing], low_x, low_y)
    # One entry for each pixel of each triangle's bounding box.
    boxes = wide * tall
    of = np.repeat(np.arange(len(facing)), boxes)
    place = np.arange(len(of)) - np.repeat(np.cumsum(boxes) - boxes, boxes)
    down, right = np.divmod(place.astype(np.int32), wide.astype(np.int32)[of])
    right, down = right.astype(np.float32), down.astype(np.float32)  # ints would make it float64
    terms = planes[:, of]
    first = terms[0] + terms[1] * right + terms[2] * down
    second = terms[3] + terms[4] * right + terms[5] * down
    inside = np.flatnonzero((first >= 0) & (second >= 0) & (first + second <= 1))
    of, right, down, terms = of[inside], right[inside], down[inside], terms[6:, inside]
    near = terms[0] + terms[1] * right + terms[2] * down
    corner = (facing // len(faces) * size + low_y) * size + low_x
    pixel = corner[of] + (down * size + right).astype(np.int64)
    nearest = np.zeros(len(vertices) * size * size, np.float32)
    np.maximum.at(nearest, pixel, near)
    shown = near == nearest[pixel]
    return facing, of[shown], pixel[shown], near[shown]


def _covered(corners: list[Array], size: int) -> tuple[Array, Array]:
    """Return the first pixel of each triangle's bounding box on one axis, and their number."""
    least = np.minimum(np.minimum(corners[0], corners[1]), corners[2])
    most = np.maximum(np.maximum(corners[0], corners[1]), corners[2])
    low = np.clip(np.ceil(least), 0, size).astype(np.int64)
    high = np.clip(np.floor(most), -1, size - 1).astype(np.int64)
    return low, np.maximum(high - low + 1, 0)


def _planes(
    cx: list[Array], cy: list[Array], cz: list[Array], area: Array, low_x: Array, low_y: Array
) -> Array:
    """Return weights of corners 1 and 2, and inverse depth, as functions of the pixel, (9, T).

    Each is a value at the corner of the bounding box and its slopes to the right and down. Inverse
    depth is affine on the picture, as triangles are flat.
    """
    dx1, dx2, dy1, dy2 = cx[1] - cx[0], cx[2] - cx[0], cy[1] - cy[0], cy[2] - cy[0]
    x, y = low_x - cx[0], low_y - cy[0]
    one = np.stack([x * dy2 - y * dx2, dy2, -dx2]) / area
    two = np.stack([y * dx1 - x * dy1, -dy1, dx1]) / area
    depth = one * (cz[1] - cz[0]) + two * (cz[2] - cz[0])
    depth[0] += cz[0]
    return np.concatenate([one, two, depth]).astype(np.float32)

"""Ground truth derived from depth, cameras and poses, without rendering: arrays in, arrays out.

Frames and pixels are those of `scenegen.camera`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import (
    Lens,
    as_lens,
    back_project,
    pixel_size,
    transform_points,
    transform_vectors,
)
from scenegen.common.records import check

Array = NDArray[Any]


def project(
    points: Array, world_from_camera: Array, height: int, width: int, lens: Lens | float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where points of the world, (..., 3), are in an image, and their planar depth.

    Returns (..., 2) pixels, x right and y down, the centre of the first pixel at (0.5, 0.5); and
    depth (...), scene units. Pixels are NaN where the depth is not positive.
    """
    local = (points - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    depth = -local[..., 2]
    ahead, grid = np.where(depth > 0, depth, np.nan), as_lens(lens).grid(height, width)
    places = grid.places(local[..., 0], local[..., 1], ahead)
    return np.stack(places, axis=-1), np.asarray(depth)


def optical_flow(
    depth: Array,
    world_from_camera: Array,
    other_world_from_camera: Array,
    lens: Lens | float,
    other_lens: Lens | float | None = None,
) -> NDArray[np.float64]:
    """Return how far each pixel's surface point moves from one view to another, (H, W, 2).

    In pixels, x right and y down. The scene does not move; occluded points have a flow too. NaN
    where the depth, (H, W), is NaN or the point is behind the other camera.
    """
    height, width = depth.shape
    points = transform_points(world_from_camera, back_project(depth, lens))
    other_lens = lens if other_lens is None else other_lens
    pixels, _ = project(points, other_world_from_camera, height, width, other_lens)
    centers = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
    return np.asarray(pixels - centers)


def seen_from(
    points: Array,
    object_id: Array,
    other_depth: Array,
    other_normal: Array,
    other_object_id: Array,
    other_world_from_camera: Array,
    lens: Lens | float,
    tolerance: float = 0.75,
) -> NDArray[np.bool_]:
    """Return whether surface points are visible in another view, given the maps of that view.

    The four nearest pixels of the other view vote, with the weights of bilinear interpolation. A
    pixel votes for visible if it shows the same object, and the point is at most `tolerance` pixel
    widths behind the plane of its surfel. A point is visible with more than half of the weight. The
    result can be wrong within half a pixel of a silhouette.

    Args:
        points: world, (..., 3); those with NaN are not visible.
        object_id: of the points, (...).
        other_depth, other_normal, other_object_id: maps of the other view, (H, W), (H, W, 3) and
            (H, W), as in a file of rooms.
        lens: of the other view.
    """
    height, width = other_depth.shape
    pixels, depth = project(points, other_world_from_camera, height, width, lens)
    surfels = transform_points(other_world_from_camera, back_project(other_depth, lens))
    normals = transform_vectors(other_world_from_camera, other_normal)
    inside = (
        (depth > 0)
        & (pixels >= 0).all(axis=-1)
        & (pixels[..., 0] < width)
        & (pixels[..., 1] < height)
    )
    corner = np.floor(np.where(inside[..., None], pixels, 0.5) - 0.5).astype(np.int64)
    thickness = tolerance * pixel_size(height, lens) * depth
    share = np.where(inside[..., None], pixels, 0.5) - 0.5 - corner  # of the right, lower pixel
    votes = np.zeros(inside.shape)
    for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column = (corner[..., 0] + right).clip(0, width - 1)
        row = (corner[..., 1] + down).clip(0, height - 1)
        offset = np.nan_to_num(points) - np.nan_to_num(surfels[row, column])
        before = np.einsum("...i,...i->...", offset, normals[row, column])
        shows = (other_object_id[row, column] == object_id) & (before > -thickness)
        weight = np.abs(1 - right - share[..., 0]) * np.abs(1 - down - share[..., 1])
        votes += weight * shows
    return np.asarray((votes > 0.5) & inside)


def object_coordinates(
    points: Array, object_id: Array, world_from_object: Array
) -> NDArray[np.float64]:
    """Return the point of each pixel in the frame of its object's unit shape, (H, W, 3).

    Unit shapes have bounding radius 1 about 0, so (value + 1) / 2 is in the unit cube, as the
    coordinates of NOCS do (Wang et al., CVPR 2019). NaN where no object is hit.

    Args:
        points: world, (H, W, 3), scene units.
        object_id: (H, W), from 1 for objects.
        world_from_object: similarities by slot, (K, 4, 4).
    """
    coordinates = np.full(points.shape, np.nan)
    most = int(object_id.max(initial=0))
    check(most <= len(world_from_object), "object_id", most, f"at most {len(world_from_object)}")
    for k in range(1, most + 1):
        matrix, shown = world_from_object[k - 1], object_id == k
        if shown.any():
            linear = matrix[:3, :3] / np.square(matrix[:3, 0]).sum()  # transposed inverse
            coordinates[shown] = (points[shown] - matrix[:3, 3]) @ linear
    return coordinates


def albedo(object_id: Array, reflectance: Array) -> NDArray[np.float64]:
    """Return the reflectance rho of each pixel, (H, W, 3) linear RGB; NaN without a surface.

    Args:
        object_id: (H, W).
        reflectance: by object id, (1 + K, 3), as `material/reflectance` of a file of rooms.
    """
    rho = np.asarray(reflectance, np.float64)[object_id.clip(0)]
    return np.where(object_id[..., None] < 0, np.nan, rho)

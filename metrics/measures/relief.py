"""The empty room, and relief: how far a surface stands before it, along the viewing axis.

The empty room is what a camera would see if the room held no object.

The relief of a pixel is the planar depth of the empty room minus that of the surface, in scene
units. It is 0 on floor and walls, and above 0 on objects. The scores look at shape and place of
what stands out, so that lifting or tilting the empty room wins little. But objects stand where they
often do: one relief for all pictures, the mean of a training set, has a correlation of 0.53 and an
IoU of 0.37 with those of the preset `shapes`. So relief is compared with another scene's, too.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require, require_finite, require_some
from scenegen.camera import Lens, pixel_directions

Array = NDArray[Any]
RELIEF_ABOVE = 0.05  # scene units: pixels with more than this stand out
# Scene units. A predicted relief that varies less counts as if it varied so much: without this,
# rounding to half precision, or noise of any size, could be taken for relief.
LEAST_SPREAD = 1e-3


def empty_room(
    world_from_camera: Array,
    lens: Lens | float,
    height: int,
    width: int,
    room_size: Array | None = None,
) -> tuple[Array, Array]:
    """Return planar depth, (H, W), and normals, (H, W, 3), of the room's floor and two walls.

    Depth is in scene units and normals are in the camera frame. The planes are continued beyond
    the room's edges, so that every pixel has a depth. A closed room has a ceiling and four walls;
    its windows count as wall, as what is outside has no depth.

    Args:
        world_from_camera: rigid transform of the camera, (4, 4).
        lens: of the camera.
        room_size: of a closed room, (3,); None for the paper's room.
    """
    lines = pixel_directions(height, width, lens)
    reach = _reach(lines, world_from_camera, room_size)
    axis = np.eye(3)[reach.argmin(axis=-1)]
    if room_size is not None:
        axis = np.where(lines @ world_from_camera[:3, :3].T > 0, -axis, axis)
    return _least(reach), axis @ world_from_camera[:3, :3]


def depth_along(lines: Array, world_from_camera: Array, room_size: Array | None = None) -> Array:
    """Return planar depth (N,) of the same planes along lines (N, 3), camera frame, z = -1."""
    return _least(_reach(lines, world_from_camera, room_size))


def _reach(lines: Array, world_from_camera: Array, room_size: Array | None) -> Array:
    """Return planar depth of the plane of each axis along lines, (..., 3)."""
    directions, origin = lines @ world_from_camera[:3, :3].T, world_from_camera[:3, 3]
    with np.errstate(divide="ignore", over="ignore"):
        reach: Array = np.where((directions < 0) & (origin > 0), -origin / directions, np.inf)
        if room_size is not None:
            far = (room_size - origin) / directions
            reach = np.where((directions > 0) & (origin < room_size), far, reach)
    return reach


def _least(reach: Array) -> Array:
    """Return the nearest plane's depth; where a line meets none, the farthest that others meet."""
    depth = reach.min(axis=-1)
    return np.asarray(
        np.where(np.isfinite(depth), depth, depth[np.isfinite(depth)].max(initial=1.0))
    )


def relief_scores(predicted: ArrayLike, true: ArrayLike) -> dict[str, float]:
    """Return `relief_correlation` and `relief_iou` of the relief of the scored pixels, (N,) each.

    With p the predicted and t the true relief:

    - relief_correlation: cov(p, t) / (max(std(p), least) std(t)), in [-1, 1], where least is
      LEAST_SPREAD, or std(t) where that is smaller. This is Pearson's correlation for every
      prediction with as much relief, and goes to 0 as the relief of a prediction does.
    - relief_iou: pixels where p and t both exceed RELIEF_ABOVE, divided by those where either does.

    Both are NaN where t exceeds RELIEF_ABOVE nowhere: nothing stands out that could be found.
    Raises NonFiniteError, EmptyError, and MeasureError on shapes that differ.
    """
    p, t = as_float64(predicted, "predicted relief"), as_float64(true, "true relief")
    ok = p.shape == t.shape and t.ndim == 1
    require(ok, "relief", f"shapes {p.shape} and {t.shape}", "two arrays (N,)")
    require_some(len(t), "relief")
    require_finite(p, "predicted relief")
    require_finite(t, "true relief")
    truly, said = t > RELIEF_ABOVE, p > RELIEF_ABOVE
    if not truly.any():
        return {"relief_correlation": np.nan, "relief_iou": np.nan}
    p, t = p - p.mean(), t - t.mean()
    variance = float((t * t).mean())
    least = max(float((p * p).mean()), min(LEAST_SPREAD**2, variance))
    # A picture that stands out alike all over has no spread. Of equal reliefs, this is 1 exactly.
    correlation = float((p * t).mean()) / math.sqrt(least * variance) if variance > 0.0 else 0.0
    return {
        "relief_correlation": min(max(correlation, -1.0), 1.0),
        "relief_iou": float((said & truly).sum() / (said | truly).sum()),
    }

"""What happens along a ray, in Dr.Jit, where an image shows equal cubes of one orientation.

In their common frame all cubes lie along the axes, so each costs a ray a few operations, and no
structure is needed. `benchmarks/questions.py` measures what that gains over `kernel.closest_hit`.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from scenegen.rendering.kernel import gather_row
from scenegen.rendering.packing import SceneBatch

SMALLEST = 1e-20  # a direction's component, so that none is divided by zero


@dataclass(frozen=True, eq=False)
class Blocks:
    """The cubes of a batch on the device; tables are flat floats, row after row.

    Attributes:
        slots: K cubes an image at most.
        count: cubes in each image, (B,).
        frame: linear map of the world into the cubes' frame, where their half edge is 1, (B, 9).
        center: of each cube in that frame, (B K, 3).
    """

    slots: int
    count: Any
    frame: Any
    center: Any


def upload_blocks(batch: SceneBatch) -> Blocks:
    """Bring the cubes of a batch to the device; its variant is in force."""
    # A unit box has bounding radius 1, so half edge 1 / sqrt(3); image b's first cube tells all.
    # An image without cubes has no first one, and reads nothing of what is put in its place.
    first = np.where(batch.object_count > 0, batch.object_scale[:, 0], 1.0)
    scale = np.sqrt(3) / first[:, None, None] ** 2
    frame = np.swapaxes(batch.world_from_object[:, 0, :3, :3], 1, 2) * scale
    center = batch.world_from_object[..., :3, 3] @ np.swapaxes(frame, 1, 2)
    return Blocks(
        slots=batch.spec.object_slots,
        count=mi.UInt32(batch.object_count),
        frame=mi.Float(frame.astype(np.float32).ravel()),
        center=mi.Float(center.astype(np.float32).ravel()),
    )


@dr.syntax
def closest_block(blocks: Blocks, item: Any, o: Any, d: Any) -> Any:
    """Return t, object id (-1 nothing) and unit world normal of the nearest hit of a ray.

    As everywhere in the kernels, -z of the direction is 1 in the camera frame, so t is depth.
    """
    rows = [mi.Vector3f(*row) for row in _rows(gather_row(blocks.frame, item, 9))]
    start: Any = mi.Vector3f(*(dr.dot(row, o) for row in rows))
    along: Any = mi.Vector3f(*(dr.dot(row, d) for row in rows))
    inverse = 1 / dr.select(dr.abs(along) < SMALLEST, SMALLEST, along)
    half = dr.abs(inverse)
    t: Any = mi.Float(dr.inf)
    object_id = mi.Int32(-1)
    k = mi.UInt32(0)
    count = dr.gather(mi.UInt32, blocks.count, item)
    while dr.hint(k < count, exclude=[blocks]):
        to_center = mi.Vector3f(*gather_row(blocks.center, item * blocks.slots + k, 3)) - start
        middle = to_center * inverse
        near, far = dr.max(middle - half), dr.min(middle + half)
        nearer = (near <= far) & (near >= 0) & (near <= t)
        t = dr.select(nearer, near, t)
        object_id = dr.select(nearer, mi.Int32(k) + 1, object_id)
        k += 1
    row = item * blocks.slots + mi.UInt32(dr.maximum(object_id - 1, 0))
    at = mi.Vector3f(dr.abs(start + t * along - mi.Vector3f(*gather_row(blocks.center, row, 3))))
    on_x = (at.x >= at.y) & (at.x >= at.z)
    on_y = ~on_x & (at.y >= at.z)
    face = dr.select(on_x, rows[0], dr.select(on_y, rows[1], rows[2]))
    n = dr.normalize(face)
    n = dr.select(dr.dot(n, d) > 0, -n, n)
    return t, object_id, dr.select(object_id >= 0, n, mi.Vector3f(0))


def _rows(values: list[Any]) -> list[list[Any]]:
    return [values[i : i + 3] for i in range(0, len(values), 3)]

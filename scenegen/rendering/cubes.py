"""A faster ray caster, in Dr.Jit, for images of equal cubes of one orientation: polycubes.

In the cubes' common frame they are all aligned with the axes, so that a ray needs a few operations
for each, and no acceleration structure. `benchmarks/rendering/questions.py` measures the gain over
`rays.closest_hit`.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from scenegen.common.rotations import product
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.tables import gather_row, unit, upload, upload_table

SMALLEST = 1e-20  # least component of a direction, to avoid a division by zero


@dataclass(frozen=True, eq=False)
class Cubes:
    """The cubes of a batch on the device. Tables are from `tables.upload_table`.

    Attributes:
        slots: K, the most cubes an image can have.
        count: number of cubes in each image, (B,).
        frame: linear map from the world to the cubes' frame, where half their edge is 1, (B, 9).
        center: centre of each cube in that frame, (B K, 3).
    """

    slots: int
    count: Any
    frame: Any
    center: Any


def upload_cubes(batch: SceneBatch) -> Cubes:
    """Copy the cubes of a batch to the device of the current Mitsuba variant."""
    # A unit box has bounding radius 1, so half its edge is 1 / sqrt(3). An image's first cube gives
    # the frame of all; for an image without cubes the value does not matter.
    first = np.where(batch.object_count > 0, batch.object_scale[:, 0], 1.0)
    scale = np.sqrt(3) / first[:, None, None] ** 2
    frame = np.swapaxes(batch.world_from_object[:, 0, :3, :3], 1, 2) * scale
    center = product(batch.world_from_object[..., :3, 3], np.swapaxes(frame, 1, 2))
    return Cubes(
        slots=batch.spec.object_slots,
        count=upload(batch.object_count, np.uint32),
        frame=upload_table(frame.reshape(-1, 9)),
        center=upload_table(center),
    )


@dr.syntax
def closest_cube(cubes: Cubes, item: Any, o: Any, d: Any) -> Any:
    """Return t, object id (-1: nothing) and unit world normal of the nearest hit of a ray.

    As in `rays`, directions have -z = 1 in the camera frame, so t is planar depth.
    """
    frame = gather_row(cubes.frame, item, 9)
    rows = [mi.Vector3f(*frame[i : i + 3]) for i in (0, 3, 6)]
    start: Any = mi.Vector3f(*(dr.dot(row, o) for row in rows))
    along: Any = mi.Vector3f(*(dr.dot(row, d) for row in rows))
    inverse = 1 / dr.select(dr.abs(along) < SMALLEST, SMALLEST, along)
    half = dr.abs(inverse)
    t: Any = mi.Float(dr.inf)
    object_id = mi.Int32(-1)
    k = mi.UInt32(0)
    count = dr.gather(mi.UInt32, cubes.count, item)
    while dr.hint(k < count, exclude=[cubes]):
        to_center = mi.Vector3f(*gather_row(cubes.center, item * cubes.slots + k, 3)) - start
        middle = to_center * inverse
        near, far = dr.max(middle - half), dr.min(middle + half)
        nearer = (near <= far) & (near >= 0) & (near <= t)
        t = dr.select(nearer, near, t)
        object_id = dr.select(nearer, mi.Int32(k) + 1, object_id)
        k += 1
    row = item * cubes.slots + mi.UInt32(dr.maximum(object_id - 1, 0))
    at = mi.Vector3f(dr.abs(start + t * along - mi.Vector3f(*gather_row(cubes.center, row, 3))))
    on_x = (at.x >= at.y) & (at.x >= at.z)
    on_y = ~on_x & (at.y >= at.z)
    face = dr.select(on_x, rows[0], dr.select(on_y, rows[1], rows[2]))
    n = unit(face)
    n = dr.select(dr.dot(n, d) > 0, -n, n)
    return t, object_id, dr.select(object_id >= 0, n, mi.Vector3f(0))

"""One ray, in Dr.Jit: its nearest hit, and the normal, shadows and radiance there.

A ray visits the objects of its scene one after another. If it meets an object's bounding sphere, it
is transformed into the object's frame and cast at the unit scene, from the point where it enters
the sphere to the point where it leaves, so that it can hit no other unit shape. The room's three
faces are planes and need no acceleration structure. Ray directions are not normalised: a camera ray
has -z = 1 in the camera frame, so its parameter t is the planar depth of the hit.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from scenegen.rendering.shading import SHADOW_OFFSET
from scenegen.rendering.exact_hits import (
    CAPSULE, CURVED, MESH, POLYHEDRON, TORUS, TURNED, away_from_zero, interval, row_of, torus,
)


@dataclass(frozen=True, eq=False)
class Scenes:
    """The scenes of a batch on the device. Tables are flat arrays of floats, row after row.

    Attributes:
        unit: the Mitsuba scene of unit shapes.
        grid: as in `UnitScene`; if it is not 0, `from_world` leaves out the shift by `place`.
        slots, light_slots: K and L, the most objects and lights a scene can have.
        count: number of objects in each scene, (B,).
        has_room: whether each scene has a room, (B,).
        background: radiance of rays that hit nothing, (B, 3).
        spheres: centre and radius of each object's bounding sphere, (B K, 4); the radius of an
            unused slot is 0.
        from_world: affine map into the unit scene, (B K, 12): three rows of (linear, offset).
        place: position of the object's unit shape in the unit scene, (B K, 3).
        first_triangle: first row of the object's shape in `triangles`, or SPHERE, (B K).
        triangles: face normal and three corner normals of each triangle, (F, 12).
        reflectance: rho by object id, (B (1 + K), 3).
        gloss: Phong's k_s and exponent by object id, (B (1 + K), 2); None if all is matte.
        lights: ambient, k_l, k_q, then position and colour of each light, (B, 5 + 6 L).
    """

    unit: Any
    grid: float
    slots: int
    light_slots: int
    count: Any
    has_room: Any
    background: Any
    spheres: Any
    from_world: Any
    place: Any
    first_triangle: Any
    triangles: Any
    reflectance: Any
    gloss: Any
    lights: Any
    surfaces: Any


def gather_row(table: Any, row: Any, width: int) -> list[Any]:
    """Return the `width` floats of each lane's row, gathered one by one.

    Dr.Jit's packet gathers are no faster here. It chooses them by the address of the data, so the
    kernel would be compiled again from time to time.
    """
    return [dr.gather(mi.Float, table, row * width + i) for i in range(width)]


@dr.syntax
def closest_hit(scenes: Scenes, item: Any, o: Any, d: Any) -> Any:
    """Return t, object id (0: room, -1: nothing), triangle and barycentrics of the nearest hit."""
    walls = [dr.select(d[i] < 0, -o[i] / d[i], dr.inf) for i in range(3)]
    t = dr.minimum(walls[0], dr.minimum(walls[1], walls[2]))
    p = o + t * d
    has_room = dr.gather(mi.Bool, scenes.has_room, item)
    on_room = has_room & (t < dr.inf) & (p.x <= 1) & (p.y <= 1) & (p.z <= 1)
    t = dr.select(on_room, t, dr.inf)
    object_id = dr.select(on_room, mi.Int32(0), mi.Int32(-1))
    triangle = mi.UInt32(0)
    uv = mi.Point2f(0)
    k = mi.UInt32(0)
    count = dr.gather(mi.UInt32, scenes.count, item)
    while dr.hint(k < count, exclude=[scenes]):
        row = item * scenes.slots + k
        near, far, meets = _bounding_interval(scenes, row, o, d)
        near = dr.maximum(near, 0)
        if dr.hint(meets & (near < t) & (near < far), exclude=[scenes]):
            start, along = _to_unit_scene(scenes, row, o + near * d, d)
            length = dr.norm(along)
            u = along / length
            reach = (far - near) * length
            x, face, at = first_hit(scenes, row, start, u, reach)
            hit_t = near + x / length
            nearer = hit_t <= t
            t = dr.select(nearer, hit_t, t)
            object_id = dr.select(nearer, mi.Int32(k) + 1, object_id)
            triangle = dr.select(nearer, face, triangle)
            uv = dr.select(nearer, at, uv)
        k += 1
    return t, object_id, triangle, uv


@dr.syntax
def first_hit(scenes: Scenes, row: Any, start: Any, u: Any, reach: Any) -> Any:
    kind = dr.gather(mi.UInt32, scenes.surfaces.kind, row)
    x = mi.Float(dr.inf)
    face = mi.UInt32(CURVED)
    uv = mi.Point2f(0)
    if dr.hint(MESH in scenes.surfaces.kinds, mode="scalar"):
        if dr.hint(kind == MESH, exclude=[scenes]):
            place = mi.Point3f(*gather_row(scenes.place, row, 3))
            ray = mi.Ray3f(mi.Ray3f(start + place, u), reach)
            hit = scenes.unit.ray_intersect_preliminary(ray, coherent=False)
            x = dr.select(hit.is_valid(), hit.t, dr.inf)
            face = hit.prim_index
            uv = hit.prim_uv
    b = -dr.dot(start, u)
    c = mi.Vector3f(start) + b * u
    first = dr.gather(mi.UInt32, scenes.surfaces.first, row)
    if dr.hint(TORUS in scenes.surfaces.kinds, mode="scalar"):
        if dr.hint(kind == TORUS, exclude=[scenes]):
            ring, tube = row_of(scenes.surfaces, first, 2)
            inverse = 1 / away_from_zero(u.y)
            p = dr.abs(1.05 * tube * inverse)
            mid = -c.y * inverse
            x = b + torus(ring, tube, c, u, dr.maximum(-b, mid - p), dr.minimum(reach - b, mid + p))
    if dr.hint((kind != MESH) & (kind != TORUS), exclude=[scenes]):
        count = dr.gather(mi.UInt32, scenes.surfaces.count, row)
        near, far, near_face, far_face = interval(scenes.surfaces, kind, first, count, c, u)
        outside = near > -b
        x = b + dr.select(outside, near, far)
        face = dr.select(outside, near_face, far_face)
        x = dr.select((near < far) & (x > 0), x, dr.inf)
    return x, face, uv


@dr.syntax
def occluded(scenes: Scenes, item: Any, o: Any, d: Any, active: Any) -> Any:
    """Return whether an object blocks the segment o + t d, 0 < t < 1."""
    blocked = ~active
    k = mi.UInt32(0)
    count = dr.gather(mi.UInt32, scenes.count, item)
    while dr.hint((k < count) & ~blocked, exclude=[scenes]):
        row = item * scenes.slots + k
        near, far, meets = _bounding_interval(scenes, row, o, d)
        near = dr.maximum(near, 0)
        far = dr.minimum(far, 1)
        if dr.hint(meets & (near < far), exclude=[scenes]):
            start, along = _to_unit_scene(scenes, row, o + near * d, d)
            length = dr.norm(along)
            x, _, _ = first_hit(scenes, row, start, along / length, (far - near) * length)
            blocked |= x <= (far - near) * length
        k += 1
    return blocked & active


@dr.syntax
def normal_at(
    scenes: Scenes, item: Any, p: Any, d: Any, object_id: Any, triangle: Any, uv: Any
) -> Any:
    """Return the unit world normal of a hit, facing the viewer; zero if nothing is hit."""
    least = dr.minimum(dr.abs(p.x), dr.minimum(dr.abs(p.y), dr.abs(p.z)))
    on_x = dr.abs(p.x) == least
    on_y = ~on_x & (dr.abs(p.y) == least)
    n = mi.Vector3f(mi.Float(on_x), mi.Float(on_y), mi.Float(~on_x & ~on_y))
    if dr.hint(object_id > 0, exclude=[scenes]):
        row = item * scenes.slots + mi.UInt32(object_id - 1)
        face = mi.Vector3f(0, 1, 0)
        smooth = mi.Vector3f(0, 1, 0)
        kind = dr.gather(mi.UInt32, scenes.surfaces.kind, row)
        if dr.hint(kind == MESH, exclude=[scenes]):
            first = dr.gather(mi.UInt32, scenes.first_triangle, row)
            table = gather_row(scenes.triangles, first + triangle, 12)
            face = mi.Vector3f(*table[:3])
            smooth = (
                (1 - uv.x - uv.y) * mi.Vector3f(*table[3:6])
                + uv.x * mi.Vector3f(*table[6:9])
                + uv.y * mi.Vector3f(*table[9:])
            )
        if dr.hint(kind == POLYHEDRON, exclude=[scenes]):
            face = mi.Vector3f(*row_of(scenes.surfaces, triangle, 3))
            smooth = face
        if dr.hint((kind > POLYHEDRON) & (triangle == CURVED), exclude=[scenes]):
            at, _ = _to_unit_scene(scenes, row, p, d)
            first = dr.gather(mi.UInt32, scenes.surfaces.first, row)
            a0, b0, c0 = row_of(scenes.surfaces, first, 3)
            y = dr.select(kind == TURNED, -0.5 * b0 - c0 * at.y, at.y)
            y = dr.select(kind == CAPSULE, at.y - dr.clip(at.y, -a0, a0), y)
            m = dr.select(kind == TORUS, 1 - a0 * dr.rsqrt(at.x * at.x + at.z * at.z), 1)
            face = mi.Vector3f(at.x * m, y, at.z * m)
            smooth = face
        n = dr.normalize(_to_world(scenes, row, smooth))
        n = dr.select(dr.dot(_to_world(scenes, row, face), d) > 0, -n, n)
        # A smooth normal may lean away just inside a silhouette: make it perpendicular to the ray.
        away = dr.dot(n, d)
        n = dr.select(away > 0, dr.normalize(n - away / dr.dot(d, d) * d), n)
    return dr.select(object_id >= 0, n, mi.Vector3f(0))


def radiance_at(
    scenes: Scenes, item: Any, p: Any, d: Any, n: Any, object_id: Any, shadows: bool
) -> Any:
    """Return the radiance of a hit by the shading equation (`shading.shade`), or the background."""
    record = gather_row(scenes.lights, item, 5 + 6 * scenes.light_slots)
    row = item * (1 + scenes.slots) + mi.UInt32(dr.maximum(object_id, 0))
    total, shine = mi.Vector3f(*record[:3]), mi.Vector3f(0)
    if scenes.gloss is not None:
        specular, shininess = gather_row(scenes.gloss, row, 2)
        mirrored = dr.normalize(d - 2 * dr.dot(d, n) * n)  # the viewing ray, mirrored
    for j in range(scenes.light_slots):
        light = record[5 + 6 * j : 11 + 6 * j]
        to_light = mi.Vector3f(*light[:3]) - p
        distance = dr.norm(to_light)
        cosine = dr.maximum(dr.dot(n, to_light) / distance, 0)
        falloff = (record[3] + record[4] * distance) * distance
        amount = dr.select(distance > 0, cosine / falloff, 0)
        if shadows:
            start = p + SHADOW_OFFSET * n
            amount = dr.select(occluded(scenes, item, start, to_light, cosine > 0), 0, amount)
        total += amount * mi.Vector3f(*light[3:])
        if scenes.gloss is not None:
            toward = dr.maximum(dr.dot(mirrored, to_light) / distance, 0)
            lobe = dr.select(amount > 0, specular * dr.power(toward, shininess) / falloff, 0)
            shine += lobe * mi.Vector3f(*light[3:])
    rho = mi.Vector3f(*gather_row(scenes.reflectance, row, 3))
    background = mi.Vector3f(*gather_row(scenes.background, item, 3))
    return dr.select(object_id >= 0, rho * total + shine, background)


def _bounding_interval(scenes: Scenes, row: Any, o: Any, d: Any) -> tuple[Any, Any, Any]:
    """Return the ray parameters where it enters and leaves the bounding sphere, and if it does."""
    x, y, z, radius = gather_row(scenes.spheres, row, 4)
    to_center = mi.Vector3f(x, y, z) - o
    squared = dr.dot(d, d)
    middle = dr.dot(to_center, d) / squared
    miss = to_center - middle * d
    radius = radius * 1.0001  # so that rounding cannot cut a surface that touches the sphere
    inside = radius * radius - dr.dot(miss, miss)
    half = dr.sqrt(dr.maximum(inside, 0) / squared)
    return middle - half, middle + half, inside > 0


def _to_unit_scene(scenes: Scenes, row: Any, p: Any, d: Any) -> tuple[Any, Any]:
    table = gather_row(scenes.from_world, row, 12)
    linear = [mi.Vector3f(*table[i : i + 3]) for i in (0, 4, 8)]
    point = mi.Point3f(*(dr.dot(linear[i], p) + table[4 * i + 3] for i in range(3)))
    return point, mi.Vector3f(*(dr.dot(linear[i], d) for i in range(3)))


def _to_world(scenes: Scenes, row: Any, n: Any) -> Any:
    """Return a normal in the world frame, not normalised.

    `from_world` is a similarity, so its transpose turns a normal back.
    """
    table = gather_row(scenes.from_world, row, 12)
    return sum((n[i] * mi.Vector3f(*table[4 * i : 4 * i + 3]) for i in range(3)), mi.Vector3f(0))

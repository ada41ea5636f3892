"""One ray, in Dr.Jit: its nearest hit, and the normal, shadows and radiance there.

A ray visits the objects of its scene one after another. If it meets an object's bounding sphere, it
is transformed into the object's frame and cast at the exact surface there, or at a mesh in the unit
scene, from the point where it enters the sphere to the point where it leaves, so that it can hit no
other unit shape. The room's three faces are planes and need no acceleration structure. Ray
directions are not normalised: a camera ray has -z = 1 in the camera frame, so its parameter t is
the planar depth of the hit.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from scenegen.rendering.meshes.rasteriser import edge_plane
from scenegen.rendering.shading import SHADOW_OFFSET
from scenegen.rendering.surfaces.in_kernel import (
    MESH,
    Surfaces,
    first_on_surface,
    normal_on_surface,
)
from scenegen.rendering.tables import PACKET, gather_packet, gather_row, unit

MOST_NEIGHBOURS = 4  # triangles that are looked at for one hit
OBJECT = 6  # packets of an object's row
BEFORE_LIGHTS = 11  # floats of a scene's row


@dataclass(frozen=True, eq=False)
class Scenes:
    """The scenes of a batch on the device. Tables are from `tables.upload_table`.

    Attributes:
        unit: the Mitsuba scene of those unit shapes that are meshes.
        grid: as in `UnitScene`.
        slots, light_slots: K and L, the most objects and lights a scene can have.
        surfaces: the exact surfaces of the other shapes.
        normals, corners: of the triangles of those meshes, as in `UnitScene`; None where they only
            cast shadows.
        objects: of each slot, (B K, 24): bounding sphere (centre, radius, which is 0 if the slot is
            unused); three rows of the affine map into the unit shape's frame (linear, offset);
            `Surfaces.record` and an unused float; position in the unit scene and first row in
            `normals` and `corners`.
        scenes: of each scene, (B, 11 + 6 L): ambient, k_l, k_q, whether it has a room, number of
            objects, an unused float, radiance of rays that hit nothing; then position and colour
            of each light.
        materials: by object id, (B (1 + K), 3): rho; or with Phong's k_s and exponent, (.., 5).
        glossy: whether they have these.
    """

    unit: Any
    grid: float
    slots: int
    light_slots: int
    surfaces: Surfaces
    normals: Any
    corners: Any
    objects: Any
    scenes: Any
    materials: Any
    glossy: bool


@dr.syntax
def closest_hit(scenes: Scenes, item: Any, o: Any, d: Any) -> Any:
    """Return t, object id (0: room, -1: nothing), face and barycentrics of the nearest hit.

    The face is a triangle of a mesh, or what `surfaces.in_kernel` calls a face.
    """
    count = _about_scene(scenes, item)[1]
    nothing = (mi.Float(dr.inf), mi.UInt32(0), mi.UInt32(0), mi.Point2f(0))
    t, object_id, face, uv = nearer_than_room(scenes, item, o, d, nothing)
    k = mi.UInt32(0)
    while dr.hint(k < count, exclude=[scenes]):
        row = item * scenes.slots + k
        near, far, meets = _bounding_interval(scenes, row, o, d)
        near = dr.maximum(near, 0)
        if dr.hint(meets & (near < t) & (near < far), exclude=[scenes]):
            start, along = _to_object(scenes, row, o + near * d, d)
            length = dr.norm(along)
            reach = (far - near) * length
            distance, its_face, its_uv = _first_hit(scenes, row, start, along / length, reach)
            hit_t = near + distance / length
            nearer = (distance <= reach) & (hit_t <= t)
            t = dr.select(nearer, hit_t, t)
            object_id = dr.select(nearer, mi.Int32(k) + 1, object_id)
            face = dr.select(nearer, its_face, face)
            uv = dr.select(nearer, its_uv, uv)
        k += 1
    return t, object_id, face, uv


def nearer_than_room(scenes: Scenes, item: Any, o: Any, d: Any, hit: Any) -> Any:
    """Return t, object id and details of the nearer of a hit and the room's faces.

    A hit is (t, slot of the object, *details), with t = inf for none. Details say nothing where the
    room is nearer.
    """
    depth, slot, *details = hit
    has_room = _about_scene(scenes, item)[0]
    walls = [dr.select(d[i] < 0, -o[i] / d[i], dr.inf) for i in range(3)]
    t = dr.minimum(walls[0], dr.minimum(walls[1], walls[2]))
    p = o + t * d
    on_room = has_room & (t < dr.inf) & (p.x <= 1) & (p.y <= 1) & (p.z <= 1)
    t = dr.select(on_room, t, dr.inf)
    object_id = dr.select(on_room, mi.Int32(0), mi.Int32(-1))
    on_object = (depth < dr.inf) & (depth <= t)
    object_id = dr.select(on_object, mi.Int32(slot) + 1, object_id)
    return dr.select(on_object, depth, t), object_id, *details


@dr.syntax
def occluded(scenes: Scenes, item: Any, o: Any, d: Any, active: Any) -> Any:
    """Return whether an object blocks the segment o + t d, 0 < t < 1."""
    blocked = ~active
    k = mi.UInt32(0)
    count = _about_scene(scenes, item)[1]
    while dr.hint((k < count) & ~blocked, exclude=[scenes]):
        row = item * scenes.slots + k
        near, far, meets = _bounding_interval(scenes, row, o, d)
        near = dr.maximum(near, 0)
        far = dr.minimum(far, 1)
        if dr.hint(meets & (near < far), exclude=[scenes]):
            start, along = _to_object(scenes, row, o + near * d, d)
            length = dr.norm(along)
            reach = (far - near) * length
            blocked |= _first_hit(scenes, row, start, along / length, reach)[0] <= reach
        k += 1
    return blocked & active


@dr.syntax
def _first_hit(scenes: Scenes, row: Any, start: Any, u: Any, reach: Any) -> tuple[Any, Any, Any]:
    """Return distance of the hit from `start` (inf for none), face and barycentrics."""
    record = gather_packet(scenes.objects, row * OBJECT + 4)
    distance, face = first_on_surface(scenes.surfaces, record, start, u, reach)
    uv = mi.Point2f(0)
    if dr.hint(MESH in scenes.surfaces.kinds, mode="scalar"):  # noqa: SIM102
        if dr.hint(record[0] == MESH, exclude=[scenes]):
            place = gather_packet(scenes.objects, row * OBJECT + 5)
            if dr.hint(scenes.grid > 0, mode="scalar"):
                start = dr.round(start / scenes.grid) * scenes.grid
            origin = mi.Point3f(start.x + place.x, start.y + place.y, start.z + place.z)
            ray = mi.Ray3f(mi.Ray3f(origin, u), reach)
            hit = scenes.unit.ray_intersect_preliminary(ray, coherent=False)
            distance = dr.select(hit.is_valid(), hit.t, dr.inf)
            face = hit.prim_index
            uv = hit.prim_uv
            if dr.hint(scenes.corners is not None, mode="scalar"):  # noqa: SIM102
                if dr.hint(hit.is_valid(), exclude=[scenes]):
                    distance, face, uv = _exact_hit(scenes, mi.UInt32(place[3]), face, start, u)
    return distance, face, uv


@dr.syntax
def _exact_hit(scenes: Scenes, first: Any, face: Any, o: Any, u: Any) -> Any:
    """Return distance (inf for none), triangle and barycentrics of a hit that Embree found.

    Embree chooses its instructions by processor, and they round differently. So it only says near
    which triangle the ray passes. Where it passes outside, within the overlap of neighbours, the
    hit is on the neighbour.
    """
    distance = mi.Float(dr.inf)
    uv = mi.Point2f(0)
    tries = mi.UInt32(MOST_NEIGHBOURS)
    while dr.hint(tries > 0, exclude=[scenes]):
        row = gather_row(scenes.corners, first + face, 12)
        a, b, c = (mi.Vector3f(*row[i : i + 3]) - mi.Vector3f(*o) for i in (0, 3, 6))
        planes = [edge_plane(b, c), edge_plane(c, a), edge_plane(a, b)]
        sides = mi.Vector3f(*(dr.dot(plane, u) for plane in planes))
        total = sides.x + sides.y + sides.z
        sides = dr.select(total < 0, -sides, sides)
        least = dr.min(sides)
        inside = (least >= 0) & (total != 0)
        normal = dr.cross(b - a, c - a)
        x = dr.dot(a, normal) / dr.dot(u, normal)
        from_a = x * mi.Vector3f(*u) - a
        v = dr.dot(dr.cross(from_a, c - a), normal) / dr.dot(normal, normal)
        w = dr.dot(dr.cross(b - a, from_a), normal) / dr.dot(normal, normal)
        distance = dr.select(inside, x, dr.inf)
        uv = dr.select(inside, mi.Point2f(v, w), 0)
        beyond = dr.select(sides.x == least, row[9], dr.select(sides.y == least, row[10], row[11]))
        face = dr.select(inside, face, mi.UInt32(beyond))
        tries = dr.select(inside, 0, tries - 1)
    return distance, face, uv


@dr.syntax
def normals_at(
    scenes: Scenes, item: Any, p: Any, d: Any, object_id: Any, face: Any, uv: Any
) -> tuple[Any, Any]:
    """Return what `visible_normal` takes, for an object's hit."""
    flat = mi.Vector3f(0)
    smooth = mi.Vector3f(0)
    if dr.hint(object_id > 0, exclude=[scenes]):
        row = item * scenes.slots + mi.UInt32(object_id - 1)
        record = gather_packet(scenes.objects, row * OBJECT + 4)
        at, _ = _to_object(scenes, row, p, d)
        smooth = normal_on_surface(scenes.surfaces, record, at, face)
        flat = mi.Vector3f(smooth)
        if dr.hint(MESH in scenes.surfaces.kinds, mode="scalar"):  # noqa: SIM102
            if dr.hint(record[0] == MESH, exclude=[scenes]):
                first = mi.UInt32(gather_packet(scenes.objects, row * OBJECT + 5)[3])
                table = gather_row(scenes.normals, first + face, 12)
                flat = mi.Vector3f(*table[:3])
                smooth = (
                    (1 - uv.x - uv.y) * mi.Vector3f(*table[3:6])
                    + uv.x * mi.Vector3f(*table[6:9])
                    + uv.y * mi.Vector3f(*table[9:])
                )
    return flat, smooth


@dr.syntax
def visible_normal(
    scenes: Scenes, item: Any, p: Any, d: Any, object_id: Any, normals: tuple[Any, Any]
) -> Any:
    """Return the unit world normal of a hit, facing the viewer; zero if nothing is hit.

    `normals` are that of the face and that of the smooth surface, in the frame of the unit shape,
    not normalised.
    """
    flat, smooth = normals
    least = dr.minimum(dr.abs(p.x), dr.minimum(dr.abs(p.y), dr.abs(p.z)))
    on_x = dr.abs(p.x) == least
    on_y = ~on_x & (dr.abs(p.y) == least)
    n = mi.Vector3f(mi.Float(on_x), mi.Float(on_y), mi.Float(~on_x & ~on_y))
    if dr.hint(object_id > 0, exclude=[scenes]):
        row = item * scenes.slots + mi.UInt32(object_id - 1)
        n = unit(_to_world(scenes, row, smooth))
        n = dr.select(dr.dot(_to_world(scenes, row, flat), d) > 0, -n, n)
        # A smooth normal may lean away just inside a silhouette: make it perpendicular to the ray.
        away = dr.dot(n, d)
        n = dr.select(away > 0, unit(n - away / dr.dot(d, d) * d), n)
    return dr.select(object_id >= 0, n, mi.Vector3f(0))


def reflectance_at(scenes: Scenes, item: Any, object_id: Any) -> Any:
    """Return rho of the room or the object of a hit."""
    row = item * (1 + scenes.slots) + mi.UInt32(dr.maximum(object_id, 0))
    return mi.Vector3f(*gather_row(scenes.materials, row, 5 if scenes.glossy else 3)[:3])


def radiance_at(
    scenes: Scenes,
    item: Any,
    p: Any,
    d: Any,
    n: Any,
    object_id: Any,
    shadows: bool,
    tint: Any = None,
) -> Any:
    """Return the radiance of a hit by the shading equation (`shading.shade`), or the background.

    `tint` is a factor of rho, or None.
    """
    record = gather_row(scenes.scenes, item, BEFORE_LIGHTS + 6 * scenes.light_slots)
    row = item * (1 + scenes.slots) + mi.UInt32(dr.maximum(object_id, 0))
    total, shine = mi.Vector3f(*record[:3]), mi.Vector3f(0)
    material = gather_row(scenes.materials, row, 5 if scenes.glossy else 3)
    if scenes.glossy:
        specular, shininess = material[3:]
        mirrored = unit(d - 2 * dr.dot(d, n) * n)  # the viewing ray, mirrored
    for j in range(scenes.light_slots):
        light = record[BEFORE_LIGHTS + 6 * j :][:6]
        to_light = mi.Vector3f(*light[:3]) - p
        distance = dr.norm(to_light)
        cosine = dr.maximum(dr.dot(n, to_light) / distance, 0)
        falloff = (record[3] + record[4] * distance) * distance
        amount = dr.select(distance > 0, cosine / falloff, 0)
        if shadows:
            start = p + SHADOW_OFFSET * n
            amount = dr.select(occluded(scenes, item, start, to_light, cosine > 0), 0, amount)
        total += amount * mi.Vector3f(*light[3:])
        if scenes.glossy:
            toward = dr.maximum(dr.dot(mirrored, to_light) / distance, 0)
            lobe = dr.select(amount > 0, specular * dr.power(toward, shininess) / falloff, 0)
            shine += lobe * mi.Vector3f(*light[3:])
    rho, background = mi.Vector3f(*material[:3]), mi.Vector3f(*record[8:BEFORE_LIGHTS])
    if tint is not None:
        rho = rho * tint
    return dr.select(object_id >= 0, rho * total + shine, background)


def _about_scene(scenes: Scenes, item: Any) -> tuple[Any, Any]:
    """Return whether a scene has a room, and its number of objects."""
    packets = -(-(BEFORE_LIGHTS + 6 * scenes.light_slots) // PACKET)
    packet = gather_packet(scenes.scenes, item * packets + 1)
    return packet[1] > 0, mi.UInt32(packet[2])


def _bounding_interval(scenes: Scenes, row: Any, o: Any, d: Any) -> tuple[Any, Any, Any]:
    """Return where a ray enters and leaves the bounding sphere, and whether it meets it."""
    x, y, z, radius = gather_packet(scenes.objects, row * OBJECT)
    to_center = mi.Vector3f(x, y, z) - o
    squared = dr.dot(d, d)
    middle = dr.dot(to_center, d) / squared
    miss = to_center - middle * d
    radius = radius * 1.0001  # so that rounding cannot cut a surface that touches the sphere
    inside = radius * radius - dr.dot(miss, miss)
    half = dr.sqrt(dr.maximum(inside, 0) / squared)
    return middle - half, middle + half, inside > 0


def _to_object(scenes: Scenes, row: Any, p: Any, d: Any) -> tuple[Any, Any]:
    """Return a point and a direction in the frame of an object's unit shape."""
    table = [gather_packet(scenes.objects, row * OBJECT + 1 + i) for i in range(3)]
    linear = [mi.Vector3f(axis.x, axis.y, axis.z) for axis in table]
    point = mi.Point3f(*(dr.dot(linear[i], p) + table[i].w for i in range(3)))
    return point, mi.Vector3f(*(dr.dot(linear[i], d) for i in range(3)))


def _to_world(scenes: Scenes, row: Any, n: Any) -> Any:
    """Return a normal in the world frame, not normalised.

    The map into the unit shape's frame is a similarity, so its transpose turns a normal back.
    """
    table = [gather_packet(scenes.objects, row * OBJECT + 1 + i) for i in range(3)]
    parts = (mi.Vector3f(axis.x, axis.y, axis.z) * n[i] for i, axis in enumerate(table))
    return sum(parts, mi.Vector3f(0))

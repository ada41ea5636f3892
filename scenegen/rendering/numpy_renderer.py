"""A slow renderer in plain numpy that only needs a function that casts rays at unit shapes.

It has two uses: the fallback without LLVM, where Mitsuba's scalar variant casts the rays, and an
independent check of the fast path (`drjit_renderer`) with any other ray caster. It renders one
image at a time in float64.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_directions
from scenegen.objects.solids import UnitShape
from scenegen.rendering.ground_truth import GroundTruth, encode_image
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.pixel_samples import sample_positions
from scenegen.rendering.shading import SHADOW_OFFSET, shade

Array = NDArray[Any]

# (object's name, origins (R, 3), directions (R, 3)) -> ray parameters (R,), inf where nothing is
# hit, and normals (R, 3), all in the unit shape's frame. Directions need not be unit vectors; the
# normals are the smooth surface's and face the ray's origin.
Cast = Callable[[str, Array, Array], tuple[Array, Array]]


def render_in_numpy(batch: SceneBatch, cast: Cast) -> GroundTruth:
    """Render a batch, image by image."""
    images = [_render_one(batch, b, cast) for b in range(len(batch))]
    return GroundTruth(*(np.stack(parts) for parts in zip(*images, strict=True)))


def _render_one(batch: SceneBatch, b: int, cast: Cast) -> tuple[Array, Array, Array, Array]:
    spec = batch.spec
    world_from_camera = batch.world_from_camera[b]
    directions = pixel_directions(spec.height, spec.width, batch.lens(b))
    grid = batch.lens(b).grid(spec.height, spec.width)
    origin = world_from_camera[:3, 3]

    def look(x: float, y: float) -> tuple[Array, Array, Array, Array]:
        """Return radiance, depth, world normal and object id at the point (x, y) of every pixel."""
        local = directions + np.array([(x - 0.5) * grid.across, (0.5 - y) * grid.down, 0.0])
        rays = local.reshape(-1, 3) @ world_from_camera[:3, :3].T
        t, normal, object_id = _closest(batch, b, origin, rays, cast)
        hit = object_id >= 0
        points = origin + np.where(hit, t, 0.0)[:, None] * rays
        radiance = _shade(batch, b, points, normal, object_id, cast)
        radiance = np.where(hit[:, None], radiance, batch.background[b])
        return radiance, np.where(hit, t, np.nan), normal, object_id

    radiance, depth, world_normals, object_ids = look(0.5, 0.5)
    total = radiance
    if spec.spp > 1:
        total = sum((look(x, y)[0] for x, y in sample_positions(spec.spp)), 0 * radiance)
    normals = world_normals @ world_from_camera[:3, :3]
    shape = (spec.height, spec.width)
    return (
        encode_image((total / spec.spp).reshape(*shape, 3), spec.image_dtype),
        depth.reshape(shape).astype(np.float32),
        normals.reshape(*shape, 3).astype(np.float32),
        object_ids.reshape(shape).astype(np.int8),
    )


def _closest(
    batch: SceneBatch, b: int, origin: Array, rays: Array, cast: Cast
) -> tuple[Array, Array, Array]:
    """Return ray parameter, world normal and object id of the nearest hit of each ray, (R, 3)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        walls = np.where(rays < 0, -origin / rays, np.inf)
    axis = walls.argmin(axis=1)
    t = walls.min(axis=1)
    inside = np.isfinite(t) & bool(batch.has_room[b])
    inside[inside] = (origin + t[inside, None] * rays[inside] <= 1.0).all(axis=1)
    t = np.where(inside, t, np.inf)
    normal = np.where(inside[:, None], np.eye(3)[axis], 0.0)
    object_id = np.where(inside, 0, -1)
    for k in range(int(batch.object_count[b])):
        name = batch.names[batch.shape[b, k]]
        origins = np.broadcast_to(origin, rays.shape)
        start, along, meets = _to_object_frame(batch, b, k, origins, rays)
        distance, local_normal = cast(name, start[meets], along[meets])
        nearer = np.zeros(len(rays), bool)
        nearer[meets] = np.isfinite(distance) & (distance <= t[meets])
        taken = nearer[meets]
        t[nearer] = distance[taken]
        rotation = batch.world_from_object[b, k, :3, :3] / batch.object_scale[b, k]
        normal[nearer] = local_normal[taken] @ rotation.T
        object_id[nearer] = k + 1
    return t, normal, object_id


def _shade(
    batch: SceneBatch, b: int, points: Array, normal: Array, object_id: Array, cast: Cast
) -> Array:
    light_count = int(batch.light_count[b])
    positions, colors = batch.light_position[b, :light_count], batch.light_color[b, :light_count]
    material = np.maximum(object_id, 0)
    specular, shininess = batch.gloss[b, material].T
    viewpoint = batch.world_from_camera[b, :3, 3] if batch.spec.specular[1] > 0 else None
    looks = (batch.attenuation[b], specular, shininess, viewpoint)

    def lit(positions: Array, colors: Array, ambient: Array) -> Array:
        rho = batch.reflectance[b, material]
        return shade(points, normal, rho, positions, colors, ambient, *looks)

    ambient = batch.ambient[b]
    if not batch.spec.shadows:
        return lit(positions, colors, ambient)
    dark = np.zeros((0, 3))
    total = lit(dark, dark, ambient)
    for position, color in zip(positions, colors, strict=True):
        start = points + SHADOW_OFFSET * normal
        seen = ~_occluded(batch, b, start, position - points, cast)
        total += np.where(seen[:, None], lit(position[None], color[None], 0 * ambient), 0.0)
    return total


def _occluded(batch: SceneBatch, b: int, start: Array, to_light: Array, cast: Cast) -> Array:
    blocked = np.zeros(len(start), bool)
    for k in range(int(batch.object_count[b])):
        name = batch.names[batch.shape[b, k]]
        local, along, meets = _to_object_frame(batch, b, k, start, to_light)
        distance, _ = cast(name, local[meets], along[meets])
        blocked[meets] |= (distance > 0) & (distance < 1)
    return blocked


def _to_object_frame(
    batch: SceneBatch, b: int, k: int, origins: Array, rays: Array
) -> tuple[Array, Array, Array]:
    """Return rays in the object's frame, and a mask of those that meet its bounding sphere."""
    world_from_object = batch.world_from_object[b, k]
    linear = world_from_object[:3, :3].T / batch.object_scale[b, k] ** 2
    start = (origins - world_from_object[:3, 3]) @ linear.T
    along = rays @ linear.T
    middle = -np.einsum("ri,ri->r", start, along) / np.einsum("ri,ri->r", along, along)
    miss = start + middle[:, None] * along
    return start, along, np.einsum("ri,ri->r", miss, miss) < 1.0002


def smooth_normals(
    shape: UnitShape, triangle: Array, u: Array, v: Array, directions: Array
) -> Array:
    """Return unit normals at points of triangles, turned towards the viewer, (R, 3).

    Args:
        triangle: index of each ray's triangle, (R,).
        u, v: barycentric coordinates, (R,): the point is (1 - u - v) a + u b + v c.
        directions: of the rays, (R, 3), in the unit shape's frame.
    """
    corners, normals = shape.triangles[triangle], shape.normals[triangle]
    weights = np.stack([1 - u - v, u, v], axis=1)
    n = np.einsum("rk,rki->ri", weights, normals)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n[np.einsum("ri,ri->r", face, directions) > 0] *= -1
    return face_viewer(n, directions)


def face_viewer(normals: Array, directions: Array) -> Array:
    """Return unit normals, those that lean away from the viewer made perpendicular to their rays.

    Smooth normals lean away just inside a silhouette.
    """
    away = np.einsum("ri,ri->r", normals, directions)
    squared = np.einsum("ri,ri->r", directions, directions)
    across = normals - (np.maximum(away, 0.0) / squared)[:, None] * directions
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))

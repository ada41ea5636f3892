"""What camera rays meet first among meshes, by rasterising: one thread a triangle, no tree.

A ray through the centre of a pixel meets a mesh where a triangle covers the centre. So each
triangle visits the pixels of its bounding rectangle, and leaves its depth and number where it is
nearer than what is there. All is computed in the camera frame, where rays start at the origin.
In a panorama, the rectangle is that of the cap of the sphere around the triangle.

A pixel is inside a triangle if it is on the same side of the three planes through the origin and
an edge. The plane of an edge is computed from its two ends in an order of their own, so neighbours
that share the edge get the same numbers with opposite signs. The test includes the edge itself:
no ray slips between neighbours. J. Pineda (SIGGRAPH 1988) has edge functions; M. Olano and
T. Greer (Graphics Hardware 1997) have them for rays from the origin, without clipping.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Grid
from scenegen.common.rotations import product
from scenegen.objects.solids import Mesh
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.tables import (
    gather_packet,
    gather_row,
    unit,
    upload,
    upload_rows,
    upload_table,
)

Array = NDArray[Any]
NOTHING = 0xFFFFFFFF_FFFFFFFF  # the key of a pixel that no triangle covers
SLACK = 0.01  # pixels by which bounding rectangles grow, as corners are rounded
CHUNK = 24  # pixels that a thread visits at most; larger triangles take several threads
NO_NORMALS = np.zeros((0, 3), np.float32)
NEAR = 1e-3  # scene units; no ray meets a triangle nearer where it reaches behind the camera
CUT_SLACK = 2.0  # pixels by which rectangles of such triangles grow
BEHIND = 1e-6  # a corner nearer to the camera's plane than this has no place in the picture


@dataclass(frozen=True, eq=False)
class Triangles:
    """All triangles of a batch on the device: threads in the order of image, object, triangle.

    Tables are from `tables.upload_table`. A draw is an object in an image.

    Attributes:
        images, height, width: of the batch.
        middle, aspect: principal point, pixels, and width of a pixel over its height.
        rays: of an image, padded to whole SIMD packets.
        count: number of threads.
        vertices: of all models, in the frames of their unit shapes, (V, 3).
        faces: three vertices of each triangle, counted in its model, uint32 in packets of four.
        normals: at the vertices of smooth models, (N, 3); before them a row for no vertex.
        draw: of each thread, its draw.
        placed: of each draw, (D, 13): rows of camera_from_object, and the height of a pixel.
        directions: of the pixels of panoramas, (H W, 3); None for other images.
        starts: of each draw, uint32 in packets of four: number of its image; of a triangle in
            `faces` minus its thread's, modulo 2^32; of its model's first row in `vertices` and in
            `normals`, which is 0 if it is flat.
        slot: of each draw, uint32.
    """

    images: int
    height: int
    width: int
    middle: tuple[float, float]
    aspect: float
    rays: int
    count: int
    vertices: Any
    faces: Any
    normals: Any
    draw: Any
    placed: Any
    directions: Any
    starts: Any
    slot: Any


def _unsheared(world_from_camera: Array) -> Array:
    """Return the inverses, (B, 3, 3), of rotations, or of such whose third column is sheared.

    Those of rotations are the transposed, to the bit.
    """
    right, up, sheared = np.moveaxis(world_from_camera, 2, 0)
    aside = [(axis * sheared).sum(axis=1, keepdims=True) for axis in (right, up)]
    across, above = (np.where(np.abs(value) < 1e-9, 0.0, value) for value in aside)
    back = sheared - across * right - above * up
    return np.stack([right - across * back, up - above * back, back], axis=1)


def upload_triangles(batch: SceneBatch, meshes: Sequence[Mesh], rays: int) -> Triangles:
    """Copy the meshes of a batch, as from `cast_mesh` for each of its names, to the device."""
    spec = batch.spec
    sizes = np.array([len(mesh.faces) for mesh in meshes], np.int64)
    faces, first_face = upload_rows([mesh.faces for mesh in meshes], np.uint32)
    vertices, first_vertex = upload_rows([mesh.vertices for mesh in meshes])
    smooth = [NO_NORMALS if mesh.normals is None else mesh.normals for mesh in meshes]
    normals, first_normal = upload_rows([np.zeros((1, 3)), *smooth])
    first_normal = np.where([len(table) > 0 for table in smooth], first_normal[1:], 0)
    image, slot = np.nonzero(batch.shape >= 0)
    model = batch.shape[image, slot]
    threads = sizes[model]
    first_thread = np.cumsum(threads) - threads
    turn = _unsheared(batch.world_from_camera[:, :3, :3])
    moved = -product(turn, batch.world_from_camera[:, :3, 3:])
    camera_from_world = np.concatenate([turn, moved], axis=2)
    placed = np.zeros((max(1, len(model)), 13))
    moved = product(camera_from_world[image], batch.world_from_object[image, slot])
    placed[: len(model), :12] = moved.reshape(-1, 12)
    placed[: len(model), 12] = batch.pixel_heights[image]
    directions = batch.directions

    shift = (first_face[model] - first_thread) % 2**32
    starts = np.stack([image, shift, first_vertex[model], first_normal[model]], axis=1)
    return Triangles(
        images=len(batch),
        height=spec.height,
        width=spec.width,
        middle=spec.middle,
        aspect=spec.pixel_aspect,
        rays=rays,
        count=int(threads.sum()),
        vertices=vertices,
        faces=faces,
        normals=normals,
        draw=upload(np.repeat(np.arange(len(model)), threads), np.uint32),
        placed=upload_table(placed),
        directions=None if directions is None else upload_table(directions),
        starts=upload_rows([starts], np.uint32)[0],
        slot=upload(slot, np.uint32),
    )


def rasterise(triangles: Triangles, x: Any, y: Any) -> Any:
    """Return the key of the nearest triangle at the point (x, y) of each pixel, uint64.

    The upper half of a key are the bits of the depth, the lower half is the thread of the triangle.
    So the least key is the nearest triangle, the first of several at the same depth.
    """
    keys = dr.full(_key(), NOTHING, triangles.images * triangles.rays)
    if not triangles.count:
        return keys
    thread = dr.arange(mi.UInt32, triangles.count)
    area = _cover(triangles, keys, thread, mi.UInt32(0), x, y)
    dr.eval(keys, area)
    large: Any = dr.compress(area > CHUNK)
    if dr.width(large):
        more = -(-dr.gather(mi.UInt32, area, large).numpy().astype(np.int64) // CHUNK) - 1
        rest = np.repeat(large.numpy(), more)
        chunk = 1 + np.arange(len(rest)) - np.repeat(np.cumsum(more) - more, more)
        threads, start = upload(rest, np.uint32), upload(chunk * CHUNK, np.uint32)
        dr.eval(keys, _cover(triangles, keys, threads, start, x, y))
    return keys


def _key() -> Any:
    """Return the type of keys, of the current variant."""
    return dr.uint64_array_t(mi.Float)


@dr.syntax
def _cover(triangles: Triangles, keys: Any, thread: Any, start: Any, x: Any, y: Any) -> Any:
    """Let triangles write their keys to CHUNK pixels of their rectangles, from number `start` on.

    Returns the number of pixels of each rectangle.
    """
    draw = dr.gather(mi.UInt32, triangles.draw, thread)
    image = dr.gather(mi.Vector4u, triangles.starts, draw).x
    a, b, c, grid = _in_camera(triangles, draw, _corners(triangles, thread, draw)[0])
    middle = _middle(triangles, a, b, c)
    left, top, columns, rows = _pixels(triangles, a, b, c, grid, middle, x, y)
    area = mi.UInt32(columns * rows)
    planes = [edge_plane(b, c), edge_plane(c, a), edge_plane(a, b)]
    normal = dr.cross(b - a, c - a)
    above = dr.dot(a, normal)
    p, q, r = [_ahead(corner, middle) for corner in (a, b, c)]
    nearest = dr.minimum(p, dr.minimum(q, r))
    farthest = dr.maximum(p, dr.maximum(q, r))
    i = mi.UInt32(start)
    end = dr.minimum(area, start + CHUNK)
    row = mi.Int32(start) // dr.maximum(columns, 1)
    column = mi.Int32(start) - row * columns
    while dr.hint(i < end, exclude=[triangles, keys, grid, middle]):
        ray = ray_of(triangles, grid, left + column, top + row, x, y)
        sides = [_dot(ray, n) for n in planes]
        inside = ((sides[0] >= 0) & (sides[1] >= 0) & (sides[2] >= 0)) | (
            (sides[0] <= 0) & (sides[1] <= 0) & (sides[2] <= 0)
        )
        depth = _between(above / _dot(ray, normal), ray, middle, nearest, farthest)
        key = _key()(dr.reinterpret_array(mi.UInt32, depth)) << 32 | _key()(thread)
        pixel = image * triangles.rays + _number(triangles, left + column, top + row)
        active = inside & (depth > 0) & (depth < dr.inf)
        dr.scatter_reduce(dr.ReduceOp.Min, keys, key, pixel, active, mode=dr.ReduceMode.Direct)
        column += 1
        wraps = column == columns
        row = dr.select(wraps, row + 1, row)
        column = dr.select(wraps, 0, column)
        i += 1
    return area


def ray_of(triangles: Triangles, grid: Grid, column: Any, row: Any, x: Any, y: Any) -> Any:
    """Return the components of the ray through the point (x, y) of a pixel, camera frame.

    Rays of panoramas pass through the middles of pixels, whatever the point.
    """
    if triangles.directions is None:
        return *grid.slopes(mi.Float(column) + x, mi.Float(row) + y), -1.0
    return gather_row(triangles.directions, _number(triangles, column, row), 3)


def _number(triangles: Triangles, column: Any, row: Any) -> Any:
    """Return the number of a pixel in its image; columns of panoramas go around."""
    width = triangles.width
    if triangles.directions is not None:
        column = dr.select(column < 0, column + width, column)
        column = dr.select(column >= width, column - width, column)
    return mi.UInt32(row * width + column)


def _dot(ray: Any, n: Any) -> Any:
    return ray[0] * n.x + ray[1] * n.y + ray[2] * n.z


def _middle(triangles: Triangles, a: Any, b: Any, c: Any) -> Any:
    """Return the direction of a triangle in a panorama; None for the direction of a flat image."""
    return None if triangles.directions is None else unit(unit(a) + unit(b) + unit(c))


def _ahead(corner: Any, middle: Any) -> Any:
    return -corner.z if middle is None else dr.dot(corner, middle)


def _between(depth: Any, ray: Any, middle: Any, nearest: Any, farthest: Any) -> Any:
    """Return depth that rounding has not moved beyond the corners of a triangle seen edge-on."""
    if middle is None:
        return dr.select(nearest > 0, dr.clip(depth, nearest, farthest), depth)
    share = _dot(ray, middle)
    clipped = dr.clip(depth * share, nearest, farthest) / share
    return dr.select((nearest > 0) & (share > 0), clipped, depth)


def _pixels(
    triangles: Triangles, a: Any, b: Any, c: Any, grid: Grid, middle: Any, x: Any, y: Any
) -> tuple[Any, Any, Any, Any]:
    """Return `_rectangle`; in panoramas that of the cap of the sphere around a triangle.

    Its left column may be outside of the image, which goes around.
    """
    if middle is None:
        return _rectangle(triangles, a, b, c, grid, x, y)
    height, width = triangles.height, triangles.width
    cosine = dr.minimum(dr.dot(unit(a), middle), dr.dot(unit(b), middle))
    cosine = dr.minimum(cosine, dr.dot(unit(c), middle))
    radius = dr.acos(dr.clip(cosine, -1, 1)) + dr.pi / height
    radius = dr.select(radius < dr.pi / 2, radius, dr.pi)
    level, longitude = dr.asin(dr.clip(middle.y, -1, 1)), dr.atan2(middle.x, -middle.z)
    half = dr.asin(dr.minimum(dr.sin(radius) / dr.cos(level), 1))
    half = dr.select(dr.abs(level) + radius < dr.pi / 2, half, 4)  # else a pole may be in the cap
    left = dr.ceil((longitude - half) / dr.two_pi * width + (width / 2 - 0.5))
    right = dr.floor((longitude + half) / dr.two_pi * width + (width / 2 - 0.5))
    top = dr.ceil(height / 2 - 0.5 - (level + radius) / dr.pi * height)
    bottom = dr.floor(height / 2 - 0.5 - (level - radius) / dr.pi * height)
    top, bottom = dr.clip(top, 0, height), dr.clip(bottom, -1, height - 1)
    columns = mi.Int32(dr.clip(right - left + 1, 0, width))
    return mi.Int32(left), mi.Int32(top), columns, mi.Int32(dr.maximum(bottom - top + 1, 0))


def nearest_triangle(triangles: Triangles, keys: Any, ray: Any, local: Any) -> Any:
    """Return what rays meet: depth (inf: nothing), object slot, and the normals there.

    These are the normal of the triangle and that of the smooth surface, in the frame of the unit
    shape, not normalised. The triangle's is computed from its corners there, where their rounding
    is finest.

    Args:
        keys: as from `rasterise`, of the same points of the pixels.
        ray: index of the ray in `keys`.
        local: components of its direction in the camera frame, as from `ray_of`.
    """
    key = dr.gather(_key(), keys, ray)
    hit, thread, draw, u, v = _barycentrics(triangles, key, local)
    depth = dr.reinterpret_array(mi.Float, mi.UInt32(key >> 32))
    corners, vertex = _corners(triangles, thread, draw)
    slot = dr.gather(mi.UInt32, triangles.slot, draw, hit)
    flat = _cross(corners[1] - corners[0], corners[2] - corners[0])
    first = dr.gather(mi.Vector4u, triangles.starts, draw, hit).w
    curved = hit & (first > 0)
    rows = [dr.gather(mi.Vector4f, triangles.normals, first + i, curved) for i in vertex]
    p, q, r = (mi.Vector3f(row.x, row.y, row.z) for row in rows)
    smooth = dr.select(curved, (1 - u - v) * p + u * q + v * r, flat)
    return dr.select(hit, depth, dr.inf), slot, flat, smooth


def color_of_nearest(triangles: Triangles, keys: Any, ray: Any, local: Any, colors: Any) -> Any:
    """Return the colour where rays meet what `nearest_triangle` finds, blended between corners.

    `colors` has RGB of the three corners of each triangle, (F, 9), in the order of all models.
    """
    hit, thread, draw, u, v = _barycentrics(triangles, dr.gather(_key(), keys, ray), local)
    face = thread + dr.gather(mi.Vector4u, triangles.starts, draw, hit).y
    row = gather_row(colors, dr.select(hit, face, 0), 9)
    p, q, r = (mi.Vector3f(*row[i : i + 3]) for i in (0, 3, 6))
    return (1 - u - v) * p + u * q + v * r


def _barycentrics(triangles: Triangles, key: Any, local: Any) -> tuple[Any, ...]:
    """Return whether a key is of a triangle, its thread and draw, and the hit's u and v on it."""
    hit = key != NOTHING
    thread = mi.UInt32(dr.select(hit, key & 0xFFFFFFFF, 0))
    draw = dr.gather(mi.UInt32, triangles.draw, thread, hit)
    a, b, c, _ = _in_camera(triangles, draw, _corners(triangles, thread, draw)[0])
    sides = [_dot(local, n) for n in (edge_plane(b, c), edge_plane(c, a), edge_plane(a, b))]
    total = sides[0] + sides[1] + sides[2]
    inverse = dr.select(total == 0, 0, 1 / total)
    return hit, thread, draw, sides[1] * inverse, sides[2] * inverse


def _corners(triangles: Triangles, thread: Any, draw: Any) -> tuple[list[Any], list[Any]]:
    """Return a triangle's corners, in the frame of its unit shape, and their numbers."""
    starts = dr.gather(mi.Vector4u, triangles.starts, draw)
    face = dr.gather(mi.Vector4u, triangles.faces, thread + starts.y)
    vertex = [face.x, face.y, face.z]
    return [gather_packet(triangles.vertices, starts.z + i).xyz for i in vertex], vertex


def _in_camera(triangles: Triangles, draw: Any, corners: list[Any]) -> tuple[Any, Any, Any, Any]:
    """Return a triangle's corners in the camera frame, and the grid of its pixels."""
    m = gather_row(triangles.placed, draw, 13)
    a, b, c = (
        mi.Vector3f(
            *(m[4 * i] * p.x + m[4 * i + 1] * p.y + m[4 * i + 2] * p.z + m[4 * i + 3]
              for i in range(3))
        )
        for p in corners
    )  # fmt: skip
    return a, b, c, Grid(*triangles.middle, m[12] * triangles.aspect, m[12])


def _cross(a: Any, b: Any) -> Any:
    """Return a x b within two units in the last place, which rounding costs needles otherwise.

    W. Kahan's difference of products, as analysed by Jeannerod, Louvet and Muller (2013).
    """

    def difference(a: Any, b: Any, c: Any, d: Any) -> Any:
        product = c * d
        return dr.fma(a, b, -product) + dr.fma(-c, d, product)

    return mi.Vector3f(
        difference(a.y, b.z, a.z, b.y),
        difference(a.z, b.x, a.x, b.z),
        difference(a.x, b.y, a.y, b.x),
    )


def _rectangle(
    triangles: Triangles, a: Any, b: Any, c: Any, grid: Grid, x: Any, y: Any
) -> tuple[Any, Any, Any, Any]:
    """Return left column, top row, columns and rows of the pixels that a triangle may cover.

    Where a corner is not in front of the camera, they are those of the part that is farther than
    NEAR; none where no corner is.
    """
    height, width = triangles.height, triangles.width
    corners = (a, b, c)
    places = [grid.places(corner.x, corner.y, -corner.z) for corner in corners]
    across, down = ([place[k] for place in places] for k in (0, 1))
    before = dr.minimum(a.z, dr.minimum(b.z, c.z)) < -BEHIND
    whole = dr.maximum(a.z, dr.maximum(b.z, c.z)) < -NEAR
    ahead = [corner.z < -NEAR for corner in corners]
    cuts = []  # where edges pass the plane at NEAR
    for i, j in ((0, 1), (1, 2), (2, 0)):
        p, q = corners[i], corners[j]
        share = (-NEAR - p.z) / dr.select(ahead[i] != ahead[j], q.z - p.z, 1)
        right, up = p.x + share * (q.x - p.x), p.y + share * (q.y - p.y)
        cuts.append((ahead[i] != ahead[j], *grid.places(right, up, NEAR)))

    def span(values: list[Any], part: int, at: Any, most: int) -> tuple[Any, Any]:
        low = dr.minimum(values[0], dr.minimum(values[1], values[2])) - at
        high = dr.maximum(values[0], dr.maximum(values[1], values[2])) - at
        cut_low, cut_high = mi.Float(dr.inf), mi.Float(-dr.inf)
        for shown, value in [*zip(ahead, values, strict=True), *((x[0], x[part]) for x in cuts)]:
            cut_low = dr.minimum(cut_low, dr.select(shown, value - at - CUT_SLACK, dr.inf))
            cut_high = dr.maximum(cut_high, dr.select(shown, value - at + CUT_SLACK, -dr.inf))
        low, high = dr.select(whole, low, cut_low), dr.select(whole, high, cut_high)
        low = dr.clip(dr.ceil(low - SLACK), 0, most)
        high = dr.clip(dr.floor(high + SLACK), -1, most - 1)
        return mi.Int32(low), dr.select(
            before, dr.maximum(mi.Int32(high) - mi.Int32(low) + 1, 0), 0
        )

    left, columns = span(across, 1, x, width)
    top, rows = span(down, 2, y, height)
    return left, top, columns, rows


def edge_plane(a: Any, b: Any) -> Any:
    """Return a x b, computed from the ends in an order of their own: exactly -(b x a)."""
    less = (a.x < b.x) | ((a.x == b.x) & ((a.y < b.y) | ((a.y == b.y) & (a.z < b.z))))
    p, q = dr.select(less, a, b), dr.select(less, b, a)
    n = dr.cross(p, q - p)
    return dr.select(less, n, -n)

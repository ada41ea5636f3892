"""All surfaces along the ray of each pixel, in order, in numpy and double precision.

A ray is inside an object while it has entered the object's closed parts more often than it has left
them. So parts that overlap are one solid, and surfaces inside of it are no layers. Parts with a
border, such as a sheet, have layers and no inside.

Everything is computed by elementwise sums, products, quotients and roots, whose bits are the same
on every machine (`common.rotations`).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Grid, Lens, as_lens
from scenegen.common.recent import recent
from scenegen.common.rotations import cross, product
from scenegen.objects.catalogue import mesh_to_cast
from scenegen.objects.exact_surfaces import Surface
from scenegen.objects.furniture.room_shell import shell_name, shell_of
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.surfaces.in_numpy import surface_roots

Array = NDArray[Any]
MOST_LAYERS = 16
ENTERS, LEAVES, OPEN = 1, -1, 0  # what a ray does at a surface
GAP = 1e-6  # of the depth: solids closer than this touch
SAME = 1e-3  # of the depth: between single and double precision
WELD = 1e-6  # of the size of a mesh: corners closer than this are one
NEAR = 1e-6  # of the farthest corner: nearer triangles have no bounding rectangle in the image
CANDIDATES = 2**21  # pairs of triangle and pixel that are tested at once


@dataclass(frozen=True, eq=False)
class Crossings:
    """Where rays cross surfaces: pixel number, depth, and ENTERS, LEAVES or OPEN, (n,) each."""

    pixel: Array
    depth: Array
    kind: Array


@dataclass(frozen=True, eq=False)
class Layers:
    """The surfaces along the ray of each pixel, (H, W, L).

    Attributes:
        depth: planar, float32, ascending; NaN behind the last surface.
        object_id: int8, as in `GroundTruth`; -1 behind the last surface.
        entering: int8, ENTERS, LEAVES or OPEN.
        closed: which object slots consist of closed parts alone, 1 or 0, (K,) uint8.
    """

    depth: Array
    object_id: Array
    entering: Array
    closed: Array


def layers_of(batch: SceneBatch, image: int, depth: Array, object_id: Array) -> Layers:
    """Return the layers of an image of the batch, whose first layer is its depth and ids (H, W)."""
    height, width = depth.shape
    lens, count = batch.lens(image), int(batch.object_count[image])
    rotation = np.swapaxes(batch.world_from_camera[image, :3, :3], 0, 1)
    view = np.concatenate([rotation, -product(rotation, batch.world_from_camera[image, :3, 3:])], 1)
    parts, closed = [], np.zeros(batch.spec.object_slots, np.uint8)
    for k in range(count):
        name = batch.names[batch.shape[image, k]]
        placed = product(view, batch.world_from_object[image, k])
        surface = batch.shape_of(name).surface if batch.spec.source == "shapes" else None
        if surface is not None:
            closed[k] = 1
            parts.append(_surface_crossings(surface, placed, height, width, lens))
        else:
            vertices, faces, whole = _model(batch.shape_of, name)
            closed[k] = whole.all()
            vertices = product(vertices, placed[:, :3].T) + placed[:, 3]
            parts.append(solid_crossings(vertices, faces, whole, height, width, lens))
    # Of other rays, the first layer is the only one.
    layered = (object_id > 0).ravel()
    for part in parts:
        layered[part.pixel] = True
    parts.append(_room_crossings(batch, image, view, layered, depth.shape))
    ids = np.repeat([*range(1, count + 1), 0], [len(part.pixel) for part in parts])
    depths, numbers, entering = stacked(parts, ids, height, width)
    layers = Layers(depths, numbers, entering, closed)
    single = ~layered.reshape(depth.shape)
    layers.depth[single, 0], layers.object_id[single, 0] = depth[single], object_id[single]
    _begin_with(layers, depth, object_id)
    return layers


@recent(200_000_000)
def _model(shape_of: Any, name: str) -> tuple[Array, Array, Array]:
    """Return what `welded` makes of a model."""
    mesh = mesh_to_cast(shape_of, name)
    return welded(mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64))


def welded(vertices: Array, faces: Array) -> tuple[Array, Array, Array]:
    """Return vertices (V, 3), near ones made one, triangles (F, 3), and which are closed, (F,).

    Those of a part are if neighbours pass its edges as often in one direction as in the other.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    cell = max(float(np.abs(vertices).max(initial=0.0)), 1e-300) * WELD
    x, y, z = np.rint(vertices / cell).astype(np.int64).T
    key = (x * 2**21 + y) * 2**21 + z
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    faces = number[faces]
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edge = np.minimum(start, end) * len(first) + np.maximum(start, end)
    _, edge = np.unique(edge, return_inverse=True)
    uneven = np.bincount(edge, np.sign(end - start)) != 0
    links = coo_array((np.ones(len(start)), (start, end)), shape=(len(first),) * 2)
    part = connected_components(links, directed=False)[1]
    open_parts = np.unique(part[start[uneven[edge]]])
    closed = ~np.isin(part[faces[:, 0]] if len(faces) else np.zeros(0), open_parts)
    return vertices[first], faces, closed


def solid_crossings(
    vertices: Array, faces: Array, closed: Array, height: int, width: int, lens: Lens | float
) -> Crossings:
    """Return where rays enter and leave a solid of closed parts, and meet the others.

    Args:
        vertices: camera frame, (V, 3).
        faces: triangles with consistent windings, (F, 3).
        closed: which of them are of closed parts, (F,).
    """
    found = mesh_crossings(vertices, faces[closed], height, width, lens)
    order = np.lexsort((-found.kind, found.depth, found.pixel))
    pixel, depth, kind = found.pixel[order], found.depth[order], found.kind[order].astype(np.int64)
    starts = np.flatnonzero(np.diff(pixel, prepend=-1))
    ray = np.cumsum(np.diff(pixel, prepend=-1) > 0) - 1
    after = np.cumsum(kind)
    # All parts are left in the end, so that a ray's first count follows from its last one.
    ends = np.append(starts[1:], len(pixel)) - 1
    after = after - after[ends][ray] if len(pixel) else after
    turns = (after != 0) != (after - kind != 0)
    pixel, depth, enters = pixel[turns], depth[turns], (after != 0)[turns]
    touching = ~enters[:-1] & (np.diff(pixel) == 0) & (np.diff(depth) <= GAP * depth[:-1])
    kept = ~(np.append(touching, False) | np.insert(touching, 0, False)[: len(pixel)])
    sheets = mesh_crossings(vertices, faces[~closed], height, width, lens)
    return Crossings(
        np.concatenate([pixel[kept], sheets.pixel]),
        np.concatenate([depth[kept], sheets.depth]),
        np.concatenate([np.where(enters[kept], ENTERS, LEAVES), np.full(len(sheets.pixel), OPEN)]),
    )


def mesh_crossings(
    vertices: Array, faces: Array, height: int, width: int, lens: Lens | float
) -> Crossings:
    """Return where the rays of pixels cross triangles (F, 3) in the camera frame, in any order.

    A ray through an edge meets one of the two triangles that share it, as if it passed a bit to the
    right and above.
    """
    if not len(faces):
        return Crossings(*np.zeros((3, 0), np.int64))
    grid = as_lens(lens).grid(height, width)
    points, corners = np.ascontiguousarray(vertices.T), np.ascontiguousarray(faces.T)
    near = -points[2]
    ahead = near > NEAR * np.abs(points).max(initial=0.0)

    def span(values: Array, most: int) -> tuple[Array, Array]:
        low = np.where(ahead, np.clip(np.ceil(values - 1e-6), 0, most), 0).astype(np.int32)
        high = np.where(ahead, np.clip(np.floor(values + 1e-6), -1, most - 1), most - 1)
        first, last = _ends(low[corners])[0], _ends(high.astype(np.int32)[corners])[1]
        return first, (last - first + 1).clip(0)

    with np.errstate(divide="ignore", invalid="ignore"):
        across, down = grid.places(points[0], points[1], near)
    left, columns = span(across - 0.5, width)
    top, rows = span(down - 0.5, height)
    # From here on, of the triangles that may have a pixel.
    some = np.flatnonzero((columns > 0) & (rows > 0) & (near > 0)[corners].any(axis=0))
    corners, (left, columns, top, rows) = (
        corners[:, some],
        (values[some].astype(np.int64) for values in (left, columns, top, rows)),
    )
    nearest, farthest = _ends(near[corners])
    area = columns * rows
    ends = np.cumsum(area)
    cuts = np.searchsorted(ends, np.arange(CANDIDATES, ends[-1] if len(ends) else 0, CANDIDATES))
    found = []
    for some in np.split(np.arange(len(area)), np.unique(cuts)):
        face = np.repeat(some, area[some])
        place = np.arange(len(face)) - np.repeat(np.cumsum(area[some]) - area[some], area[some])
        row, column = np.divmod(place, columns[face])
        row, column = row + top[face], column + left[face]
        pixel = row * width + column
        x, y = grid.slopes(column + 0.5, row + 0.5)
        a, b, c = points[:, corners[:, some]].swapaxes(0, 1)
        planes = [_edge_plane(b, c), _edge_plane(c, a), _edge_plane(a, b)]
        place = np.repeat(np.arange(len(some)), area[some])
        sides = [x * n[0][place] + y * n[1][place] - n[2][place] for n in planes]
        positive = [
            (s > 0) | ((s == 0) & ((n[0] > 0) | ((n[0] == 0) & (n[1] > 0)))[place])
            for s, n in zip(sides, planes, strict=True)
        ]
        all_positive = positive[0] & positive[1] & positive[2]
        inside = np.flatnonzero(all_positive | ~(positive[0] | positive[1] | positive[2]))
        pixel, face, place = pixel[inside], face[inside], place[inside]
        total = sides[0][inside] + sides[1][inside] + sides[2][inside]
        volume = (a[0] * planes[0][0] + a[1] * planes[0][1] + a[2] * planes[0][2])[place]
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = volume / total
        # Rounding must not move a hit on a triangle seen edge-on beyond its corners.
        depth = np.clip(depth, nearest[face], farthest[face])
        ahead = depth > 0
        kind = np.where(all_positive[inside], LEAVES, ENTERS)
        found.append((pixel[ahead], depth[ahead], kind[ahead]))
    return Crossings(*(np.concatenate(part) for part in zip(*found, strict=True)))


def _ends(values: Array) -> tuple[Array, Array]:
    """Return the least and the largest of three rows, (3, n)."""
    a, b, c = values
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _edge_plane(a: Array, b: Array) -> Array:
    """Return a x b, (3, n), computed from the ends in an order of their own: exactly -(b x a)."""
    less = (a[0] < b[0]) | ((a[0] == b[0]) & ((a[1] < b[1]) | ((a[1] == b[1]) & (a[2] < b[2]))))
    plane = np.array(cross(np.where(less, a, b), np.where(less, b, a)))
    return np.where(less, plane, -plane)


def _surface_crossings(
    surface: Surface, placed: Array, height: int, width: int, lens: Lens | float
) -> Crossings:
    """Return where rays enter and leave an exact surface, placed by camera_from_object (3, 4)."""
    grid, squared = as_lens(lens).grid(height, width), (placed[:, 0] * placed[:, 0]).sum()
    # The inverse of a similarity s R is its transpose over s squared.
    linear = placed[:, :3].T / squared
    start = (-product(linear, placed[:, 3:])[:, 0]).tolist()
    (left, columns), (top, rows) = _bounds(placed[:, 3], np.sqrt(squared), height, width, grid)
    row, column = np.arange(top, top + rows)[:, None], np.arange(left, left + columns)
    x, y, z = _rays(linear, row, column, grid)
    middle = -(x * start[0] + y * start[1] + z * start[2]) / (x * x + y * y + z * z)
    nearest = [at + middle * along for at, along in zip(start, (x, y, z), strict=True)]
    inside = nearest[0] ** 2 + nearest[1] ** 2 + nearest[2] ** 2 < 1.0002
    pixel, middle = (row * width + column)[inside], middle[inside]
    c, d = (np.stack([axis[inside] for axis in axes], axis=1) for axes in (nearest, (x, y, z)))
    roots = np.sort(np.stack(surface_roots(surface, c, d), axis=1), axis=1) + middle[:, None]
    kind = np.broadcast_to(np.resize([ENTERS, LEAVES], roots.shape[1]), roots.shape)
    there = np.isfinite(roots) & (roots > 0)
    return Crossings(np.broadcast_to(pixel[:, None], roots.shape)[there], roots[there], kind[there])


def _bounds(
    center: Array, radius: float, height: int, width: int, grid: Grid
) -> list[tuple[int, int]]:
    """Return first column and columns, first row and rows, of the image of a sphere, or more."""
    near, far = -center[2] - 1.01 * radius, -center[2] + 1.01 * radius
    found = []
    sides = (center[0], width, grid.x, grid.across), (-center[1], height, grid.y, grid.down)
    for middle, most, zero, size in sides:
        low, high = 0, most
        if near > 0:
            ends = [(middle + side) / at for side in (-radius, radius) for at in (near, far)]
            low = min(max(int(np.floor(min(ends) / size + zero)) - 1, 0), most)
            high = max(min(int(np.ceil(max(ends) / size + zero)) + 1, most), low)
        found.append((low, high - low if far > 0 else 0))
    return found


def _rays(linear: Array, row: Array, column: Array, grid: Grid) -> list[Array]:
    """Return the components of the rays of pixels after a linear map (3, 3)."""
    x, y = grid.slopes(column + 0.5, row + 0.5)
    return [a * x + b * y - c for a, b, c in linear.tolist()]


def _room_crossings(
    batch: SceneBatch, image: int, view: Array, chosen: Array, shape: tuple[int, ...]
) -> Crossings:
    """Return where the rays of chosen pixels, (H W,), first meet the room."""
    (height, width), lens = shape, batch.lens(image)
    if not batch.has_room[image]:
        return Crossings(*np.zeros((3, 0), np.int64))
    if batch.interior is not None:
        shell = shell_of(shell_name(str(batch.interior[image]))).corners
        vertices = product(shell.reshape(-1, 3).astype(np.float64), view[:, :3].T) + view[:, 3]
        faces = np.arange(len(vertices)).reshape(-1, 3)
        found = mesh_crossings(vertices, faces, height, width, lens)
        order = np.lexsort((found.depth, found.pixel))
        first = order[np.diff(found.pixel[order], prepend=-1) > 0]
        first = first[chosen[found.pixel[first]]]
        return Crossings(found.pixel[first], found.depth[first], np.full(len(first), OPEN))
    camera, pixel = batch.world_from_camera[image], np.flatnonzero(chosen)
    rays = _rays(camera[:3, :3], *np.divmod(pixel, width), lens.grid(height, width))
    start = camera[:3, 3].tolist()
    with np.errstate(divide="ignore", invalid="ignore"):
        walls = [np.where(d < 0, -o / d, np.inf) for o, d in zip(start, rays, strict=True)]
        depth = np.minimum(np.minimum(*walls[:2]), walls[2])
        within = [o + depth * d <= 1 for o, d in zip(start, rays, strict=True)]
    meets = np.isfinite(depth) & within[0] & within[1] & within[2]
    return Crossings(pixel[meets], depth[meets], np.full(meets.sum(), OPEN))


def stacked(parts: list[Crossings], ids: Array, height: int, width: int) -> list[Array]:
    """Return crossings of several objects, ids (n,) of all, as the first MOST_LAYERS layers.

    They are `depth`, `object_id` and `entering` of `Layers`.
    """
    pixel, depth, kind = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("pixel", "depth", "kind")
    )
    depth = depth.astype(np.float32)
    # In the order of pixel and depth, whose bits order as it does. At one depth a ray leaves first.
    last = np.where(ids == 0, 2, kind != LEAVES)
    key = (pixel << 33) | (depth.view(np.int32).astype(np.int64) << 2) | last
    order = np.argsort(key, kind="stable")
    pixel = pixel[order]
    new = np.diff(pixel, prepend=-1) > 0
    rank = np.arange(len(pixel)) - np.flatnonzero(new)[np.cumsum(new) - 1]
    kept = rank < MOST_LAYERS

    def image(values: Array, nothing: float, dtype: type) -> Array:
        layers: Array = np.full((height * width, MOST_LAYERS), nothing, dtype)
        layers[pixel[kept], rank[kept]] = values[order][kept]
        return layers.reshape(height, width, MOST_LAYERS)

    return [image(depth, np.nan, np.float32), image(ids, -1, np.int8), image(kind, 0, np.int8)]


def _begin_with(layers: Layers, depth: Array, object_id: Array) -> None:
    """Make depth and ids (H, W), which single precision found, the first layer, to the bit.

    At silhouettes a ray may meet an object in one precision and miss it in the other.
    """
    first, ids = layers.depth[..., 0], layers.object_id[..., 0]
    with np.errstate(invalid="ignore"):
        same = (ids == object_id) & (np.abs(first - depth) <= SAME * depth)
    other = ~(same | ((object_id < 0) & (ids < 0)))
    first[same] = depth[same]
    for row, column in np.argwhere(other).tolist():
        at = row, column
        along = [*zip(layers.depth[at], layers.object_id[at], layers.entering[at], strict=True)]
        number = int(object_id[row, column])
        closed = number > 0 and bool(layers.closed[number - 1])
        along = _from([x for x in along if x[1] >= 0], depth[at], number, closed)[:MOST_LAYERS]
        along += [(np.float32(np.nan), -1, OPEN)] * (MOST_LAYERS - len(along))
        layers.depth[at], layers.object_id[at], layers.entering[at] = zip(*along, strict=True)
    late = first > layers.depth[..., 1]
    layers.depth[late] = np.maximum.accumulate(layers.depth[late], axis=-1)


def _from(
    along: list[tuple[Any, int, int]], depth: Any, object_id: int, closed: bool
) -> list[tuple[Any, int, int]]:
    """Return the layers of one ray as they are if it first meets this object at this depth."""
    if object_id < 0:
        return []
    at = next(
        (
            i
            for i, (other, number, kind) in enumerate(along)
            if number == object_id and kind != LEAVES and abs(other - depth) <= SAME * depth
        ),
        None,
    )
    if at is None:
        added = [(depth, object_id, k) for k in ((ENTERS, LEAVES) if closed else (OPEN,))]
        before = [x for x in along if x[0] < depth]
        along = [*before, *added, *along[len(before) :]]
        at = len(before)
    missed = along[:at]
    rest = [(depth, object_id, along[at][2]), *along[at + 1 :]]
    for number in {number for _, number, _ in missed}:
        # What was entered and is not met is not left either.
        if sum(kind for _, other, kind in missed if other == number) > 0:
            leaves = next((x for x in rest if x[1] == number and x[2] == LEAVES), None)
            rest = [x for x in rest if x is not leaves]
    return rest

"""Parts with edges that catch the light: bevelled boxes, pads, pillows, blades such as leaves."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scenegen.objects.families.parts.profiles import Point, arc, bezier, join, line
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.solids import Array, convex_hull

Corner = tuple[float, float, float]
Box = tuple[Corner, Corner]


def _bevelled_topology() -> tuple[Array, Array, Array]:
    """Return the signs and the facing axis of a bevelled box's 24 vertices, and its 44 triangles.

    Every corner has three vertices, each on one of its sides.
    """
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    sign, axis = np.repeat(signs, 3, axis=0), np.tile(np.arange(3), 8)
    facing = np.where(axis[:, None] == np.arange(3), sign, 0)
    rings = []
    for way in itertools.product((-1, 0, 1), repeat=3):
        size = sum(map(abs, way))
        if size == 0:
            continue
        chosen = np.flatnonzero(
            [
                all(w in (0, s) for w, s in zip(way, sign[i].tolist(), strict=True))
                and way[axis[i]] != 0
                for i in range(24)
            ]
        )
        places = sign[chosen] - 0.5 * (sign[chosen] - facing[chosen])
        about = places - places.mean(axis=0)
        first = about[0] / np.linalg.norm(about[0])
        second = np.cross(np.array(way) / np.sqrt(size), first)
        order = np.argsort(np.arctan2(about @ second, about @ first))
        ring = chosen[order]
        rings += [ring[[0, k, k + 1]] for k in range(1, len(ring) - 1)]
    return sign, axis, np.array(rings)


_SIGN, _AXIS, _TRIANGLES = _bevelled_topology()


def bevelled(boxes: Sequence[Box], edge: float = 0.004) -> Part:
    """Return boxes, each given by two corners, whose edges are cut off and shaded as if round.

    Args:
        edge: width that is cut from each side; less where a box is thinner than three edges.
    """
    low, high = np.array(boxes, float).swapaxes(0, 1)
    middle, half = (low + high)[:, None] / 2, (high - low)[:, None] / 2
    cut = np.minimum(edge, half.min(axis=2, keepdims=True) * 2 / 3)
    flat = _AXIS[:, None] == np.arange(3)
    points = middle + _SIGN * (half - np.where(flat, 0.0, cut))
    normals = np.broadcast_to(np.where(flat, _SIGN, 0).astype(float), points.shape)
    faces = 24 * np.arange(len(boxes))[:, None, None] + _TRIANGLES
    hull = (middle + _SIGN[::3] * half).reshape(-1, 3)
    mesh = points.reshape(-1, 3), faces.reshape(-1, 3), normals.reshape(-1, 3)
    return Part(*mesh, hull, np.zeros(len(hull)), len(boxes))


def four(x: float, z: float) -> list[Point]:
    """Return four places (x, z), one in each quadrant."""
    return [(sx * x, sz * z) for sx in (1, -1) for sz in (1, -1)]


def posts(at: Sequence[Point], half: float, low: float, high: float) -> list[Box]:
    """Return upright square bars at places (x, z), of half the width `half`."""
    return [((x - half, low, z - half), (x + half, high, z + half)) for x, z in at]


def pad(
    low: Corner, high: Corner, edge: float, crown: float = 0.0, corner: float | None = None,
    lift: Point = (0.0, 0.0),
) -> Part:  # fmt: skip
    """Return a stuffed body between two points: round edges, and a top that rises to the middle.

    Args:
        edge: radius of the edges above and below.
        crown: how far the top of the sides lies below `high`.
        corner: radius of the corners seen from above; by default twice the edge.
        lift: how far the body moves along x and z per unit of y.
    """
    x, z = (high[0] - low[0]) / 2, (high[2] - low[2]) / 2
    radius = min(2 * edge if corner is None else corner, x, z)
    inner = min(x, z) - radius
    is_round = radius > inner  # rows further in have smaller corners, not shorter sides
    room = radius if is_round else inner
    shoulder = high[1] - crown
    edge = min(edge, 0.45 * (shoulder - low[1]), 0.6 * room)
    side = join(
        arc((-edge, low[1] + edge), edge, -90, 0, 3),
        line((0.0, low[1] + edge), (0.0, shoulder - edge)),
        arc((-edge, shoulder - edge), edge, 0, 75 if crown else 90, 3),
    )
    if crown:
        (r, y), way = side[0][-1].tolist(), side[1][-1]
        end = (-edge - 0.75 * (room - edge), high[1])
        bend = (r - 0.3 * (r - end[0]), y + 0.3 * (r - end[0]) * float(way[1] / abs(way[0])))
        side = join(
            side,
            bezier((r, y), (bend[0], min(bend[1], high[1])), (0.5 * (r + end[0]), high[1]), end, 5),
        )
    # Profiles are radii, and so not negative: they count from the innermost row.
    side = side[0] + (room, 0.0), side[1]
    base = (x - room, z - room, radius - room * is_round)
    at = ((low[0] + high[0]) / 2, (low[2] + high[2]) / 2)
    return loft(
        side,
        base=base,
        corner=float(is_round),
        at=at,
        lean=lift,
        segments=12 if radius < 0.1 else 32,
    )


def pillow(width: float, height: float, thick: float, cells: int = 14) -> Part:
    """Return a pillow in the plane of x and y: thick in the middle, its sides drawn in.

    It is centred at the origin.
    """
    t = np.sin(np.linspace(-np.pi / 2, np.pi / 2, cells + 1))  # denser towards the seam
    a, b = np.meshgrid(t, t)
    drawn = 0.07
    x = 0.5 * width * a * (1 - drawn * (1 - b * b))
    y = 0.5 * height * b * (1 - drawn * (1 - a * a))
    bulge = np.maximum((1 - a * a) * (1 - b * b), 0.0) ** 0.42
    points = np.stack([x, y, 0.5 * thick * bulge], axis=-1)
    border = np.maximum(np.abs(a), np.abs(b)) == 1.0
    number = np.arange(a.size).reshape(a.shape)
    behind = np.where(border, number, a.size + number)  # both sheets share the seam
    faces = np.concatenate([_cells(number), _cells(behind)[:, ::-1]])
    both = np.concatenate([points.reshape(-1, 3), points.reshape(-1, 3) * (1, 1, -1)])
    used, index = np.unique(faces, return_inverse=True)
    vertices, faces = both[used], index.reshape(faces.shape)
    sheet = np.stack([_length(points, 1), _length(points, 0), np.full(a.shape, 9.0)], axis=-1)
    sheet = np.concatenate([sheet.reshape(-1, 3)] * 2)[used]
    normals = vertex_normals(vertices, faces)
    return Part(vertices, faces, normals, *_hull(vertices), 1, sheet)


def _length(points: Array, axis: int) -> Array:
    """Return how far points of a grid, (rows, columns, 3), lie from its middle along an axis."""
    steps = np.linalg.norm(np.diff(points, axis=axis), axis=2)
    far = np.cumsum(np.concatenate([0 * steps.take([0], axis), steps], axis=axis), axis=axis)
    return np.asarray(far - far.take([far.shape[axis] // 2], axis))


def _cells(number: Array) -> Array:
    """Return two triangles for each cell of a grid of vertex numbers, (rows, columns).

    Diagonals run towards the middle, so that no triangle lies on two borders.
    """
    quads = [number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]]
    rows, columns = (np.arange(n - 1) < (n - 1) // 2 for n in number.shape)
    turn = rows[:, None] != columns
    a, b, c, d = (np.where(turn, quads[(k + 1) % 4], quads[k]) for k in range(4))
    corners = [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
    return np.concatenate(corners).reshape(-1, 3)


def blades(
    paths: Array, across: Array, widths: Array, fold: float = 0.25, thick: float = 0.0008
) -> Part:
    """Return thin blades along curves, such as leaves, pointed at both ends and folded lengthwise.

    Args:
        paths: centre lines, (count, rows, 3).
        across: unit vectors along which each blade is wide, (count, rows, 3).
        widths: half widths, (count, rows); those at both ends do not count.
        fold: how far the edges rise above the middle, as a share of the half width.
        thick: thickness of the middle, in metres.
    """
    count, rows = paths.shape[:2]
    out = np.cross(np.gradient(paths, axis=1), across)
    out /= np.maximum(np.linalg.norm(out, axis=2, keepdims=True), 1e-12)
    w = widths[..., None]
    left, right = paths + w * (fold * out - across), paths + w * (fold * out + across)
    front = np.stack([left, paths, right], axis=2)[:, 1:-1].reshape(count, -1, 3)
    back = np.stack([left, paths - thick * out, right], axis=2)[:, 1:-1].reshape(count, -1, 3)
    tips = paths[:, [0, -1]]
    vertices = np.concatenate([front, tips, back, tips], axis=1)
    number = np.arange(3 * (rows - 2)).reshape(rows - 2, 3)
    first, last = 3 * (rows - 2), 3 * (rows - 2) + 1
    ends = [(first, number[0, k + 1], number[0, k]) for k in (0, 1)]
    ends += [(last, number[-1, k], number[-1, k + 1]) for k in (0, 1)]
    sheet_faces = np.concatenate([_cells(number), ends])
    half = len(number.ravel()) + 2
    both = np.concatenate([sheet_faces[:, ::-1], half + sheet_faces])
    faces = (2 * half * np.arange(count)[:, None, None] + both).reshape(-1, 3)
    vertices = vertices.reshape(-1, 3)
    share = np.linspace(0.0, 1.0, rows)
    side = np.stack([np.tile([0.0, 0.5, 1.0], rows - 2), np.repeat(share[1:-1], 3)], axis=1)
    side = np.concatenate([side, [(0.5, 0.0), (0.5, 1.0)]])
    sheet = np.tile(np.column_stack([side, np.full(half, 9.0)]), (2 * count, 1))
    normals = vertex_normals(vertices, faces)
    return Part(vertices, faces, normals, *_hull(vertices), count, sheet)


def close_fitting(part: Part) -> Part:
    """Return a part whose body for placing is the hull of its vertices, as after a turn."""
    hull_points, hull_discs = _hull(part.vertices)
    return replace(part, hull_points=hull_points, hull_discs=hull_discs)


def _hull(vertices: Array) -> tuple[Array, Array]:
    corners = vertices[np.sort(convex_hull(vertices).vertices)]
    return corners, np.zeros(len(corners))


def vertex_normals(vertices: Array, faces: Array) -> Array:
    """Return the means of the normals of the triangles at each vertex, weighted by area."""
    a, b, c = vertices[faces].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    total = np.zeros(vertices.shape)
    for k in range(3):
        np.add.at(total, faces[:, k], normal)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30))

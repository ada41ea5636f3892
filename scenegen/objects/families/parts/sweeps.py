"""Tubes of constant cross-section along plane curves: handles, straps, lamp arms."""

import numpy as np

from scenegen.objects.families.parts.profiles import Curve, hull_rows
from scenegen.objects.families.parts.surfaces import Part, outline, section, strips

Vector = tuple[float, float, float]
_HALF = np.tan(np.pi / 8)  # an octagon around a unit circle has the corner (1, _HALF)


def tube(
    path: Curve,
    half_width: float,
    half_height: float | None = None,
    *,
    origin: Vector = (0.0, 0.0, 0.0),
    across: Vector = (1.0, 0.0, 0.0),
    up: Vector = (0.0, 1.0, 0.0),
    corner: float | None = None,
    segments: int = 16,
    thin: bool = False,
) -> Part:
    """Sweep a rounded rectangle along a curve in the plane of two unit vectors, with flat ends.

    Args:
        path: the curve, as distances along `across` and `up` from the origin.
        half_width: of the cross-section, perpendicular to the plane.
        half_height: of the cross-section, in the plane; smaller than the curve's least radius of
            curvature. By default half_width.
        corner: the cross-section's corner radius; by default the smaller half size.
        thin: whether the hull may be coarser, by 0.41 of the corner radius, to save points.
    """
    height = half_width if half_height is None else half_height
    radius = min(half_width, height) if corner is None else corner
    u, v = np.array(across), np.array(up)
    side = np.cross(u, v)
    points = np.array(origin) + path[0][:, :1] * u + path[0][:, 1:] * v
    along = path[1] / np.hypot(path[1][:, :1], path[1][:, 1:])
    forward = along[:, :1] * u + along[:, 1:] * v
    left = -along[:, 1:] * u + along[:, :1] * v  # side x forward
    outward, quadrant = outline(segments, half_width == height == radius)
    size = np.array([[half_width, height, radius]])
    ring = section(size, outward, quadrant)[0]
    body = points[:, None] + ring[:, :1] * side + ring[:, 1:] * left[:, None]
    normals = outward[:, :1] * side + outward[:, 1:] * left[:, None]
    first, last = (np.broadcast_to(points[i], body[0].shape) for i in (0, -1))
    back, front = (np.broadcast_to(w, body[0].shape) for w in (-forward[0], forward[-1]))
    grid = np.concatenate([[first, body[0]], body, [body[-1], last]])
    normals = np.concatenate([[back, back], normals, [front, front]])

    # The cross-section lies in a rectangle or, closer, in an octagon. Each of its corners moves
    # along the curve in a plane of its own, so the hull of that plane curve is enough.
    cut = 0.0 if thin else (1.0 - _HALF) * radius
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    hull = []
    for reach, sideways in ((height, half_width - cut), (height - cut, half_width))[
        : 1 + (cut > 0)
    ]:
        flat = np.concatenate([path[0] + reach * normal, path[0] - reach * normal])
        flat = flat[hull_rows(flat)]
        way = np.array(origin) + flat[:, :1] * u + flat[:, 1:] * v
        hull += [way + sideways * side, way - sideways * side]
    rows = np.concatenate(hull)
    vertices, faces, normals, sheet = strips(grid[None], normals[None])
    return Part(vertices, faces, normals, rows, np.zeros(len(rows)), 1, sheet)

"""A convex body of few points around a mesh. Placement tests these bodies for overlap."""

import numpy as np

from scenegen.objects.solids import Array, convex_hull

MOST_POINTS = 400  # of the body, as placement loops over all of them many times
_DIRECTIONS = 300
_MOST_GROWTH = 1.03
_BLOCK = 512  # points at once, so that matrix products fit into the processor's cache


def hull_points(vertices: Array) -> Array:
    """Return corners of a convex body that contains all vertices, (V, 3) -> (H, 3) float64.

    The body is their convex hull within 1e-9. If that has more than MOST_POINTS corners, the body
    has fewer, and is a few percent larger. It reaches exactly as far down (-y) as the vertices.
    """
    from scipy.spatial import QhullError

    points = np.asarray(vertices, np.float64)
    lowest = points[[int(points[:, 1].argmin())]]
    try:
        # QJ moves points by some 1e-11; without, 20,000 points on a circle take Qhull minutes.
        body = points[convex_hull(points, "QJ Pp").vertices]
        if len(body) > MOST_POINTS:
            body = _coarser(body, float(lowest[0, 1]))
        else:
            body = body[convex_hull(body).vertices]
    except QhullError:  # the points lie in a plane
        body = _flat_hull(points)
    return np.concatenate([body, lowest])


def _flat_hull(points: Array) -> Array:
    """Return the corners of the convex hull of points that lie in a plane."""
    centered = points - points.mean(axis=0)
    axes = np.linalg.svd(centered, full_matrices=False)[2]
    return np.asarray(points[convex_hull(centered @ axes[:2].T).vertices])


def _coarser(points: Array, floor: float) -> Array:
    """Return corners of a body that contains the points, made from extreme points only.

    The hull of the points that are extreme in many directions is scaled about its middle until it
    contains all others, and cut off at the height `floor`, the lowest point's. If it would have to
    grow by more than _MOST_GROWTH (as for a leaning sheet), all points are returned.
    """
    blocks = np.array_split(points, 1 + len(points) // _BLOCK)
    # Scaled by the extents, so that a long body gets as many points on its sides as at its ends.
    directions = _even_directions(_DIRECTIONS) / np.maximum(np.ptp(points, axis=0), 1e-9)
    extreme = _extreme(blocks, directions)
    middle = extreme.mean(axis=0)
    hull = convex_hull(extreme - middle)
    outward = hull.equations[:, :3] / -hull.equations[:, 3:]  # 1 on the hull, less inside
    growth = max(float((outward @ (block - middle).T).max()) for block in blocks)
    if growth > _MOST_GROWTH:
        return points
    corners = middle + (extreme - middle) * max(growth, 1.0) * (1 + 1e-12)
    edges = np.concatenate([hull.simplices[:, [i, (i + 1) % 3]] for i in range(3)])
    low, high = corners[edges[:, 0]], corners[edges[:, 1]]
    cut = (low[:, 1] < floor) != (high[:, 1] < floor)
    low, high = low[cut], high[cut]
    part = (floor - low[:, 1]) / (high[:, 1] - low[:, 1])
    crossings = np.unique(low + part[:, None] * (high - low), axis=0)
    crossings[:, 1] = floor
    return np.concatenate([corners[corners[:, 1] >= floor], crossings])


def _extreme(blocks: list[Array], directions: Array) -> Array:
    """Return the points of all blocks that reach farthest along the directions, each once."""
    best = np.full(len(directions), -np.inf)
    chosen = np.zeros((len(directions), 3))
    for block in blocks:
        reach = directions @ block.T
        at = reach.argmax(axis=1)
        far = reach[np.arange(len(at)), at]
        better = far > best
        best[better], chosen[better] = far[better], block[at[better]]
    return np.unique(chosen, axis=0)


def _even_directions(count: int) -> Array:
    """Return unit vectors spread over the sphere along a golden spiral, (count, 3)."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.arange(count) * np.pi * (3 - 5**0.5)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=1)

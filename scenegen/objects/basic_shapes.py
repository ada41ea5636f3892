"""The basic shapes as unit shapes: box, sphere, cone, torus, cylinder, teapot and polyhedra.

All but the teapot are rendered as exact surfaces (`exact_surfaces`). Their triangle meshes are for
export; those of curved shapes lie within 4.5e-5 of the exact surface and have its normals at their
corners. The teapot's mesh is its ground truth, within 6.5e-4 of Newell's patches.
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from scenegen.common.names import check_choice
from scenegen.description.names import SHAPE_NAMES
from scenegen.objects import teapot
from scenegen.objects.basic_hulls import FILE, all_kept, kept
from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.objects.exact_surfaces import FAR, Capsule, Torus, Turned, cone_of
from scenegen.objects.solids import (
    Array,
    UnitShape,
    arc,
    convex_hull,
    face_outwards,
    line,
    polyhedron,
    resting_directions,
    revolution,
    unshared,
)


@cache
def unit_shape(name: str) -> UnitShape:
    """Return the unit shape of that name. Raises SpecError for an unknown one."""
    check_choice("shape", name, _BUILDERS)
    return _BUILDERS[name]()


def write_hulls() -> None:
    """Compute what `basic_hulls` keeps, and write it, in a process that has made no shape yet.

    python -c "from scenegen.objects import basic_shapes; basic_shapes.write_hulls()"
    """
    all_kept().clear()
    for name in SHAPE_NAMES:
        unit_shape(name)
    np.savez_compressed(FILE, allow_pickle=False, **all_kept())


def _box() -> UnitShape:
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), float).reshape(3, -1).T
    return polyhedron("box", corners)


def _sphere() -> UnitShape:
    half, anywhere = [arc((0, 0), 1, -90, 90, 256)], np.empty((0, 3))
    return revolution("sphere", half, [(0, 0)], 1.0, anywhere, Turned(1, 0, -1, -FAR, FAR))


def _cone() -> UnitShape:
    pieces = [line((0, -1), (1, -1)), line((1, -1), (0, 1))]
    size = 0.5**0.5
    return revolution("cone", pieces, [(1, -1), (0, 1)], exact=cone_of(-size, size, size))


def _cylinder() -> UnitShape:
    pieces = [line((0, -1), (0.8, -1)), line((0.8, -1), (0.8, 1)), line((0.8, 1), (0, 1))]
    half = 1 / math.hypot(0.8, 1)
    exact = Turned((0.8 * half) ** 2, 0, 0, -half, half)
    return revolution("cylinder", pieces, [(0.8, -1), (0.8, 1)], exact=exact)


def _torus() -> UnitShape:
    flat = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    tube = [arc((0.68, 0), 0.32, 0, 360, 256)]
    return revolution("torus", tube, [(0.68, 0)], 0.32, flat, exact=Torus(0.68, 0.32))


def _capsule() -> UnitShape:
    angle = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    lying = np.stack([np.cos(angle), np.zeros(256), np.sin(angle)], axis=1)
    ends = arc((0, -0.5), 0.5, -90, 0, 96), arc((0, 0.5), 0.5, 0, 90, 96)
    pieces = [ends[0], line((0.5, -0.5), (0.5, 0.5)), ends[1]]
    return revolution("capsule", pieces, [(0, -0.5), (0, 0.5)], 0.5, lying, exact=Capsule(0.5, 0.5))


def _pyramid() -> UnitShape:
    base = [(x, -0.7, z) for x in (-1, 1) for z in (-1, 1)]
    return polyhedron("pyramid", np.array([*base, (0, 0.7, 0)], float))


def _prism() -> UnitShape:
    angle = np.radians([90, 210, 330])
    ends = [(np.cos(a), y, np.sin(a)) for a in angle for y in (-0.9, 0.9)]
    return polyhedron("prism", np.array(ends))


def _tetrahedron() -> UnitShape:
    corners = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
    return polyhedron("tetrahedron", corners)


def _octahedron() -> UnitShape:
    return polyhedron("octahedron", np.concatenate([np.eye(3), -np.eye(3)]))


def _icosahedron() -> UnitShape:
    return polyhedron("icosahedron", _golden_points())


def _dodecahedron() -> UnitShape:
    points = _golden_points()
    faces = kept("dodecahedron-faces", lambda: convex_hull(points).simplices)
    return polyhedron("dodecahedron", points[faces].mean(axis=1))


def _golden_points() -> Array:
    """Return the vertices of an icosahedron: cyclic permutations of (0, +-1, +-golden ratio)."""
    golden = (1 + 5**0.5) / 2
    first = np.array([(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)])
    return np.concatenate([np.roll(first, k, axis=1) for k in range(3)])


def _teapot() -> UnitShape:
    corners, normals = teapot.tessellate(divisions=32)
    center = (corners.min((0, 1)) + corners.max((0, 1))) / 2
    scale = 1 / np.linalg.norm(corners - center, axis=-1).max()
    # The hull for placement: slightly too large discs for turned parts, points for the others.
    points = corners.reshape(-1, 3)
    on_hull = kept("teapot-hull", lambda: convex_hull(points).vertices)
    turned_points = 4 * teapot.turned_quads(divisions=32)
    turned = points[on_hull[on_hull < turned_points]]
    others = points[on_hull[on_hull >= turned_points]]
    profile = np.stack([np.hypot(turned[:, 0], turned[:, 2]), turned[:, 1]], axis=1)
    discs, heights = profile[kept("teapot-profile", lambda: convex_hull(profile).vertices)].T
    axis_points = np.stack([0 * heights, heights, 0 * heights], axis=1)
    hull = (np.concatenate([axis_points, others]) - center) * scale
    discs = np.concatenate([discs, np.zeros(len(others))]) * scale
    resting = kept("teapot-resting", lambda: resting_directions(points[on_hull]))

    # Rounded, as the last bits of these sums depend on the processor.
    corners, normals = rounded((corners - center) * scale, POINT_STEP), rounded(normals, POINT_STEP)
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    corner_normals = np.concatenate([normals[:, [0, 1, 2]], normals[:, [0, 2, 3]]])
    mesh = unshared(*face_outwards(triangles, corner_normals))
    return UnitShape("teapot", lambda: mesh, hull, discs, 0.0, resting)


_BUILDERS: dict[str, Callable[[], UnitShape]] = {
    name: globals()[f"_{name}"] for name in SHAPE_NAMES
}

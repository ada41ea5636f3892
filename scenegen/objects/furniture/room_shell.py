"""The shell of a closed room as triangles: floor, walls with openings, ceiling, and what is fixed.

Frame and lengths are those of `description.interiors`. Planes reach past the corners where they
meet, and boxes into the planes they are fixed to, so that no ray slips between them.
"""

import itertools
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.records import from_json
from scenegen.common.rotations import cos_sin, cross
from scenegen.description.interiors import WALLS, Interior, Opening, wall_length
from scenegen.objects.solids import Mesh, UnitShape

Array = NDArray[Any]
PARTS = (
    "floor", *WALLS, "ceiling", "skirting", "door", "frame", "sill", "metal", "glow",
)  # fmt: skip
PREFIX = "room/"  # of the names of shells, which go on with the interior's JSON
PAST = 0.0625  # metres by which planes reach past corners
REVEAL = 0.1875  # depth of a window's opening in the wall
RECESS = 0.0625  # depth of a door's panel behind the wall
SILL = (0.15625, 0.03125)  # how far a sill reaches into the room, and its thickness
SKIRTING = (0.0859375, 0.015625)  # height and thickness
CASING = (0.0703125, 0.0234375)  # width and thickness of the frame around a door
BAR = (0.046875, 0.0546875)  # width and depth of a window's frame
LIGHT = (0.234375, 0.0703125)  # radius and height of the ceiling light
SIDES = 24  # of the ceiling light


@dataclass(frozen=True, eq=False)
class Shell:
    """Triangles of a room.

    Attributes:
        corners: metres, (F, 3, 3), counter-clockwise seen from the side that shows.
        normals: unit normals of the triangles, (F, 3).
        uv: texture coordinates of the corners, in metres, (F, 3, 2).
        part: index into PARTS, (F,).
    """

    corners: Array
    normals: Array
    uv: Array
    part: Array


class _Builder:
    """Collects quadrilaterals and boxes."""

    def __init__(self) -> None:
        self.quads: list[Any] = []
        self.parts: list[int] = []

    def quad(self, part: str, a: Any, b: Any, c: Any, d: Any) -> None:
        """Add a quadrilateral, counter-clockwise seen from the side that shows."""
        self.quads.append((a, b, c, d))
        self.parts.append(PARTS.index(part))

    def box(self, part: str, low: Any, high: Any) -> None:
        """Add a box between two opposite corners, in any order."""
        (x, x1), (y, y1), (z, z1) = (sorted(pair) for pair in zip(low, high, strict=True))
        self.quad(part, (x, y, z1), (x1, y, z1), (x1, y1, z1), (x, y1, z1))
        self.quad(part, (x1, y, z), (x, y, z), (x, y1, z), (x1, y1, z))
        self.quad(part, (x, y, z), (x, y, z1), (x, y1, z1), (x, y1, z))
        self.quad(part, (x1, y, z1), (x1, y, z), (x1, y1, z), (x1, y1, z1))
        self.quad(part, (x, y1, z1), (x1, y1, z1), (x1, y1, z), (x, y1, z))
        self.quad(part, (x, y, z), (x1, y, z), (x1, y, z1), (x, y, z1))


class _Wall:
    """Coordinates along a wall: u along it, v up, w into the room."""

    def __init__(self, size: Any, name: str) -> None:
        self.size, self.name = size, name
        self.length = wall_length(size, name)

    def point(self, u: float, v: float, w: float) -> tuple[float, float, float]:
        """Return a point of the world."""
        along_z = self.name in ("west", "east")
        far = self.name in ("east", "south")
        across = (self.size[0] if along_z else self.size[2]) - w if far else w
        return (across, v, u) if along_z else (u, v, across)

    def quad(self, build: _Builder, part: str, *corners: Any) -> None:
        """Add a quadrilateral of points (u, v, w), counter-clockwise where u runs to the right."""
        points = [self.point(*corner) for corner in corners]
        mirrored = self.name in ("west", "south")  # where u runs to the left, seen from inside
        build.quad(part, *(points[::-1] if mirrored else points))

    def box(self, build: _Builder, part: str, low: Any, high: Any) -> None:
        """Add a box between two corners (u, v, w)."""
        build.box(part, self.point(*low), self.point(*high))


def shell(interior: Interior) -> Shell:
    """Return the shell of a room."""
    build = _Builder()
    x, y, z = interior.size
    p = PAST
    build.quad("floor", (-p, 0, z + p), (x + p, 0, z + p), (x + p, 0, -p), (-p, 0, -p))
    build.quad("ceiling", (-p, y, -p), (x + p, y, -p), (x + p, y, z + p), (-p, y, z + p))
    for name in WALLS:
        _add_wall(build, _Wall(interior.size, name), interior)
    _add_light(build, interior)
    return _finished(build)


def _add_wall(build: _Builder, wall: _Wall, interior: Interior) -> None:
    holes = [opening for opening in interior.openings if opening.wall == wall.name]
    height = interior.size[1]
    across = sorted({-PAST, wall.length + PAST, *(u for h in holes for u in (h.left, h.right))})
    up = sorted({-PAST, height + PAST, *(v for h in holes for v in (h.bottom, h.top))})
    for u, u_end in itertools.pairwise(across):
        for v, v_end in itertools.pairwise(up):
            middle = (u + u_end) / 2, (v + v_end) / 2
            if not any(_inside(hole, *middle) for hole in holes):
                corners = [(u, v, 0.0), (u_end, v, 0.0), (u_end, v_end, 0.0), (u, v_end, 0.0)]
                wall.quad(build, wall.name, *corners)
    doors = [hole for hole in holes if hole.kind == "door"]
    for hole in holes:
        (_add_door if hole.kind == "door" else _add_window)(build, wall, hole)
    stops = [0.0, wall.length]
    for door in sorted(doors, key=lambda d: d.left):
        stops[-1:-1] = [door.left - CASING[0], door.right + CASING[0]]
    for u, u_end in zip(stops[::2], stops[1::2], strict=True):
        if u < u_end:
            wall.box(build, "skirting", (u, -PAST, -PAST), (u_end, SKIRTING[0], SKIRTING[1]))


def _inside(hole: Opening, u: float, v: float) -> bool:
    return hole.left < u < hole.right and hole.bottom < v < hole.top


def _reveal(build: _Builder, wall: _Wall, hole: Opening, depth: float, part: str) -> None:
    """Add the four sides of an opening in a wall."""
    a, b, c, d = hole.left, hole.right, hole.bottom, hole.top
    w = -depth
    wall.quad(build, part, (a, c, w), (a, d, w), (a, d, 0), (a, c, 0))
    wall.quad(build, part, (b, c, w), (b, c, 0), (b, d, 0), (b, d, w))
    wall.quad(build, part, (a, d, w), (b, d, w), (b, d, 0), (a, d, 0))
    wall.quad(build, part, (a, c, w), (a, c, 0), (b, c, 0), (b, c, w))


def _add_window(build: _Builder, wall: _Wall, hole: Opening) -> None:
    _reveal(build, wall, hole, REVEAL, wall.name)
    a, b, c, d = hole.left, hole.right, hole.bottom, hole.top
    wide, deep = BAR
    near = -REVEAL + deep
    sill_reach, sill_thick = SILL
    ears = 0.046875
    wall.box(
        build, "sill", (a - ears, c - sill_thick / 2, -REVEAL), (b + ears, c + sill_thick / 2,
        sill_reach),
    )  # fmt: skip
    bottom = c + sill_thick / 2
    for u, u_end in ((a, a + wide), (b - wide, b)):
        wall.box(build, "frame", (u, bottom, -REVEAL), (u_end, d, near))
    for v, v_end in ((bottom, bottom + wide), (d - wide, d)):
        wall.box(build, "frame", (a, v, -REVEAL), (b, v_end, near - 0.0078125))
    panes = max(1, round((b - a) / 0.75))
    for i in range(1, panes):
        u = a + (b - a) * i / panes
        wall.box(
            build, "frame", (u - wide / 2, bottom, -REVEAL), (u + wide / 2, d, near - 0.00390625)
        )
    if d - c > 1.1:
        v = d - 0.34375
        wall.box(build, "frame", (a, v, -REVEAL), (b, v + wide * 0.75, near - 0.01171875))


def _add_door(build: _Builder, wall: _Wall, hole: Opening) -> None:
    _reveal(build, wall, hole, RECESS, "frame")
    a, b, d = hole.left, hole.right, hole.top
    wide, thick = CASING
    panel = -RECESS + 0.0390625
    wall.box(build, "door", (a, -PAST, -RECESS - 0.03125), (b, d, panel))
    for u, u_end in ((a - wide, a), (b, b + wide)):
        wall.box(build, "frame", (u, -PAST, -0.03125), (u_end, d + wide, thick))
    wall.box(build, "frame", (a, d, -0.03125), (b, d + wide, thick - 0.00390625))
    width = b - a
    for v, v_end in ((0.15625, 0.8125), (0.9375, d - 0.140625)):
        for u, u_end in ((0.14 * width, 0.46 * width), (0.54 * width, 0.86 * width)):
            low, high = (a + u, v, panel - 0.015625), (a + u_end, v_end, panel + 0.0078125)
            wall.box(build, "door", low, high)
    u = b - 0.0625
    wall.box(
        build, "metal", (u - 0.0234375, 0.96875, panel - 0.0078125), (u + 0.0234375, 1.125,
        panel + 0.0078125),
    )  # fmt: skip
    wall.box(
        build,
        "metal",
        (u - 0.0078125, 1.03125, panel),
        (u + 0.0078125, 1.0546875, panel + 0.0546875),
    )
    wall.box(
        build, "metal", (u - 0.125, 1.03125, panel + 0.0390625), (u + 0.0078125, 1.0546875,
        panel + 0.0546875),
    )  # fmt: skip


def _add_light(build: _Builder, interior: Interior) -> None:
    """Add a flat round light in the middle of the ceiling."""
    x, y, z = interior.size[0] / 2, interior.size[1], interior.size[2] / 2
    radius, height = LIGHT
    cosine, sine = cos_sin(np.arange(SIDES + 1) / SIDES)
    cosine, sine = (np.rint(values * 2.0**20) / 2.0**20 for values in (cosine, sine))
    for i in range(SIDES):
        (c, s), (d, t) = ((float(cosine[k]), float(sine[k])) for k in (i, i + 1))
        rim = [(x + radius * e, x_y, z + radius * f) for x_y in (y, y - height)
               for e, f in ((c, s), (d, t))]  # fmt: skip
        build.quad("metal", rim[0], rim[1], rim[3], rim[2])
        inner, low = 0.92 * radius, y - height - 0.0078125
        build.quad("glow", (x, low, z), (x, low, z), (x + inner * c, low, z + inner * s),
                   (x + inner * d, low, z + inner * t))  # fmt: skip
        build.quad(
            "metal", rim[2], rim[3], (x + inner * d, low, z + inner * t),
            (x + inner * c, low, z + inner * s),
        )  # fmt: skip


def _finished(build: _Builder) -> Shell:
    quads = np.array(build.quads, np.float64)
    triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    part = np.repeat(np.array(build.parts), 2)
    a, b, c = triangles.swapaxes(0, 1)
    normals = np.stack(cross((b - a).T, (c - a).T), axis=1)
    length = np.sqrt((normals * normals).sum(axis=1))
    whole = length > 1e-9
    triangles, part, normals = triangles[whole], part[whole], normals[whole] / length[whole, None]
    axis = np.abs(normals).argmax(axis=1)
    uv = np.empty((len(triangles), 3, 2))
    for k, (i, j) in enumerate(((2, 1), (0, 2), (0, 1))):
        uv[axis == k] = triangles[axis == k][..., [i, j]]
    return Shell(triangles, normals, uv, part)


def shell_name(interior_json: str) -> str:
    """Return the name of a shell, which takes the place of a model's name."""
    return PREFIX + interior_json


@lru_cache(maxsize=64)
def shell_of(name: str) -> Shell:
    """Return the shell of a name."""
    return shell(from_json(Interior, name.removeprefix(PREFIX), "interior"))


def shell_shape(name: str) -> UnitShape:
    """Return the shell of a name in the place of a unit shape; its scale is 1 and its place 0."""
    found = shell_of(name)
    faces = np.arange(3 * len(found.corners)).reshape(-1, 3)
    points = found.corners.reshape(-1, 3)
    mesh = Mesh(points, faces, None)
    return UnitShape(name, lambda: mesh, *box_hull(points), 0.0, np.zeros((0, 3)))


def box_hull(points: Array) -> tuple[Array, Array]:
    """Return the corners of the box about points, (8, 3), and radii of 0, as a convex body."""
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    corners = np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(-1, 3)
    return corners, np.zeros(8)

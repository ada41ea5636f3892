"""Where objects stand: the search for a free place on the floor, for many items at once.

Bodies are compared by their support functions: the support in direction d is the largest p . d
over all points p of the body. Floor, walls and the image's borders are planes, so the supports
along their normals tell on which side of them a body lies. Two bodies are apart if their supports
along some direction are; that direction is the normal of a plane between them. Only the directions
in `SEPARATORS` are tried. Bodies are the convex hulls of the shapes (`UnitShape`), so a plane
passes between any two objects of a scene. Supports move with their bodies, so those of one
orientation are computed once for all places tried.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Lens, as_lens, look_at
from scenegen.common.rotations import cos_sin
from scenegen.description.specs import DatasetSpec
from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.sampling.bodies import DIRECTION_STEP, Bodies, along

Array = NDArray[Any]
GAP = 2e-3  # least distance between two objects, scene units
CANDIDATES = 48  # places tried at once for one orientation


def _separators() -> Array:
    """Upright planes every 7.5 degrees, and every 22.5 degrees ones that lean by 30 degrees."""
    upright, leaning = np.arange(48) / 48, np.arange(32) / 16
    y = np.concatenate([np.zeros(48), np.repeat([0.5, -0.5], 16)])
    cosine, sine = cos_sin(np.concatenate([upright, leaning]))
    radius = np.sqrt(1 - y * y)
    return rounded(np.stack([radius * cosine, y, radius * sine], axis=1), DIRECTION_STEP)


SEPARATORS = _separators()
_OPPOSITE = np.array([np.flatnonzero((-row == SEPARATORS).all(axis=1))[0] for row in SEPARATORS])
_WEST, _EAST, _NORTH, _SOUTH = (
    int(np.flatnonzero((np.array(direction) == SEPARATORS).all(axis=1))[0])
    for direction in ((-1, 0, 0), (1, 0, 0), (0, 0, -1), (0, 0, 1))
)


@dataclass(frozen=True, eq=False)
class Frustums:
    """What the images of N scenes show: V pyramids with their tops at the cameras.

    Attributes:
        position: of the cameras, world, (N, V, 3).
        camera_from_world: rotations, (N, V, 3, 3).
        normals: outward normals of an image's four borders in the camera frame, about unit,
            (N, 4, 3).
    """

    position: Array
    camera_from_world: Array
    normals: Array

    def reach(self, bodies: Bodies, kind: Array, rotation: Array, rows: Array) -> Array:
        """Return how far turned bodies reach along `normals` of each view, (n, V, 4), in radii.

        `kind` and `rotation` are as in `Bodies.reach`, `rows` as in `hold`.
        """
        turn = self.camera_from_world[rows]
        seen: Any = sum(turn[..., i, None] * rotation[:, None, i, None, :] for i in range(3))
        views = seen.shape[1]
        normals = np.repeat(self.normals[rows], views, axis=0)
        reach = bodies.reach(np.repeat(kind, views), seen.reshape(-1, 3, 3), normals)
        return reach.reshape(*seen.shape[:2], 4)

    def hold(self, rows: Array, places: Array, border: Array) -> Array:
        """Return at which places all images of a scene show a body whole.

        Args:
            rows: which scene each body is in, (n,).
            places: (n, C, 3).
            border: how far bodies reach along `normals`, (n, V, 4), scene units.

        Returns: (n, C).
        """
        away = places[:, None] - self.position[rows][:, :, None]
        turn = self.camera_from_world[rows][:, :, None]
        seen = [turn[..., i, 0] * away[..., 0] + turn[..., i, 1] * away[..., 1]
                + turn[..., i, 2] * away[..., 2] for i in range(3)]  # fmt: skip
        inside = np.ones(places.shape[:2], bool)
        for k in range(4):
            x, y, z = self.normals[rows, k, :, None, None].swapaxes(0, 1)
            across = x * seen[0] if k < 2 else y * seen[1]
            inside &= (across + z * seen[2] + border[..., k, None] <= 0.0).all(axis=1)
        return inside


def make_frustums(spec: DatasetSpec, cameras: Array, fov_y_degrees: Array) -> Frustums:
    """Return the frustums of cameras (N, V, 3) with vertical fields of view (N,)."""
    world_from_camera = look_at(cameras, np.array(spec.camera_target))[..., :3, :3]
    values, which = np.unique(fov_y_degrees, return_inverse=True)
    lenses = map(spec.lens, values.tolist())
    normals = np.array([border_normals(lens, spec.height, spec.width) for lens in lenses])
    return Frustums(cameras, world_from_camera.swapaxes(-1, -2), normals[which])


def border_normals(lens: Lens | float, height: int, width: int) -> Array:
    """Return the outward normals of the image's four border planes, camera frame: (4, 3).

    They are unit vectors within DIRECTION_STEP, of which they are multiples.
    """
    left, right, top, bottom = as_lens(lens).edges(height, width)
    normals = np.array([[1, 0, right], [-1, 0, -left], [0, 1, top], [0, -1, -bottom]])
    length = np.sqrt(1 + normals[:, 2] ** 2)
    return rounded(normals / length[:, None], DIRECTION_STEP)


def find_places(
    rows: Array,
    reach: Array,
    down: Array,
    border: Array,
    frustums: Frustums,
    placed: Array,
    numbers: Array,
) -> tuple[Array, Array]:
    """Try `CANDIDATES` places on the floor for each body, uniform over it; the first free one wins.

    Free is: inside the walls, inside every camera's image, and a plane away from each body placed
    before.

    Args:
        rows: which scene each body is in, (n,).
        reach, down: the body's supports along SEPARATORS, (n, 80), and downwards, (n,), from its
            origin, scene units.
        border: how far it must stay inside the borders of each image, (n, V, 4).
        placed: supports of the J bodies placed before along SEPARATORS, world, (N, J, 80).
        numbers: uniform on [0, 1), (n, CANDIDATES, 2).

    Returns: (n,) bool, whether there is such a place, and the place, (n, 3).
    """
    count = numbers.shape[1]
    width = 1.0 - reach[:, _WEST] - reach[:, _EAST]
    depth = 1.0 - reach[:, _NORTH] - reach[:, _SOUTH]
    places = np.empty((len(rows), count, 3))
    places[..., 0] = reach[:, _WEST, None] + width[:, None] * numbers[..., 0]
    places[..., 1] = down[:, None]
    places[..., 2] = reach[:, _NORTH, None] + depth[:, None] * numbers[..., 1]
    places = rounded(places, POINT_STEP)
    free = frustums.hold(rows, places, border)
    free &= ((width > 0.0) & (depth > 0.0))[:, None]
    if placed.shape[1]:
        bodies, tried = np.nonzero(free)
        free[bodies, tried] = are_apart(places[bodies, tried], reach[bodies], placed[rows[bodies]])
    first = free.argmax(axis=1)
    each = np.arange(len(rows))
    return free[each, first], places[each, first]


def are_apart(places: Array, reach: Array, others: Array) -> Array:
    """Return which bodies a plane keeps more than GAP away from each of J others: (n,).

    True is a proof. False means that two bodies touch, or nearly: every plane tried cuts one.

    Args:
        places: (n, 3), multiples of POINT_STEP.
        reach: the body's supports along SEPARATORS from its place, (n, 80).
        others: supports of the others along SEPARATORS, world, (n, J, 80).
    """
    ahead = along(places, SEPARATORS) - reach[:, _OPPOSITE] - GAP
    apart: Array = np.asarray((ahead[:, None] > others).any(axis=2))
    return np.asarray(apart.all(axis=1))

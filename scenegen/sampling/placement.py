"""Where objects stand: the search for a free place on the floor.

Bodies are compared by their support functions: the support in direction d is the largest p . d
over all points p of the body. Floor, walls and the image's borders are planes, so the supports
along their normals tell on which side of them a body lies. Two bodies are apart if their supports
along some direction are; that direction is the normal of a plane between them. Only the directions
in `SEPARATORS` are tried. Bodies are the convex hulls of the shapes (`UnitShape`), so a plane
passes between any two objects of a scene. Supports move with their bodies, so those of one
orientation are computed once for all places tried.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Camera
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]
GAP = 2e-3  # least distance between two objects, scene units
CANDIDATES = 48  # places tried at once for one orientation


def _separators() -> Array:
    """Upright planes every 7.5 degrees, and every 22.5 degrees ones that lean by 30 degrees."""
    upright = np.arange(48) * (math.pi / 24)
    leaning = np.arange(32) * (math.pi / 8)
    slope = np.repeat([0.5, -0.5], 16)
    azimuth = np.concatenate([upright, leaning])
    y = np.concatenate([np.zeros(48), slope])
    radius = np.sqrt(1 - y**2)
    return np.stack([radius * np.cos(azimuth), y, radius * np.sin(azimuth)], axis=1)


SEPARATORS = _separators()
_WALLS = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 0, -1], [0, 0, 1], [0, -1, 0]])


@dataclass(frozen=True, eq=False)
class Body:
    """A placed object's convex body.

    Attributes:
        position: world, (3,).
        support: along SEPARATORS and against them, from the position, (2, M).
    """

    position: Array
    support: Array


def are_apart(places: Array, support: Array, other: Body) -> Array:
    """Return at which places, (C, 3), a plane keeps a body more than GAP away from another.

    True is a proof. False means that the bodies touch, or nearly: every plane tried cuts one.
    `support` is the first body's, as in `Body`.
    """
    distance = (places - other.position) @ SEPARATORS.T
    return np.asarray((distance > support[1] + other.support[0] + GAP).any(axis=1))


def frustum_normals(camera: Camera, height: int, width: int) -> Array:
    """Return the outward normals of the image's four border planes, world, unit: (4, 3)."""
    half_y = math.tan(math.radians(camera.fov_y_degrees) / 2)
    half_x = half_y * width / height
    normals = np.array([[1, 0, half_x], [-1, 0, half_x], [0, 1, half_y], [0, -1, half_y]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals @ camera.world_from_camera[:3, :3].T)


def find_place(
    shape: UnitShape,
    rotation: Array,
    scale: float,
    frustums: list[tuple[Array, Array]],
    cropped: bool,
    placed: list[Body],
    rng: np.random.Generator,
) -> Body | None:
    """Try `CANDIDATES` places on the floor, uniform over it; return the first that is free.

    Free is: inside the walls, inside every camera's image (only the centre if `cropped`), and a
    plane away from each body in `placed`. `frustums` are each camera's position, (3,), and its
    outward border normals, (4, 3).
    """
    borders = [normals for _, normals in frustums]
    directions = np.concatenate([_WALLS, *borders, SEPARATORS, -SEPARATORS])
    reach = scale * shape.support(directions @ rotation)
    west, east, north, south, down = reach[:5]
    width, depth = 1.0 - west - east, 1.0 - north - south
    if width <= 0.0 or depth <= 0.0:
        return None
    places = rng.random((CANDIDATES, 3))
    places[:, 0] = west + width * places[:, 0]
    places[:, 1] = down
    places[:, 2] = north + depth * places[:, 2]
    free = np.ones(CANDIDATES, bool)
    for i, (position, normals) in enumerate(frustums):
        border = 0.0 if cropped else reach[5 + 4 * i : 9 + 4 * i]
        free &= ((places - position) @ normals.T + border <= 0.0).all(axis=1)
    support = reach[-2 * len(SEPARATORS) :].reshape(2, -1)
    for other in placed:
        free &= are_apart(places, support, other)
    first = int(free.argmax())
    return Body(places[first], support) if free[first] else None

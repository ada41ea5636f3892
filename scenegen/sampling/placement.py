"""Where objects may stand: support functions of convex bodies, and the search for a free place.

A body's support in direction d is the largest p . d over it. Floor, walls and the image's borders
are planes, so a support is all it takes to keep a body on one side of them; two bodies are apart
if some direction separates their supports. Bodies are the shapes' convex hulls (`UnitShape`), so a
scene's objects are not merely disjoint: a plane passes between any two of them. The planes tried
are those normal to `SEPARATORS`; as supports move with their bodies, one set of them serves all
places that an orientation is tried at.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Camera
from scenegen.common.rotations import rotation_matrix
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]
Quaternion = tuple[float, float, float, float]
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

    Args:
        support: of the first body, as in `Body`.
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
    plane away from each body in `placed`.

    Args:
        frustums: (camera position (3,), outward border normals (4, 3)) of each camera.
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


def random_rotation(shape: UnitShape, pose: str, rng: np.random.Generator) -> Quaternion:
    """Draw an orientation: uniform on SO(3) for pose "any"; for "resting" the shape is dropped in
    such an orientation, settles on the nearest side on which it stays, and is turned about y.
    """
    quaternion = rng.standard_normal(4)
    quaternion /= math.sqrt(quaternion @ quaternion)
    turn = rng.random() * math.pi
    if pose == "any" or not len(shape.resting_directions):
        return _as_tuple(quaternion)
    down = rotation_matrix(_as_tuple(quaternion))[1] * -1.0  # the world's -y, object frame
    side = shape.resting_directions[(shape.resting_directions @ down).argmax()]
    return _multiply((math.cos(turn), 0.0, math.sin(turn), 0.0), _shortest_to_minus_y(side))


def _shortest_to_minus_y(direction: Array) -> Quaternion:
    """Return the smallest rotation that takes the unit `direction` to -y."""
    x, y, z = (float(v) for v in direction)
    if y > 1.0 - 1e-12:
        return (0.0, 1.0, 0.0, 0.0)  # half a turn about x
    # The half-way quaternion (1 + d . -y, d x -y), normalised.
    w = 1.0 - y
    norm = math.sqrt(w * w + z * z + x * x)
    return (w / norm, z / norm, 0.0, -x / norm)


def _multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation that applies b, then a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _as_tuple(quaternion: Array) -> Quaternion:
    w, x, y, z = (float(v) for v in quaternion)
    return (w, x, y, z)

"""Cameras in a furnished room: free, nearly level, and with a free view of what stands there."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Lens, half_angle
from scenegen.common.rotations import cos_sin
from scenegen.description.specs import InteriorSpec
from scenegen.sampling.cameras import with_right_eyes
from scenegen.sampling.interiors.draws import Draws
from scenegen.sampling.interiors.spaces import Box, Space

Array = NDArray[Any]
TRIES = 200
HEIGHT = (0.8, 1.8)  # metres above the floor
CLEAR = 0.3  # metres from everything
STEEPEST = 0.14  # tangent of the steepest view up or down: 8 degrees keep walls upright
CHOICES = 32  # free viewpoints, of which the best is taken
NEAREST = 0.7  # metres to what the camera may look at anywhere in the picture
SHARE_NEAR = 0.12  # of the picture that may be nearer than NEAR
NEAR = 1.1
COLUMNS, ROWS = 11, 9  # of the rays that look for what stands in the way
FURNISHED = 0.6  # of these rays, more of which need not meet objects
LARGEST = 0.3  # of these rays, which one object may take
TALL, NEAR_TALL = 0.8, 1.7  # metres: what is higher and nearer hides the room, as backs of chairs
SMALL = 0.35  # metres: half the diagonal of the ground area of a small object, and half its height
CUT = 1.0  # subtracted for each small object that the lower edge of the image cuts
MOST_CUT = 2.0
SEVERAL = 10  # objects that count as much as all objects of the room
LEAST_SHOWN = 1e-3
BEYOND = 1e3  # metres
Place = tuple[float, float, float]


def draw_cameras(
    spec: InteriorSpec,
    space: Space,
    draws: Draws,
    fov_degrees: float,
    views: Sequence[float] | None = None,
    focuses: Sequence[Box] = (),
) -> tuple[Array, Array] | None:
    """Draw positions and targets of the cameras of all views, (V, 3); None for none.

    The input view is turned about the vertical axis through that point for the other views.

    Args:
        views: degrees of all views in place of those of the spec.
        focuses: boxes near one of which cameras look; by default those of large furniture, and
            small objects at the lower edge of the image are avoided.
    """
    width, _, depth = space.size
    boxes = _table([thing.box for thing in space.placed])
    floor = focuses or [t.box for t in space.placed if t.piece.surfaces]
    floor = floor or [thing.box for thing in space.placed]
    lens = spec.lens(spec.fov_y(fov_degrees))
    cosine, sine = cos_sin(np.array(spec.views if views is None else views) / 360)
    found: list[tuple[float, Array, Array]] = []
    for _ in range(TRIES):
        if len(found) == CHOICES:
            break
        focus = draws.pick(floor)
        x, z = draws.span(CLEAR, width - CLEAR), draws.span(CLEAR, depth - CLEAR)
        y = draws.span(*HEIGHT)
        # Look between what was chosen and the middle of the room.
        share = draws.span(0.0, 0.5)
        tx = focus.x + share * (width / 2 - focus.x)
        tz = focus.z + share * (depth / 2 - focus.z)
        ty = draws.span(0.5, 1.1)
        dx, dz = x - tx, z - tz
        away = math.sqrt(dx * dx + dz * dz)
        if away < min(2.0, 0.45 * max(width, depth)):
            continue
        ty = min(max(ty, y - STEEPEST * away), y + STEEPEST * away)
        target = (tx, ty, tz)
        places = [
            (tx + c * dx + s * dz, y, tz - s * dx + c * dz)
            for c, s in zip(cosine.tolist(), sine.tolist(), strict=True)
        ]
        cameras = with_right_eyes(spec, np.array(places), np.tile(target, (len(places), 1)))
        pairs = zip(*(values.tolist() for values in cameras), strict=True)
        shown = [_shown(place, at, space, boxes, lens, spec, not focuses) for place, at in pairs]
        if all(shown):
            found.append((min(shown), *cameras))
    return max(found, key=lambda one: one[0])[1:] if found else None


def _table(boxes: list[Box]) -> Array:
    """Return middle, half sides, heights, cosine and sine of each box, (N, 8)."""
    return np.array(
        [(b.x, b.z, *b.half, b.bottom, b.top, *b.axes) for b in boxes] or np.zeros((0, 8))
    )


def _shown(
    place: Place, target: Place, space: Space, boxes: Array, lens: Lens, spec: InteriorSpec,
    whole: bool,
) -> float:  # fmt: skip
    """Return how much a camera shows; 0 where it is not free, or something stands right before it.

    It is more where more objects are seen, and less where one of them fills the picture or, if
    `whole`, where the lower edge of the picture cuts small objects.
    """
    x, y, z = place
    if not (CLEAR <= x <= space.size[0] - CLEAR and CLEAR <= z <= space.size[2] - CLEAR):
        return 0.0
    c, s = boxes[:, 6], boxes[:, 7]
    dx, dz = x - boxes[:, 0], z - boxes[:, 1]
    start = np.stack([c * dx - s * dz, y - (boxes[:, 4] + boxes[:, 5]) / 2, s * dx + c * dz])
    half = np.stack([boxes[:, 2], (boxes[:, 5] - boxes[:, 4]) / 2, boxes[:, 3]])
    outside = np.maximum(np.abs(start) - half, 0.0)
    if (np.sqrt((outside * outside).sum(axis=0)) < CLEAR).any():
        return 0.0
    axes, edges = _axes(place, target), lens.edges(spec.height, spec.width)
    hit = _met(axes, start, half, c, s, edges)
    near = hit.min(axis=1)
    if (near <= NEAREST).any() or (near < NEAR).mean() > SHARE_NEAR:
        return 0.0
    first = np.bincount(hit.argmin(axis=1), minlength=len(boxes) + 1) / len(hit)
    rays, empty = first[:-1], float(first[-1])
    several = np.count_nonzero(rays) / SEVERAL
    too_large = max(float(rays.max(initial=0.0)) - LARGEST, 0.0)
    tall = hit[:, :-1][:, boxes[:, 5] > TALL].min(axis=1, initial=np.inf)
    hidden = float((tall < NEAR_TALL).mean())
    before = _before(place, target, boxes, lens.fov_y_degrees) / max(len(boxes), 1)
    shown = several + before + 3 * min(1 - empty, FURNISHED) - 3 * (too_large + hidden)
    if whole and lens.is_flat:
        shown -= min(CUT * _cut(place, axes, boxes, edges), MOST_CUT)
    return max(shown, LEAST_SHOWN)


def _axes(place: Place, target: Place) -> tuple[Array, Array, Array]:
    """Return the directions right, up and back of a camera, world, (3,) each."""
    back = np.array(place) - target
    back /= np.sqrt((back * back).sum())
    right = np.array([back[2], 0.0, -back[0]])
    right /= np.sqrt((right * right).sum())
    up = np.array([back[1] * right[2], back[2] * right[0] - back[0] * right[2],
                   -back[1] * right[0]])  # fmt: skip
    return right, up, back


def _cut(
    place: Place,
    axes: tuple[Array, Array, Array],
    boxes: Array,
    edges: tuple[float, float, float, float],
) -> int:
    """Return how many small objects the lower edge of the picture cuts, hidden ones included."""
    x, z, a, b, bottom, top, c, s = boxes.T
    small = (np.sqrt(a * a + b * b) < SMALL) & (top - bottom < 2 * SMALL)
    corners = np.array(list(itertools.product((-1, 1), (-1, 1), (0, 1))), float)  # (8, 3)
    across, along, up = (corners[:, i, None] for i in range(3))
    offset = (
        x + c * across * a + s * along * b - place[0],
        bottom + up * (top - bottom) - place[1],
        z - s * across * a + c * along * b - place[2],
    )
    right, high, behind = (
        axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2] for axis in axes
    )  # (8, N) each
    ahead = (behind < 0).all(axis=0)
    depth = np.where(ahead, -behind, 1.0)
    u, v = right / depth, high / depth
    left_edge, right_edge, _, lower_edge = edges
    beside = (u.max(axis=0) < left_edge) | (u.min(axis=0) > right_edge)
    crosses = (v.min(axis=0) < lower_edge) & (v.max(axis=0) > lower_edge)
    return int((small & ahead & crosses & ~beside).sum())


def _before(place: Place, target: Place, boxes: Array, fov_y: float) -> int:
    """Return how many boxes have their middle between the picture's left and right edge."""
    ahead = np.array([target[0] - place[0], target[2] - place[2]])
    ahead /= np.sqrt((ahead * ahead).sum())
    toward = boxes[:, :2] - [place[0], place[2]]
    along = toward[:, 0] * ahead[0] + toward[:, 1] * ahead[1]
    across = np.abs(toward[:, 0] * ahead[1] - toward[:, 1] * ahead[0])
    cosine, sine = half_angle(fov_y)
    return int(((along > NEAREST) & (across * cosine < along * sine)).sum())


def _met(
    axes: tuple[Array, Array, Array], start: Array, half: Array, c: Array, s: Array,
    edges: tuple[float, float, float, float],
) -> Array:  # fmt: skip
    """Return the distance along some rays of the picture to each box, inf for none, (R, N + 1).

    The last box is what is behind all others, at BEYOND.
    """
    right, up, back = axes
    u, v = np.meshgrid(np.linspace(*edges[:2], COLUMNS), np.linspace(*edges[:1:-1], ROWS))
    rays = u.reshape(-1, 1) * right + v.reshape(-1, 1) * up - back
    dx, dy, dz = (rays[:, i, None] for i in range(3))
    along = np.stack([c * dx - s * dz, dy + 0 * c, s * dx + c * dz])  # (3, R, N)
    along = np.where(np.abs(along) < 1e-9, 1e-9, along)
    ends = (np.stack([-half, half])[:, :, None] - start[:, None]) / along
    enter, leave = ends.min(axis=0).max(axis=0), ends.max(axis=0).min(axis=0)
    met = np.where((enter <= leave) & (enter > 0), enter, np.inf)
    return np.concatenate([met, np.full((len(met), 1), BEYOND)], axis=1)

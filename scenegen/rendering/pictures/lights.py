"""What lights a room: the outside through its windows, and lamps.

A path in a closed room that looks for light in a random direction of the sky meets a wall. So
points of the windows are sampled, uniformly by area, and the light is what the map of the outside
holds in their direction (B. Bitterli et al., "Portal-masked environment map sampling", 2015, do
so with importance). Triangles of lamps are sampled by their power. Both are combined with the
directions that surfaces sample.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.rendering.pictures.sky import Outside
from scenegen.rendering.tables import gather_row, unit, upload, upload_table

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
WINDOWS = 3  # slots for windows: the same for all scenes, so that they share a kernel
FAR = 100.0  # metres, of what is outside
SUN_SHARE = 0.4  # of the samples of daylight
SLOTS = 4096  # for triangles of lamps, each as often as its power asks for


class Window(NamedTuple):
    """A hole in a wall: numbers, or variables on the device.

    Attributes:
        along_z: whether the wall runs along z, not x.
        at: place of the hole's outside on the other axis.
        left, right: along the wall, left < right.
        bottom, top: heights.
    """

    along_z: Any
    at: Any
    left: Any
    right: Any
    bottom: Any
    top: Any


class Lights(NamedTuple):
    """Lights on the device.

    Attributes:
        map, rows, columns: radiance of the outside by direction.
        sun: direction to it (3), its share of samples, its irradiance (3).
        windows: WINDOWS of them, each with the share of samples up to its end.
        area: of all windows.
        lamps: SLOTS triangles: corner, edges, radiance, and probability by area.
        share: of samples of lamps, the others being of daylight.
        by_area: probability, by area, that a sample takes a point of a triangle, (F,), in numpy.
        flux: that lamps give and that comes in, roughly.
    """

    map: Any
    rows: Any
    columns: Any
    sun: list[Any]
    windows: list[tuple[Window, Any]]
    area: Any
    lamps: Any
    share: Any
    by_area: Array
    flux: float


def lights_of(
    outside: Outside, windows: Sequence[Window], corners: Array, radiance: Array, share: float
) -> Lights:
    """Return the lights of a room on the device of the current Mitsuba variant.

    Args:
        corners, radiance: of all triangles, (F, 3, 3) and (F, 3); it is 0 of those that do not
            shine.
        share: of samples of lamps, if there are lamps that shine.
    """
    by_area, lamps, flux = _lamps(corners, radiance)
    sun = [*outside.toward_sun, SUN_SHARE * (outside.sunlight.max() > 0), *outside.sunlight]
    closed = Window(False, -FAR, 0.0, 1e-3, 0.0, 1e-3)
    slots = [*windows, *[closed] * (WINDOWS - len(windows))]
    areas = [(w.right - w.left) * (w.top - w.bottom) for w in windows] or [1e-6]
    ends = [*np.cumsum(areas) / sum(areas), *[2.0] * WINDOWS]
    flux += sum(areas) * (np.pi * outside.radiance.mean() + 0.5 * outside.sunlight.mean())
    on_device = [
        Window(dr.opaque(mi.Bool, bool(window.along_z)), *map(_number, window[1:]))
        for window in slots
    ]
    rows, columns = map(_number, outside.radiance.shape[:2])
    return Lights(
        map=upload(outside.radiance),
        rows=rows,
        columns=columns,
        sun=[_number(value) for value in sun],
        windows=list(zip(on_device, map(_number, ends[:WINDOWS]), strict=True)),
        area=_number(sum(areas)),
        lamps=upload_table(lamps),
        share=_number(share if lamps.any() else 0.0),
        by_area=by_area,
        flux=float(flux),
    )


def _lamps(corners: Array, radiance: Array) -> tuple[Array, Array, float]:
    """Return the probability by area of triangles, SLOTS of them as lamps, and their flux."""
    shining = np.flatnonzero(radiance.any(axis=1))
    by_area, slots = np.zeros(len(corners)), np.zeros((SLOTS, 13))
    if not len(shining):
        return by_area, slots, 0.0
    edges = corners[shining, 1:] - corners[shining, :1]
    size = 0.5 * np.sqrt((np.cross(edges[:, 0], edges[:, 1]) ** 2).sum(axis=1))
    ends = np.cumsum(size * radiance[shining].mean(axis=1))
    chosen = np.searchsorted(ends, (np.arange(SLOTS) + 0.5) / SLOTS * ends[-1])
    often = np.bincount(chosen, minlength=len(shining))
    by_area[shining] = often / SLOTS / np.maximum(size, 1e-12)
    slots[:, :3] = corners[shining, 0][chosen]
    slots[:, 3:9] = edges[chosen].reshape(-1, 6)
    slots[:, 9:12], slots[:, 12] = radiance[shining][chosen], by_area[shining][chosen]
    return by_area, slots, np.pi * ends[-1]


def _number(value: float) -> Any:
    """Return a number as a variable, so that all rooms share a kernel."""
    return dr.opaque(mi.Float, float(value))


def outside_radiance(lights: Lights, d: Any) -> Any:
    """Return the radiance of the outside along unit vectors."""
    down = dr.safe_acos(d.y) / dr.pi * lights.rows - 0.5
    around = dr.atan2(d.x, -d.z) / dr.two_pi
    around = (around - dr.floor(around)) * lights.columns - 0.5
    x0, y0 = dr.floor(around), dr.floor(down)
    fx, fy = around - x0, down - y0
    total = mi.Color3f(0)
    for i, j, w in ((0, 0, (1 - fx) * (1 - fy)), (1, 0, fx * (1 - fy)),
                    (0, 1, (1 - fx) * fy), (1, 1, fx * fy)):  # fmt: skip
        x = x0 + i
        x = dr.select(x < 0, x + lights.columns, x)
        x = dr.select(x >= lights.columns, x - lights.columns, x)
        y = dr.clip(y0 + j, 0, lights.rows - 1)
        at = mi.UInt32(dr.minimum(y * lights.columns + x, lights.rows * lights.columns - 1))
        total += w * dr.gather(mi.Color3f, lights.map, at)
    return total


def outside_density(lights: Lights, p: Any, d: Any) -> Any:
    """Return by solid angle the probability that `sample_light` takes a direction to a window."""
    total = mi.Float(0)
    for window, _ in lights.windows:
        across, along = _in_wall(window, d)
        away, place = _in_wall(window, p)
        t = (window.at - away) / dr.select(across == 0, 1e-9, across)
        along, up = place + t * along, p.y + t * d.y
        inside = (along >= window.left) & (along <= window.right)
        inside &= (up >= window.bottom) & (up <= window.top) & (t > 0)
        total += dr.select(inside, t * t / dr.maximum(dr.abs(across), 1e-9), 0)
    return total * (1 - lights.sun[3]) / lights.area * (1 - lights.share)


def _in_wall(window: Window, v: Any) -> tuple[Any, Any]:
    """Return the parts of a vector across a window's wall and along it."""
    return dr.select(window.along_z, v.x, v.z), dr.select(window.along_z, v.z, v.x)


def lamp_density(lights: Lights, by_area: Any, distance: Any, cosine: Any) -> Any:
    """Return by solid angle the probability that `sample_light` takes a point of a lamp."""
    return by_area * lights.share * distance * distance / dr.maximum(cosine, 1e-6)


def sample_light(lights: Lights, p: Any, which: Any, place: Any) -> tuple[Any, ...]:
    """Draw directions to lights from points `p`.

    Args:
        which, place: random numbers, one and two.

    Returns directions, distances, radiance over density, and density, which is infinite for the
    sun, as no surface samples it.
    """
    at_lamp = which < lights.share
    rest = (which - lights.share) / dr.maximum(1 - lights.share, 1e-6)
    at_sun = ~at_lamp & (rest < lights.sun[3])
    rest = (rest - lights.sun[3]) / dr.maximum(1 - lights.sun[3], 1e-6)
    before, at = mi.Float(0), mi.Point3f(0)
    for window, end in lights.windows:
        x = window.left + (rest - before) / (end - before) * (window.right - window.left)
        y = window.bottom + place.y * (window.top - window.bottom)
        point = mi.Point3f(
            dr.select(window.along_z, window.at, x), y, dr.select(window.along_z, x, window.at)
        )
        at = dr.select((rest >= before) & (rest < end), point, at)
        before = end
    day = unit(at - p + mi.Vector3f(0, 1e-9, 0))
    slot = mi.UInt32(dr.minimum(which / dr.maximum(lights.share, 1e-6), 1 - 1e-6) * SLOTS)
    lamp = gather_row(lights.lamps, slot, 13)
    corner, a, b = (mi.Vector3f(*lamp[i : i + 3]) for i in (0, 3, 6))
    root = dr.sqrt(place.x)
    to = corner + (1 - root) * a + place.y * root * b - p
    distance = dr.norm(to)
    toward = to / dr.maximum(distance, 1e-9)
    cosine = -dr.dot(unit(dr.cross(a, b)), toward)
    d = dr.select(at_lamp, toward, dr.select(at_sun, mi.Vector3f(*lights.sun[:3]), day))
    density = dr.select(
        at_lamp, lamp_density(lights, lamp[12], distance, cosine), outside_density(lights, p, day)
    )
    shine = dr.select(cosine > 0, mi.Color3f(*lamp[9:12]), 0)
    value = dr.select(at_lamp, shine, outside_radiance(lights, day))
    value = dr.select(density > 0, value / density, 0)
    sun = mi.Color3f(*lights.sun[4:]) / dr.maximum(lights.sun[3] * (1 - lights.share), 1e-9)
    value = dr.select(at_sun, sun, value)
    density = dr.select(at_sun, dr.inf, density)
    return d, dr.select(at_lamp, distance, FAR), value, density

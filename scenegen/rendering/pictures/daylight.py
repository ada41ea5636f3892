"""An environment that lights a room through its windows, which it samples instead of the sky.

A path in a closed room that looks for light in a random direction of the sky meets a wall. So
points of the windows are sampled, uniformly by area, and the light is what the map of the outside
holds in their direction (B. Bitterli et al., "Portal-masked environment map sampling", 2015, do
so with importance). Combined with directions that surfaces sample, as all lights are.
"""

from functools import cache
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.rendering.pictures.sky import Outside
from scenegen.rendering.tables import aligned

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
WINDOWS = 3  # slots for windows: the same for all scenes, so that they share a kernel
FAR = 100.0  # metres, of what is outside
SUN_SHARE = 0.4  # of the samples


def daylight(outside: Outside, windows: Array) -> Any:
    """Return an emitter of the current Mitsuba variant.

    `windows` are corner and two edges of each, world, (N, 3, 3), with N up to WINDOWS.
    """
    return _daylight_class(mi.variant())(outside, windows)


@cache
def _daylight_class(variant: str) -> Any:  # noqa: ARG001 - the key of the cache
    """Return the emitter's class, which must derive from the base class of the variant."""

    class Daylight(mi.Emitter):  # type: ignore[misc]
        """The emitter."""

        def __init__(self, outside: Outside, windows: Array) -> None:
            mi.Emitter.__init__(self, mi.Properties())
            rows, columns = outside.radiance.shape[:2]
            self.map = mi.Float(aligned(outside.radiance))
            shines = outside.sunlight.max() > 0
            sun = [*outside.toward_sun, SUN_SHARE * shines, *outside.sunlight]
            self.sun = [dr.opaque(mi.Float, float(value)) for value in sun]
            self.rows, self.columns = dr.opaque(mi.Float, rows), dr.opaque(mi.Float, columns)
            table = np.zeros((WINDOWS, 16), np.float32)
            table[: len(windows), :9] = windows.reshape(-1, 9)
            across = np.cross(windows[:, 1], windows[:, 2])
            area = np.linalg.norm(across, axis=1)
            table[: len(windows), 9:12] = across / area[:, None]
            ends = np.cumsum(area) / max(area.sum(), 1e-9)
            table[: len(windows), 12] = ends
            table[len(windows) :, 12] = 2.0
            table[: len(windows), 13] = 1 / (windows[:, 1] ** 2).sum(axis=1)
            table[: len(windows), 14] = 1 / (windows[:, 2] ** 2).sum(axis=1)
            self.windows = mi.Float(aligned(table))
            self.area = dr.opaque(mi.Float, float(max(area.sum(), 1e-9)))
            self.m_flags = +mi.EmitterFlags.Infinite

        def _window(self, slot: Any) -> tuple[Any, ...]:
            rows = [dr.gather(mi.Vector4f, self.windows, slot * 4 + i) for i in range(4)]
            flat = [rows[i // 4][i % 4] for i in range(16)]
            o, u, v, n = (mi.Vector3f(*flat[i : i + 3]) for i in (0, 3, 6, 9))
            return o, u, v, n, flat[12], flat[13], flat[14]

        def _radiance(self, d: Any) -> Any:
            """Return the map's radiance along unit vectors."""
            down = dr.safe_acos(d.y) / dr.pi * self.rows - 0.5
            around = dr.atan2(d.x, -d.z) / dr.two_pi
            around = (around - dr.floor(around)) * self.columns - 0.5
            x0, y0 = dr.floor(around), dr.floor(down)
            fx, fy = around - x0, down - y0
            total = mi.Color3f(0)
            for i, j, w in ((0, 0, (1 - fx) * (1 - fy)), (1, 0, fx * (1 - fy)),
                            (0, 1, (1 - fx) * fy), (1, 1, fx * fy)):  # fmt: skip
                x = x0 + i
                x = dr.select(x < 0, x + self.columns, x)
                x = dr.select(x >= self.columns, x - self.columns, x)
                y = dr.clip(y0 + j, 0, self.rows - 1)
                total += w * dr.gather(mi.Color3f, self.map, mi.UInt32(y * self.columns + x))
            return total

        def _density(self, p: Any, d: Any) -> Any:
            """Return the probability by solid angle of a direction from a point."""
            total = mi.Float(0)
            for slot in range(WINDOWS):
                o, u, v, n, _, uu, vv = self._window(mi.UInt32(slot))
                cosine = dr.dot(d, n)
                t = dr.dot(o - p, n) / dr.select(cosine == 0, 1, cosine)
                at = p + t * d - o
                a, b = dr.dot(at, u) * uu, dr.dot(at, v) * vv
                hit = (t > 0) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1) & (uu > 0)
                total += dr.select(hit & (cosine != 0), t * t / dr.abs(cosine), 0)
            return total * (1 - self.sun[3]) / self.area

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
            """Sample the sun, or a point of the windows."""
            share_of_sun = self.sun[3]
            at_sun = sample.x < share_of_sun
            x = (sample.x - share_of_sun) / (1 - share_of_sun)
            start, before, end, chosen = mi.Float(0), mi.Float(0), mi.Float(1), mi.UInt32(0)
            for slot in range(WINDOWS):
                share = self._window(mi.UInt32(slot))[4]
                inside = (x >= before) & (x < share)
                chosen = dr.select(inside, slot, chosen)
                start = dr.select(inside, before, start)
                end = dr.select(inside, share, end)
                before = dr.minimum(share, 1)
            end = dr.minimum(end, 1)
            x = dr.clip((x - start) / dr.maximum(end - start, 1e-6), 0, 1)
            o, u, v, _, _, uu, _ = self._window(chosen)
            p = o + x * u + sample.y * v
            to = p - it.p
            d = to / dr.sqrt(dr.maximum(dr.dot(to, to), 1e-12))
            toward_sun = mi.Vector3f(*self.sun[:3])
            d = dr.select(at_sun, toward_sun, d)
            density = dr.select(at_sun, share_of_sun, self._density(mi.Vector3f(it.p), d))
            active = active & (density > 0) & ((uu > 0) | at_sun)
            ds = dr.zeros(mi.DirectionSample3f)
            ds.p = mi.Point3f(it.p) + d * FAR
            ds.n = -mi.Normal3f(d)
            ds.uv = mi.Point2f(x, sample.y)
            ds.time = it.time
            ds.pdf = dr.select(active, density, 0)
            ds.delta = at_sun
            ds.emitter = mi.EmitterPtr(self)
            ds.d = d
            ds.dist = mi.Float(FAR)
            light = dr.select(at_sun, mi.Color3f(*self.sun[4:]), self._radiance(d))
            return ds, dr.select(active, light / density, 0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            """Return the probability density of `sample_direction`."""
            return dr.select(active, self._density(mi.Vector3f(it.p), mi.Vector3f(ds.d)), 0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:  # noqa: ARG002
            """Return the radiance that arrives along a direction."""
            return dr.select(active, self._radiance(mi.Vector3f(ds.d)), 0)

        def eval(self, si: Any, active: Any = True) -> Any:
            """Return the radiance of rays that leave the scene."""
            return dr.select(active, self._radiance(-mi.Vector3f(si.wi)), 0)

        def bbox(self) -> Any:
            """Return an empty box: the emitter is everywhere."""
            return mi.ScalarBoundingBox3f()

        def set_scene(self, scene: Any) -> None:
            """Take note of nothing."""

        def to_string(self) -> str:
            """Return a name for messages."""
            return "Daylight[]"

    return Daylight

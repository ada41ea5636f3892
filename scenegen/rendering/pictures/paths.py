"""Paths of light through a room, from the camera to its lights.

Every lane traces several samples of a pixel one after the other: where a path ends, the lane begins
its next one at once. So lanes of a processor's vector do not wait for the longest of their paths.
Light is sampled at each surface, and combined with the directions that the surface samples by the
power heuristic (E. Veach, "Robust Monte Carlo methods for light transport simulation", 1997).
"""

from typing import Any, NamedTuple

import drjit
import mitsuba

from scenegen.rendering.pictures.lights import (
    Lights,
    lamp_density,
    outside_density,
    outside_radiance,
    sample_light,
)
from scenegen.rendering.pictures.surfaces import Surfaces, lobes_at, meet, reflected, sampled
from scenegen.rendering.tables import unit

dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
MAX_DEPTH = 12  # segments of a path; in closed rooms light bounces often
ROULETTE_DEPTH = 3  # segments after which a path may end at random
OFF = 1e-4  # metres from a surface at which rays start


class Camera(NamedTuple):
    """A camera on the device: axes and position, world, and the size of a pixel at depth 1."""

    right: Any
    up: Any
    back: Any
    origin: Any
    size: Any
    width: Any
    height: Any

    def ray(self, x: Any, y: Any) -> Any:
        """Return directions through places of the picture, in pixels."""
        right = self.right * ((x - self.width / 2) * self.size)
        return unit(right + self.up * ((self.height / 2 - y) * self.size) - self.back)


class Samples(NamedTuple):
    """Sums over a lane's samples: radiance, base colour, normal, and the number that hit."""

    radiance: Any
    albedo: Any
    normal: Any
    hit: Any


@dr.syntax
def trace_paths(
    surfaces: Surfaces, lights: Lights, camera: Camera, x: Any, y: Any, places: Any, first: Any,
    last: Any, seed: Any, ceiling: Any,
) -> Samples:  # fmt: skip
    """Trace the samples from `first` to before `last` of each lane.

    Args:
        x, y: left and upper edge of each lane's pixel.
        places: of samples within a pixel, two after each other.
        seed: of the random numbers.
        ceiling: greatest radiance of indirect light that a sample may find at once; few brighter
            ones would make specks.
    """
    rng = mi.PCG32(1, seed, dr.arange(mi.UInt64, dr.width(x)))
    k = mi.UInt32(first)
    place = dr.gather(mi.Point2f, places, k, k < last)
    d = camera.ray(x + place.x, y + place.y)
    o = mi.Point3f(camera.origin) + dr.zeros(mi.Point3f, dr.width(x))
    beta, density, depth = mi.Color3f(1), mi.Float(0), mi.UInt32(0)
    radiance, albedo = mi.Color3f(0), mi.Color3f(0)
    normal, hits = mi.Vector3f(0), mi.Float(0)
    active = k < last
    while active:
        found, hit = meet(surfaces, o, d, active)
        lobes = lobes_at(surfaces, hit, d)
        direct = depth == 0
        radiance_met = dr.select(hit.front, mi.Color3f(*hit.row[12:15]), 0)
        shines, cosine = found & (hit.row[12] > 0), dr.abs(dr.dot(hit.flat, d))
        other = dr.select(
            found,
            lamp_density(lights, hit.by_area, dr.norm(hit.p - o), cosine),
            outside_density(lights, o, d),
        )
        met = dr.select(found, radiance_met, outside_radiance(lights, d))
        met *= beta * dr.select(direct, 1, _weight(density, other))
        radiance += dr.select(direct, met, dr.minimum(met, ceiling))
        shown = direct & found
        albedo += dr.select(direct, dr.select(found, lobes.color, 1), 0)
        normal += dr.select(shown, mi.Vector3f(lobes.frame.n), 0)
        hits += dr.select(shown, 1, 0)

        goes_on = found & ~shines & (depth + 1 < MAX_DEPTH)
        start = mi.Point3f(hit.p + OFF * hit.flat)
        which, a, b = rng.next_float32(), rng.next_float32(), rng.next_float32()
        wo, distance, light, other = sample_light(lights, start, which, mi.Point2f(a, b))
        value, own = reflected(lobes, wo)
        light *= beta * value * dr.select(dr.isfinite(other), _weight(other, own), 1)
        asked = goes_on & (dr.max(light) > 0)
        blocked = surfaces.scene.ray_test(
            mi.Ray3f(start, wo, distance * (1 - 1e-3), 0, []), False, asked
        )
        light = dr.select(direct, light, dr.minimum(light, ceiling))
        radiance += dr.select(asked & ~blocked, light, 0)

        which, a, b = rng.next_float32(), rng.next_float32(), rng.next_float32()
        wo, value, density = sampled(lobes, which, mi.Point2f(a, b))
        beta *= value
        depth += 1
        survives = dr.minimum(dr.max(beta), 0.95)
        late = depth >= ROULETTE_DEPTH
        goes_on &= (dr.max(beta) > 0) & (~late | (rng.next_float32() < survives))
        beta *= dr.select(late, dr.rcp(dr.maximum(survives, 1e-6)), 1)

        k = dr.select(goes_on, k, k + 1)
        active = k < last
        place = dr.gather(mi.Point2f, places, k, active)
        o = dr.select(goes_on, start, mi.Point3f(camera.origin))
        d = dr.select(goes_on, wo, camera.ray(x + place.x, y + place.y))
        beta = dr.select(goes_on, beta, 1)
        depth = dr.select(goes_on, depth, 0)
    return Samples(radiance, albedo, normal, hits)


def _weight(own: Any, other: Any) -> Any:
    """Return the weight of a sample by the densities of both ways to draw it."""
    own, other = own * own, other * other
    return dr.select(own > 0, own / (own + other), 0)

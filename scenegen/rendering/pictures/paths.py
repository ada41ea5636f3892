"""Paths of light through a room, from the camera to its lights.

Every lane traces several samples of a pixel one after the other: where a path ends, the lane begins
its next one at once. So lanes of a processor's vector do not wait for the longest of their paths.
Light is sampled at each surface, and combined with the directions that the surface samples by the
power heuristic (E. Veach, "Robust Monte Carlo methods for light transport simulation", 1997).

What paths meet is a `Room`: `closed_rooms` has those with furniture, `paper_rooms` the paper's.
"""

from typing import Any, NamedTuple, Protocol

import drjit
import mitsuba

from scenegen.camera import Grid
from scenegen.rendering.tables import unit

dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
# Of a sequence whose points fill four dimensions evenly (M. Roberts' R4).
STEPS = (0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101)
OFF = 1e-4  # from a surface to the start of its rays, in the unit of length of the room


class Meeting(NamedTuple):
    """Where rays meet a surface.

    Attributes:
        p: position.
        flat: normal of the surface without bumps, on the side of the ray.
        lobes: what the surface does with light. `reflected` returns f cos(theta) for light from a
            direction, world, and the density of `sampled`. That draws directions by three random
            numbers, and returns them, f cos(theta) over density, and density, which may be 0.
        color, normal: base colour and normal that a denoiser is told.
        shines: whether it gives light, and reflects none.
        radiance: of its light along the ray.
        density: by solid angle, with which `Room.sample_light` takes this point.
    """

    p: Any
    flat: Any
    lobes: Any
    color: Any
    normal: Any
    shines: Any
    radiance: Any
    density: Any


class Room(Protocol):
    """What paths meet; a room for each lane, or one for all."""

    @property
    def max_depth(self) -> int:
        """Most segments of a path."""

    @property
    def roulette_depth(self) -> int:
        """Segments after which a path may end at random."""

    def meet(self, o: Any, d: Any, active: Any) -> tuple[Any, Meeting]:
        """Return whether rays along unit vectors meet a surface, and where."""

    def beyond(self, o: Any, d: Any, direct: Any) -> tuple[Any, Any]:
        """Return radiance of rays that meet nothing, and the density of `sample_light` for them.

        `direct` says which of them come from the camera.
        """

    def sample_light(self, lobes: Any, p: Any, which: Any, place: Any) -> tuple[Any, ...]:
        """Draw directions to lights from points `p`.

        Args:
            which, place: random numbers, one and two.

        Returns directions, distances, radiance over density, and density, which is infinite where
        no surface samples the light.
        """

    def blocked(self, p: Any, d: Any, distance: Any, active: Any) -> Any:
        """Return whether a surface is nearer than `distance`."""


class Sphere(NamedTuple):
    """The pixels of a panorama, which shows all directions."""

    width: Any
    height: Any

    def ray(self, x: Any, y: Any) -> Any:
        """Return the components of unit vectors, camera frame, through places of the picture."""
        right, ahead = dr.sincos(dr.two_pi * (x / self.width - 0.5))
        up, level = dr.sincos(dr.pi * (0.5 - y / self.height))
        return level * right, up, -level * ahead


class Camera(NamedTuple):
    """A camera on the device: axes and position, world, and its pixels."""

    right: Any
    up: Any
    back: Any
    origin: Any
    pixels: Grid | Sphere

    def ray(self, x: Any, y: Any) -> Any:
        """Return directions through places of the picture, in pixels."""
        if isinstance(self.pixels, Sphere):
            right, up, back = self.pixels.ray(x, y)
            return unit(self.right * right + self.up * up + self.back * back)
        dx, dy = self.pixels.slopes(x, y)
        return unit(self.right * dx + self.up * dy - self.back)


class Samples(NamedTuple):
    """Sums over a lane's samples: radiance, base colour, normal, and the number that hit."""

    radiance: Any
    albedo: Any
    normal: Any
    hit: Any


@dr.syntax
def trace_paths(
    room: Room, camera: Camera, x: Any, y: Any, places: Any, first: Any, last: Any, rng: Any,
    ceiling: Any, even: Any = None,
) -> Samples:  # fmt: skip
    """Trace the samples from `first` to before `last` of each lane.

    Args:
        x, y: left and upper edge of each lane's pixel.
        places: of samples within a pixel, two after each other.
        rng: random numbers of the lanes.
        ceiling: greatest radiance of indirect light that a sample may find at once; few brighter
            ones would make specks.
        even: four random numbers of each pixel, the same for all its lanes, from which those of its
            samples' first surfaces are spread evenly; None for numbers that know nothing of each
            other.
    """
    k = mi.UInt32(first)
    place = dr.gather(mi.Point2f, places, k, k < last)
    d = camera.ray(x + place.x, y + place.y)
    o = mi.Point3f(camera.origin) + dr.zeros(mi.Point3f, dr.width(x))
    beta, density, depth = mi.Color3f(1), mi.Float(0), mi.UInt32(0)
    radiance, albedo = mi.Color3f(0), mi.Color3f(0)
    normal, hits = mi.Vector3f(0), mi.Float(0)
    active = k < last
    while dr.hint(active, exclude=[room, camera]):
        found, hit = room.meet(o, d, active)
        direct = depth == 0
        outside, other = room.beyond(o, d, direct)
        met = dr.select(found, hit.radiance, outside)
        other = dr.select(found, hit.density, other)
        met *= beta * dr.select(direct, 1, _weight(density, other))
        radiance += dr.select(direct, met, dr.minimum(met, ceiling))
        shown = direct & found
        albedo += dr.select(direct, dr.select(found, hit.color, 1), 0)
        normal += dr.select(shown, hit.normal, 0)
        hits += dr.select(shown, 1, 0)

        goes_on = found & ~hit.shines & (depth + 1 < room.max_depth)
        start = mi.Point3f(hit.p + OFF * hit.flat)
        numbers = _numbers(rng, even, k, direct)
        wo, distance, light, other = room.sample_light(
            hit.lobes, start, numbers[0], mi.Point2f(*numbers[1:3])
        )
        value, own = hit.lobes.reflected(wo)
        light *= beta * value * dr.select(dr.isfinite(other), _weight(other, own), 1)
        asked = goes_on & (dr.max(light) > 0)
        blocked = room.blocked(start, wo, distance * (1 - 1e-3), asked)
        light = dr.select(direct, light, dr.minimum(light, ceiling))
        radiance += dr.select(asked & ~blocked, light, 0)

        wo, value, density = hit.lobes.sampled(numbers[3], mi.Point2f(*numbers[4:]))
        beta *= value
        depth += 1
        survives = dr.minimum(dr.max(beta), 0.95)
        late = depth >= room.roulette_depth
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


def _numbers(rng: Any, even: Any, k: Any, direct: Any) -> list[Any]:
    """Return random numbers of surfaces: of a light, two of a place on it, of a lobe, two of it."""
    numbers = [rng.next_float32() for _ in range(6)]
    if even is not None:
        spread = even + mi.Float(k) * mi.Vector4f(*STEPS)
        for i, value in zip((0, 3, 4, 5), spread - dr.floor(spread), strict=True):
            numbers[i] = dr.select(direct, value, numbers[i])
    return numbers


def _weight(own: Any, other: Any) -> Any:
    """Return the weight of a sample by the densities of both ways to draw it."""
    own, other = own * own, other * other
    return dr.select(own > 0, own / (own + other), 0)

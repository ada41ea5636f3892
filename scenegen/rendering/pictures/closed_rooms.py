"""Closed rooms with furniture, as `paths` meets them."""

from dataclasses import dataclass
from typing import Any

import drjit
import mitsuba

from scenegen.rendering.pictures.lights import (
    Lights,
    lamp_density,
    outside_density,
    outside_radiance,
    sample_light,
)
from scenegen.rendering.pictures.paths import Meeting
from scenegen.rendering.pictures.surfaces import Surfaces, lobes_at, meet

dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba


@dataclass(frozen=True, eq=False)
class ClosedRoom:
    """A `paths.Room` for all lanes."""

    surfaces: Surfaces
    lights: Lights
    max_depth: int = 12  # light bounces often
    roulette_depth: int = 3

    def meet(self, o: Any, d: Any, active: Any) -> tuple[Any, Meeting]:
        """Return whether rays meet a surface, and where."""
        found, hit = meet(self.surfaces, o, d, active)
        lobes = lobes_at(self.surfaces, hit, d)
        shine = dr.select(hit.front, mi.Color3f(*hit.row[12:15]), 0)
        cosine = dr.abs(dr.dot(hit.flat, d))
        density = lamp_density(self.lights, hit.by_area, dr.norm(hit.p - o), cosine)
        normal, shines = mi.Vector3f(lobes.frame.n), hit.row[12] > 0
        return found, Meeting(hit.p, hit.flat, lobes, lobes.color, normal, shines, shine, density)

    def beyond(self, o: Any, d: Any, _direct: Any) -> tuple[Any, Any]:
        """Return the radiance of the outside, and the density of samples of windows."""
        return outside_radiance(self.lights, d), outside_density(self.lights, o, d)

    def sample_light(self, _lobes: Any, p: Any, which: Any, place: Any) -> tuple[Any, ...]:
        """Draw directions to windows, the sun and lamps."""
        return sample_light(self.lights, p, which, place)

    def blocked(self, p: Any, d: Any, distance: Any, active: Any) -> Any:
        """Return whether a surface is nearer than `distance`."""
        return self.surfaces.scene.ray_test(mi.Ray3f(p, d, distance, 0, []), False, active)

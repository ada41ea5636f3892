"""The paper's rooms, as `paths` meets them: shadows and indirect light, for `--shading path`.

Rays meet what the kernel of the ground truth meets (`rays`), so that no scene is built for an
image, and the images of a batch share a launch.

A point light of colour L in the shading equation becomes one of intensity
pi L D^2 / (k_l D + k_q D^2), where D is its distance from the camera's target, so that it is as
bright there as by the shading equation. Ambient light becomes an environment of that radiance.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import drjit
import mitsuba
import numpy as np

from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.pictures.paths import Meeting
from scenegen.rendering.rays import (
    BEFORE_LIGHTS,
    Scenes,
    closest_hit,
    nearer_than_room,
    normals_at,
    occluded,
    visible_normal,
)
from scenegen.rendering.surfaces.in_kernel import MESH
from scenegen.rendering.tables import gather_row, unit

dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba


def with_intensities(batch: SceneBatch) -> SceneBatch:
    """Return a batch whose lights have their intensities as colours."""
    assert isinstance(batch.spec, DatasetSpec)
    to_target = batch.light_position - batch.spec.camera_target
    distance = np.sqrt((to_target**2).sum(axis=-1, keepdims=True))
    k_l, k_q = batch.attenuation[:, None, :1], batch.attenuation[:, None, 1:]
    return replace(batch, light_color=np.pi * batch.light_color * distance / (k_l + k_q * distance))


class Phong(NamedTuple):
    """A matte lobe and Phong's: f cos(theta) = (rho cos(theta) + k_s (r . l)^m) / pi.

    Under a point light this gives what `shading.shade` computes. Phong's lobe reflects at most
    2 k_s / (m + 1) of the light it receives.

    Attributes:
        n, flat: normals, on the viewer's side.
        mirrored: the viewing ray, mirrored.
        rho: reflectance.
        specular, shininess: k_s and m; None for k_s = 0.
    """

    n: Any
    flat: Any
    mirrored: Any
    rho: Any
    specular: Any = None
    shininess: Any = None

    def reflected(self, wo: Any) -> tuple[Any, Any]:
        """Return f cos(theta) for light from `wo`, world, and the density of `sampled`."""
        cosine = dr.dot(self.n, wo)
        value, density = self.rho * cosine, cosine
        if self.specular is not None:
            lobe = dr.power(dr.maximum(dr.dot(self.mirrored, wo), 0), self.shininess)
            value = value + self.specular * lobe
            density = dr.lerp(cosine, lobe * (self.shininess + 1) / 2, self._share())
        shown = (cosine > 0) & (dr.dot(self.flat, wo) > 0)
        return dr.select(shown, value / dr.pi, 0), dr.select(shown, density / dr.pi, 0)

    def sampled(self, one: Any, two: Any) -> tuple[Any, Any, Any]:
        """Draw directions from one of the lobes, weighted by the density of both."""
        wo = mi.Frame3f(self.n).to_world(mi.warp.square_to_cosine_hemisphere(two))
        if self.specular is not None:
            cosine = dr.power(two.y, 1 / (self.shininess + 1))
            sine = dr.sqrt(dr.maximum(1 - cosine * cosine, 0))
            s, c = dr.sincos(dr.two_pi * two.x)
            glossy = mi.Frame3f(self.mirrored).to_world(mi.Vector3f(sine * c, sine * s, cosine))
            wo = dr.select(one < self._share(), glossy, wo)
        wo = unit(wo)
        value, density = self.reflected(wo)
        return wo, dr.select(density > 0, value / density, 0), density

    def _share(self) -> Any:
        """Return the probability of Phong's lobe: its share of light at normal incidence."""
        lobe = 2 * self.specular / (self.shininess + 1)
        return lobe / dr.maximum(lobe + dr.sum(self.rho) / 3, 1e-6)


@dataclass(frozen=True, eq=False)
class PaperRooms:
    """A `paths.Room` for each lane, from a batch that has the intensities of lights.

    `item` is the number of each lane's scene.
    """

    scenes: Scenes
    item: Any
    max_depth: int = 8
    roulette_depth: int = 8  # never: most paths leave the room soon

    def meet(self, o: Any, d: Any, _active: Any) -> tuple[Any, Meeting]:
        """Return whether rays meet a surface, and where."""
        scenes, item = self.scenes, self.item
        t, object_id, face, uv = closest_hit(scenes, item, o, d)
        p = o + dr.select(object_id >= 0, t, 0) * d
        flat, smooth = normals_at(scenes, item, p, d, object_id, face, uv)
        n = visible_normal(scenes, item, p, d, object_id, (flat, smooth))
        if MESH in scenes.surfaces.kinds:
            flat = visible_normal(scenes, item, p, d, object_id, (flat, flat))
        else:
            flat = n
        row = item * (1 + scenes.slots) + mi.UInt32(dr.maximum(object_id, 0))
        material = gather_row(scenes.materials, row, 5 if scenes.glossy else 3)
        rho, mirrored = mi.Color3f(*material[:3]), unit(d - 2 * dr.dot(d, n) * n)
        lobes = Phong(n, flat, mirrored, rho, *material[3:])
        found, dark = object_id >= 0, mi.Color3f(0)
        return found, Meeting(p, flat, lobes, rho, n, mi.Bool(False), dark, mi.Float(0))

    def beyond(self, _o: Any, _d: Any, direct: Any) -> tuple[Any, Any]:
        """Return the background, or ambient light, which no sample of lights takes."""
        about = self._about()
        ambient, background = mi.Color3f(*about[:3]), mi.Color3f(*about[8:BEFORE_LIGHTS])
        return dr.select(direct, background, ambient), mi.Float(0)

    def sample_light(self, lobes: Any, p: Any, which: Any, _place: Any) -> tuple[Any, ...]:
        """Draw one of the lights by what the surface reflects of it, shadows apart."""
        about, total, lights = self._about(), mi.Float(0), []
        for j in range(self.scenes.light_slots):
            light = about[BEFORE_LIGHTS + 6 * j :][:6]
            to_light = mi.Vector3f(*light[:3]) - p
            squared = dr.maximum(dr.dot(to_light, to_light), 1e-12)
            distance, radiance = dr.sqrt(squared), mi.Color3f(*light[3:]) / squared
            toward = to_light / distance
            weight = dr.sum(lobes.reflected(toward)[0] * radiance)
            total = total + weight  # not in place: it is kept
            lights.append((total, toward, distance, radiance / weight))
        d, far, value = mi.Vector3f(0, 1, 0), mi.Float(1), mi.Color3f(0)
        for end, toward, distance, radiance in reversed(lights):
            chosen = which * total < end
            d, far = dr.select(chosen, toward, d), dr.select(chosen, distance, far)
            value = dr.select(chosen, radiance, value)
        return d, far, value * total, mi.Float(dr.inf)

    def blocked(self, p: Any, d: Any, distance: Any, active: Any) -> Any:
        """Return whether a surface is nearer than `distance`."""
        scenes, item = self.scenes, self.item
        wall, _ = nearer_than_room(scenes, item, p, d, (mi.Float(dr.inf), mi.UInt32(0)))
        active &= wall >= distance
        return ~active | occluded(scenes, item, p, d * distance, active)

    def _about(self) -> list[Any]:
        return gather_row(
            self.scenes.scenes, self.item, BEFORE_LIGHTS + 6 * self.scenes.light_slots
        )

"""Closed rooms as `paths` meets them: triangles and their materials, looked up in tables.

All rooms share one compiled kernel, as each triangle finds its own material in a table. The model
is a diffuse lobe below a microfacet lobe (GGX, Walter et al. 2007) with Schlick's Fresnel term;
metals have the latter alone. Slopes tilt the shading normal (J. Blinn, "Simulation of wrinkled
surfaces", 1978).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.objects.furniture.furnishing import CLAMP, REPEAT
from scenegen.rendering.meshes.unit_scene import triangle_mesh
from scenegen.rendering.pictures.lights import (
    Lights,
    lamp_density,
    outside_density,
    outside_radiance,
    sample_light,
)
from scenegen.rendering.pictures.matter import Matter
from scenegen.rendering.pictures.paths import Meeting
from scenegen.rendering.tables import gather_row, unit, upload, upload_table

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
ROUGHEST = 0.03  # least roughness squared, so that highlights are not infinitely bright
GRAZING = 0.02  # least cosine between a tilted normal and the viewer
FACE = 32  # floats of a triangle
ROW = 16  # floats of a material


class ClosedRoom(NamedTuple):
    """A `paths.Room` for all lanes: triangles, materials and lights on the device.

    Attributes:
        scene: Mitsuba's, for rays alone.
        faces: of each triangle its corner and two edges; the normal of its corner and the changes
            along the edges; so, too, texture coordinates, metres; the gradients of these; its row;
            and the probability by area that a sample of lights takes a point of it.
        rows, texels, slopes: as of `matter.Tables`.
    """

    scene: Any
    faces: Any
    rows: Any
    texels: Any
    slopes: Any
    lights: Lights
    max_depth: int = 12  # light bounces often
    roulette_depth: int = 3

    def meet(self, o: Any, d: Any, active: Any) -> tuple[Any, Meeting]:
        """Return whether rays meet a surface, and where."""
        found = self.scene.ray_intersect_preliminary(mi.Ray3f(o, d), False, active)
        valid = active & found.is_valid()
        face = gather_row(self.faces, dr.select(valid, found.prim_index, 0), FACE)
        corner, a, b = (mi.Vector3f(*face[i : i + 3]) for i in (0, 3, 6))
        # Where a ray meets nothing, these may be anything, and lead to places beyond all tables.
        u, v = (dr.select(valid, x, 0) for x in (found.prim_uv.x, found.prim_uv.y))
        flat = unit(dr.cross(a, b))
        front = dr.dot(flat, d) < 0
        normal, along_a, along_b = (mi.Vector3f(*face[i : i + 3]) for i in (9, 12, 15))
        normal = unit(normal + u * along_a + v * along_b)
        x, y = face[18] + u * face[20] + v * face[22], face[19] + u * face[21] + v * face[23]
        row = gather_row(self.rows, mi.UInt32(face[30]), ROW)
        flat, normal = (dr.select(front, n, -n) for n in (flat, normal))
        gradients = [mi.Vector3f(*face[i : i + 3]) for i in (24, 27)]
        gradients = [dr.select(front, g, -g) for g in gradients]
        lobes = self._lobes(d, flat, normal, mi.Vector2f(x, y), gradients, row)
        p, radiance = corner + u * a + v * b, dr.select(front, mi.Color3f(*row[12:15]), 0)
        density = lamp_density(self.lights, face[31], dr.norm(p - o), dr.abs(dr.dot(flat, d)))
        shown = mi.Vector3f(lobes.frame.n)
        return valid, Meeting(p, flat, lobes, lobes.color, shown, row[12] > 0, radiance, density)

    def _lobes(
        self, d: Any, flat: Any, normal: Any, uv: Any, gradients: Sequence[Any], row: Sequence[Any]
    ) -> "Lobes":
        """Return what a surface does with light, from its texture coordinates and material."""
        texel = _texel(self.texels, uv, row[0], row[1], row[2], row[3], row[6:8])
        red, green, blue, rough = (mi.Float((texel >> (8 * k)) & 255) / 255 for k in range(4))
        color = mi.Color3f(red * red, green * green, blue * blue)
        both = _texel(
            self.slopes, uv, row[8], dr.maximum(row[9], 1), dr.maximum(row[10], 1), row[3]
        )
        du, dv = (mi.Float(mi.Int32(both << shift) >> 16) * row[11] for shift in (16, 0))
        tilted = unit(normal - du * gradients[0] - dv * gradients[1])
        tilted = dr.select(row[9] > 0, tilted, normal)
        tilted = dr.select(dr.dot(tilted, d) < -GRAZING, tilted, flat)
        metallic, specular = row[4], row[5]
        facets = mi.MicrofacetDistribution(
            mi.MicrofacetType.GGX, dr.maximum(rough * rough, ROUGHEST), True
        )
        frame = mi.Frame3f(mi.Normal3f(tilted))
        return Lobes(
            frame, flat, frame.to_local(-d), color, facets,
            dr.lerp(mi.Color3f(0.08 * specular), color, metallic), color * (1 - metallic),
            dr.lerp(dr.select(specular > 0, 0.2, 0.0), 0.95, metallic),
        )  # fmt: skip

    def beyond(self, o: Any, d: Any, _direct: Any) -> tuple[Any, Any]:
        """Return the radiance of the outside, and the density of samples of windows."""
        return outside_radiance(self.lights, d), outside_density(self.lights, o, d)

    def sample_light(self, _lobes: Any, p: Any, which: Any, place: Any) -> tuple[Any, ...]:
        """Draw directions to windows, the sun and lamps."""
        return sample_light(self.lights, p, which, place)

    def blocked(self, p: Any, d: Any, distance: Any, active: Any) -> Any:
        """Return whether a surface is nearer than `distance`."""
        return self.scene.ray_test(mi.Ray3f(p, d, distance, 0, []), False, active)


def closed_room(matter: Matter, lights: Lights) -> ClosedRoom:
    """Return a room on the device of the current Mitsuba variant."""
    corners, normals, uv, tables = *matter.soup, matter.tables
    faces = np.zeros((len(corners), FACE), np.float32)
    a, b = faces[:, 3:6], faces[:, 6:9]
    _put_changes(faces[:, :9], corners)
    _put_changes(faces[:, 9:18], normals)
    _put_changes(faces[:, 18:24], uv)
    across = _cross(a, b)
    size = np.maximum((across * across).sum(axis=1, keepdims=True), 1e-30)
    duals = _cross(b, across) / size, _cross(across, a) / size
    for axis in (0, 1):
        first, second = faces[:, 20 + axis, None], faces[:, 22 + axis, None]
        faces[:, 24 + 3 * axis : 27 + 3 * axis] = first * duals[0] + second * duals[1]
    faces[:, 30], faces[:, 31] = tables.of_face, lights.by_area
    scene = mi.load_dict({"type": "scene", "room": triangle_mesh("room", corners)})
    texels, slopes = (upload(x, np.uint32) for x in (tables.texels, tables.slopes))
    return ClosedRoom(scene, upload_table(faces), upload_table(tables.rows), texels, slopes, lights)


def _put_changes(columns: Array, values: Array) -> None:
    """Write values at the first corner, and their changes along both edges, (F, 3 k)."""
    size = values.shape[2]
    columns[:, :size] = values[:, 0]
    for k in (1, 2):
        columns[:, k * size : (k + 1) * size] = values[:, k] - values[:, 0]


def _cross(a: Array, b: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _texel(
    values: Any, uv: Any, first: Any, width: Any, height: Any, metres: Any, wrap: Any = (0, 0)
) -> Any:
    """Return the value of a map at a point, of the nearest pixel.

    Those are mostly smaller than a picture's: its samples average them.
    """
    u, v = (_wrapped(*x) for x in ((uv.x / metres, wrap[0]), (uv.y / metres, wrap[1])))
    x = mi.UInt32(dr.minimum(u * width, width - 1))
    y = mi.UInt32(dr.minimum(v * height, height - 1))
    return dr.gather(mi.UInt32, values, mi.UInt32(first) + y * mi.UInt32(width) + x)


def _wrapped(x: Any, wrap: Any) -> Any:
    """Return the place in a map, 0 to 1, of any place along an axis."""
    mirrored = dr.abs(x - 2 * dr.round(0.5 * x))
    beyond = dr.select(wrap == CLAMP, dr.clip(x, 0, 1), mirrored)
    return dr.select(wrap == REPEAT, x - dr.floor(x), beyond)


class Lobes(NamedTuple):
    """What a surface does with light (`paths.Meeting`): its frame, and parameters of its lobes."""

    frame: Any
    flat: Any
    wi: Any
    color: Any
    facets: Any
    mirrored: Any
    diffuse: Any
    share: Any

    def reflected(self, wo: Any) -> tuple[Any, Any]:
        """Return f cos(theta) for light from `wo`, world, and the density of `sampled`."""
        value, density = _value(self, self.frame.to_local(wo))
        shown = dr.dot(self.flat, wo) > 0
        return dr.select(shown, value, 0), dr.select(shown, density, 0)

    def sampled(self, one: Any, two: Any) -> tuple[Any, Any, Any]:
        """Draw directions from one of the lobes, weighted by the density of both."""
        facet, _ = self.facets.sample(self.wi, two)
        mirrored = 2 * dr.dot(self.wi, facet) * mi.Vector3f(facet) - self.wi
        matte = mi.warp.square_to_cosine_hemisphere(two)
        out = dr.select(one < self.share, mirrored, matte)
        value, density = _value(self, out)
        wo = unit(self.frame.to_world(out))
        shown = (density > 0) & (dr.dot(self.flat, wo) > 0)
        return wo, dr.select(shown, value / density, 0), dr.select(shown, density, 0)


def _value(lobes: Lobes, wo: Any) -> tuple[Any, Any]:
    wi, facets = lobes.wi, lobes.facets
    h = unit(wi + wo)
    toward = dr.maximum(dr.dot(wi, h), 1e-4)
    fresnel = lobes.mirrored + (1 - lobes.mirrored) * dr.power(1 - dr.minimum(toward, 1), 5)
    glossy = fresnel * facets.eval(h) * facets.G(wi, wo, h) / (4 * dr.maximum(wi.z, 1e-4))
    matte = lobes.diffuse * (1 - fresnel) * wo.z / dr.pi
    density = lobes.share * facets.pdf(wi, h) / (4 * toward) + (1 - lobes.share) * wo.z / dr.pi
    shown = (wi.z > 0) & (wo.z > 0)
    return dr.select(shown, glossy + matte, 0), dr.select(shown, density, 0)

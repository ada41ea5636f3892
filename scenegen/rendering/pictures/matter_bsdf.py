"""One Mitsuba material for all surfaces of a room: each triangle looks up its own in tables.

So all rooms share one compiled kernel. The model is a diffuse lobe below a microfacet lobe (GGX,
Walter et al. 2007) with Schlick's Fresnel term; metals have the latter alone. Heights tilt the
shading normal (J. Blinn, "Simulation of wrinkled surfaces", 1978).
"""

from functools import cache
from typing import Any

import drjit
import mitsuba
import numpy as np

from scenegen.rendering.pictures.matter import TEXEL_RANGE, Tables
from scenegen.rendering.tables import aligned

dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
ROUGHEST = 0.03  # least roughness squared, so that highlights are not infinitely bright


def matter_bsdf(tables: Tables) -> Any:
    """Return the material of the current Mitsuba variant."""
    return _matter_class(mi.variant())(tables)


@cache
def _matter_class(variant: str) -> Any:  # noqa: ARG001 - the key of the cache
    """Return the material's class, which must derive from the base class of the variant."""

    class Matter(mi.BSDF):  # type: ignore[misc]
        """The material."""

        def __init__(self, tables: Tables) -> None:
            mi.BSDF.__init__(self, mi.Properties())
            self.of_face = mi.UInt32(aligned(tables.of_face, np.uint32))
            self.rows = mi.Float(aligned(tables.rows))
            self.texels, self.heights = mi.UInt32(tables.texels), mi.Float(tables.heights)
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            diffuse, glossy = mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection
            self.m_components = [diffuse | sides, glossy | sides]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def _row(self, si: Any) -> list[Any]:
            material = dr.gather(mi.UInt32, self.of_face, si.prim_index)
            packets = [dr.gather(mi.Vector4f, self.rows, material * 3 + i) for i in range(3)]
            return [packet[i] for packet in packets for i in range(4)]

        def _corners(self, uv: Any, first: Any, width: Any, height: Any, metres: Any) -> Any:
            """Return the four texels about a point, their weights, and shares across and along."""
            u, v = uv.x / metres, uv.y / metres
            x = (u - dr.floor(u)) * width - 0.5
            y = (v - dr.floor(v)) * height - 0.5
            x0, y0 = dr.floor(x), dr.floor(y)
            fx, fy = x - x0, y - y0
            left, right = (dr.select(a < 0, a + width, a) for a in (x0, x0 + 1))
            low, high = (dr.select(a < 0, a + height, a) for a in (y0, y0 + 1))
            right = dr.select(right >= width, right - width, right)
            high = dr.select(high >= height, high - height, high)
            start = mi.UInt32(first)
            at = [start + mi.UInt32(b * width + a) for b in (low, high) for a in (left, right)]
            weights = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
            return at, weights, fx, fy

        def _look(self, si: Any) -> tuple[Any, ...]:
            """Return base colour, roughness, metallic, specular, and the row."""
            row = self._row(si)
            at, weights, _, _ = self._corners(si.uv, row[0], row[1], row[2], row[3])
            color, rough = mi.Color3f(0), mi.Float(0)
            for i, w in zip(at, weights, strict=True):
                texel = dr.gather(mi.UInt32, self.texels, i)
                parts = [mi.Float((texel >> (8 * k)) & 255) / TEXEL_RANGE for k in range(4)]
                color += w * mi.Color3f(*(part * part for part in parts[:3]))
                rough += w * parts[3]
            return color, rough, row

        def _frame(self, si: Any, row: list[Any]) -> Any:
            """Return the shading frame, tilted by the slope of the heights."""
            bumpy = row[9] > 0
            at, _, fx, fy = self._corners(
                si.uv, dr.select(bumpy, row[8], 0), dr.select(bumpy, row[9], 1),
                dr.select(bumpy, row[10], 1), row[3],
            )  # fmt: skip
            h = [dr.gather(mi.Float, self.heights, i) for i in at]
            du = dr.lerp(h[1] - h[0], h[3] - h[2], fy) * row[9] / row[3]
            dv = dr.lerp(h[2] - h[0], h[3] - h[1], fx) * row[10] / row[3]
            n = mi.Vector3f(si.sh_frame.n)
            p_u = si.dp_du + n * (du - dr.dot(n, si.dp_du))
            p_v = si.dp_dv + n * (dv - dr.dot(n, si.dp_dv))
            tilted = dr.cross(p_u, p_v)
            length = dr.norm(tilted)
            tilted = dr.select(bumpy & (length > 1e-8), tilted / length, n)
            tilted = dr.mulsign(tilted, dr.dot(tilted, n))
            return mi.Frame3f(mi.Normal3f(tilted))

        def _local(self, si: Any, wo: Any, row: list[Any]) -> tuple[Any, Any, Any, Any]:
            """Return wi and wo in the tilted frame, on the viewer's side; the frame; a sign."""
            frame = self._frame(si, row)
            wi = frame.to_local(si.to_world(si.wi))
            out = frame.to_local(si.to_world(wo))
            side = dr.mulsign(mi.Float(1), si.wi.z)
            return (
                mi.Vector3f(wi.x, wi.y, wi.z * side),
                mi.Vector3f(out.x, out.y, out.z * side),
                frame,
                side,
            )

        def _lobes(self, color: Any, rough: Any, row: list[Any]) -> tuple[Any, ...]:
            metallic, specular = row[4], row[5]
            facets = mi.MicrofacetDistribution(
                mi.MicrofacetType.GGX, dr.maximum(rough * rough, ROUGHEST), True
            )
            normal = dr.lerp(mi.Color3f(0.08 * specular), color, metallic)
            diffuse = color * (1 - metallic)
            share = dr.lerp(dr.select(specular > 0, 0.2, 0.0), 0.95, metallic)
            return facets, normal, diffuse, share

        def _value(self, wi: Any, wo: Any, lobes: tuple[Any, ...]) -> tuple[Any, Any]:
            """Return f cos(theta), and the density of the sampling."""
            facets, normal, diffuse, share = lobes
            h = dr.normalize(wi + wo)
            h = dr.select(h.z < 0, -h, h)
            toward = dr.maximum(dr.dot(wi, h), 1e-4)
            fresnel = normal + (1 - normal) * dr.power(1 - dr.minimum(toward, 1), 5)
            cosine = dr.maximum(wi.z, 1e-4)
            glossy = fresnel * facets.eval(h) * facets.G(wi, wo, h) / (4 * cosine)
            matte = diffuse * (1 - fresnel) * wo.z / dr.pi
            density = share * facets.pdf(wi, h) / (4 * toward) + (1 - share) * wo.z / dr.pi
            shown = (wi.z > 0) & (wo.z > 0)
            return dr.select(shown, glossy + matte, 0), dr.select(shown, density, 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ARG002
            """Return f cos(theta) and the density of `sample`."""
            color, rough, row = self._look(si)
            wi, out, _, _ = self._local(si, wo, row)
            value, density = self._value(wi, out, self._lobes(color, rough, row))
            shown = active & (si.wi.z * wo.z > 0)
            return dr.select(shown, value, 0), dr.select(shown, density, 0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return f cos(theta)."""
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return the density of `sample` per solid angle."""
            return self.eval_pdf(ctx, si, wo, active)[1]

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:  # noqa: ARG002
            """Draw a direction from one of the lobes, weighted by the density of both."""
            color, rough, row = self._look(si)
            wi, _, frame, side = self._local(si, si.wi, row)
            lobes = self._lobes(color, rough, row)
            facet, _ = lobes[0].sample(wi, sample2)
            mirrored = 2 * dr.dot(wi, facet) * mi.Vector3f(facet) - wi
            matte = mi.warp.square_to_cosine_hemisphere(sample2)
            out = dr.select(sample1 < lobes[3], mirrored, matte)
            value, density = self._value(wi, out, lobes)
            wo = si.to_local(frame.to_world(mi.Vector3f(out.x, out.y, out.z * side)))
            shown = active & (density > 0) & (si.wi.z * wo.z > 0)
            drawn = dr.zeros(mi.BSDFSample3f)
            drawn.wo = wo
            drawn.pdf = dr.select(shown, density, 0)
            drawn.eta = 1.0
            drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            drawn.sampled_component = 0
            return drawn, dr.select(shown, value / density, 0)

        def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
            """Return the base colour."""
            return dr.select(active, self._look(si)[0], 0)

        def traverse(self, callback: Any) -> None:
            """Expose nothing."""

        def to_string(self) -> str:
            """Return a name for messages."""
            return "Matter[]"

    return Matter

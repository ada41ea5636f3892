"""A Mitsuba material with the diffuse and Phong lobes of the shading equation, for path tracing."""

from functools import cache
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba


def phong_bsdf(reflectance: Array, specular: float, shininess: float) -> Any:
    """Return a two-sided material with f cos(theta) = (rho cos(theta) + k_s (r . l)^m) / pi.

    Under a point light this gives what `shading.shade` computes. The Phong lobe reflects at most
    2 k_s / (m + 1) of the light it receives. The material is of the current Mitsuba variant.
    """
    return _phong_class(mi.variant())(reflectance, specular, shininess)


@cache
def _phong_class(variant: str) -> Any:  # noqa: ARG001 - the key of the cache
    """Return the material's class, which must derive from the base class of the variant."""

    class Phong(mi.BSDF):  # type: ignore[misc]
        """The material. Sampling chooses lobes by their share of light at normal incidence."""

        def __init__(self, reflectance: Array, specular: float, shininess: float) -> None:
            mi.BSDF.__init__(self, mi.Properties())
            self.rho = mi.Color3f(*(float(c) for c in reflectance))
            self.specular, self.shininess = mi.Float(specular), mi.Float(shininess)
            lobe = 2 * specular / (shininess + 1)
            self.lobe_share = mi.Float(lobe / max(lobe + float(np.mean(reflectance)), 1e-6))
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            diffuse, glossy = mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection
            self.m_components = [diffuse | sides, glossy | sides]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def _oriented(self, si: Any, wo: Any) -> tuple[Any, Any, Any]:
            """Return incoming, outgoing and mirrored direction, flipped to the viewer's side."""
            side = dr.mulsign(mi.Float(1), si.wi.z)
            wi, wo = (mi.Vector3f(w.x, w.y, w.z * side) for w in (si.wi, wo))
            return wi, wo, mi.Vector3f(-wi.x, -wi.y, wi.z)

        def _density(self, wo: Any, mirrored: Any) -> Any:
            lobe = dr.power(dr.maximum(dr.dot(mirrored, wo), 0), self.shininess)
            glossy = lobe * (self.shininess + 1) / (2 * dr.pi)
            diffuse = mi.warp.square_to_cosine_hemisphere_pdf(wo)
            mixed = self.lobe_share * glossy + (1 - self.lobe_share) * diffuse
            return dr.select(wo.z > 0, mixed, 0)

        def eval(self, _ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return f cos(theta)."""
            _, wo, mirrored = self._oriented(si, wo)
            lobe = dr.power(dr.maximum(dr.dot(mirrored, wo), 0), self.shininess)
            value = (self.rho * wo.z + self.specular * lobe) / dr.pi
            return dr.select(active & (wo.z > 0), value, 0)

        def pdf(self, _ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return the probability density of `sample` per solid angle."""
            _, wo, mirrored = self._oriented(si, wo)
            return dr.select(active, self._density(wo, mirrored), 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return `eval` and `pdf`."""
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            """Draw a direction from one of the lobes, weighted by the density of both."""
            side = dr.mulsign(mi.Float(1), si.wi.z)
            mirrored = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z * side)
            cosine = dr.power(sample2.y, 1 / (self.shininess + 1))
            sine = dr.sqrt(dr.maximum(1 - cosine * cosine, 0))
            s, c = dr.sincos(2 * dr.pi * sample2.x)
            glossy = mi.Frame3f(mirrored).to_world(mi.Vector3f(sine * c, sine * s, cosine))
            diffuse = mi.warp.square_to_cosine_hemisphere(sample2)
            wo = dr.select(sample1 < self.lobe_share, glossy, diffuse)
            drawn = dr.zeros(mi.BSDFSample3f)
            drawn.wo = mi.Vector3f(wo.x, wo.y, wo.z * side)
            drawn.pdf = self.pdf(ctx, si, drawn.wo, active)
            drawn.eta = 1.0
            drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            drawn.sampled_component = 0
            active = active & (drawn.pdf > 0)
            value = self.eval(ctx, si, drawn.wo, active) / drawn.pdf
            return drawn, dr.select(active, value, 0)

        def traverse(self, callback: Any) -> None:
            """Expose the parameters."""
            for name in ("rho", "specular", "shininess", "lobe_share"):
                callback.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            """Return a name for messages."""
            return "Phong[]"

    return Phong

"""Exact surfaces of the basic shapes, as a few numbers each; the renderers cast rays at these.

All are in the frame of the unit shape, whose axis is y and whose bounding radius is 1.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
FAR = 2.0  # stands for a bound that a shape lacks; its points have no coordinate above 1


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A convex polyhedron: points p with low <= normal . p <= high for each of its slabs.

    Attributes:
        slabs: unit normal, low and high of each, (S, 5); low is -FAR where no face is opposite.
    """

    slabs: Array


@dataclass(frozen=True)
class Turned:
    """A convex body about the axis: x^2 + z^2 <= a + b y + c y^2 and low <= y <= high."""

    a: float
    b: float
    c: float
    low: float
    high: float


@dataclass(frozen=True)
class Capsule:
    """Points within `radius` of the axis from y = -half to y = half."""

    half: float
    radius: float


@dataclass(frozen=True)
class Torus:
    """Points within `tube` of the circle of radius `ring` about the axis, at y = 0."""

    ring: float
    tube: float


Surface = Polyhedron | Turned | Capsule | Torus


def polyhedron_of(planes: Array) -> Polyhedron:
    """Return the polyhedron n . p + d <= 0 for all planes, (F, 4) rows of a unit normal n and d.

    Planes may be given several times, as triangles of one face do; opposite ones make one slab.
    """
    slabs: list[list[float]] = []
    for *normal, offset in planes.tolist():
        for slab in slabs:
            cosine = float(np.dot(slab[:3], normal))
            if cosine > 1 - 1e-9:
                break
            if cosine < 1e-9 - 1:
                slab[3] = offset
                break
        else:
            slabs.append([*normal, -FAR, -offset])
    return Polyhedron(np.array(slabs))


def cone_of(base: float, apex: float, radius: float) -> Turned:
    """Return the cone with its base of this radius at y = base and its tip at y = apex."""
    slope = (radius / (apex - base)) ** 2
    return Turned(slope * apex**2, -2 * slope * apex, slope, base, apex)

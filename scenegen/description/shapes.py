"""The basic shapes: one record each, from which defaults, builders, tests and docs derive.

To add one: a record at the end of BASIC_SHAPES, not `drawn`, as files of today name what they were
drawn from; a function in `objects.basic_shapes`; a row in docs/data/basic-shapes.csv.
"""

import math
from typing import NamedTuple


class BasicShape(NamedTuple):
    """A basic shape.

    Attributes:
        name: as in `scenes.PlacedObject.shape`; `objects.basic_shapes` has a function `_name`.
        proportions: before scaling to bounding radius 1; axes are along y.
        volume: of the scaled solid, scene units cubed; None for a mesh that is not closed.
        curved: whether triangles only come near its surface.
        drawn: whether a data set shows it where no shapes are asked for.
    """

    name: str
    proportions: str
    volume: float | None
    curved: bool = False
    drawn: bool = True


_CYLINDER, _PYRAMID = 1.64**-0.5, 2.49**-0.5  # what scales them to bounding radius 1
_PRISM = (0.75 + 0.81 + 0.5625) ** -0.5
_ICOSAHEDRON = 4 / (10 + 2 * 5**0.5) ** 0.5  # edges of these two
_DODECAHEDRON = 4 / (3**0.5 * (1 + 5**0.5))
BASIC_SHAPES = (
    BasicShape("box", "a cube", 8 / 3**1.5),
    BasicShape("sphere", "the exact sphere", 4 / 3 * math.pi, curved=True),
    BasicShape("cone", "radius 1, height 2", math.pi / 3 * 0.5 * 2**0.5, curved=True),
    BasicShape(
        "torus", "circle of radius 0.68 around the axis, tube of radius 0.32",
        2 * math.pi**2 * 0.68 * 0.32**2, curved=True,
    ),
    BasicShape(
        "cylinder", "radius 0.8, height 2",
        math.pi * (0.8 * _CYLINDER) ** 2 * 2 * _CYLINDER, curved=True,
    ),
    BasicShape("teapot", "Newell's, with its lid; the spout is at +x", None, curved=True),
    BasicShape(
        "capsule", "cylinder of radius 0.5 and height 1, with half spheres at its ends",
        math.pi * 0.25 + 4 / 3 * math.pi * 0.125, curved=True,
    ),
    BasicShape("pyramid", "square base of side 2, height 1.4", 4 * 1.4 / 3 * _PYRAMID**3),
    BasicShape(
        "prism", "height 1.8; equilateral triangle with corners at distance 1 from the axis",
        0.75 * 3**0.5 * 1.8 * _PRISM**3,
    ),
    BasicShape("tetrahedron", "regular", 8 / (9 * 3**0.5)),
    BasicShape("octahedron", "regular", 4 / 3),
    BasicShape("dodecahedron", "regular", (15 + 7 * 5**0.5) / 4 * _DODECAHEDRON**3),
    BasicShape("icosahedron", "regular", 5 * (3 + 5**0.5) / 12 * _ICOSAHEDRON**3),
)  # fmt: skip

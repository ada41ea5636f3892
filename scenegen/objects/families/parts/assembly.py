"""Join parts into a unit shape: centred, of bounding radius 1, standing upright."""

from collections.abc import Sequence

import numpy as np

from scenegen.objects.families.parts.surfaces import Part, joined
from scenegen.objects.solids import Mesh, UnitShape

UPRIGHT = np.array([[0.0, -1.0, 0.0]])


def assemble(name: str, parts: Sequence[Part]) -> UnitShape:
    """Return the parts as one unit shape: its box centred at 0, its farthest corner at 1."""
    corners, faces, normals = joined([(part.vertices, part.faces, part.normals) for part in parts])
    center = np.array([(axis.min() + axis.max()) / 2 for axis in corners.T])
    corners -= center
    x, y, z = corners.T
    scale = 1.0 / float(np.sqrt((x * x + y * y + z * z).max()))
    corners *= scale
    hull = (np.concatenate([part.hull_points for part in parts]) - center) * scale
    discs = np.concatenate([part.hull_discs for part in parts]) * scale
    mesh = Mesh(corners, faces, normals)
    return UnitShape(name, lambda: mesh, hull, discs, 0.0, UPRIGHT)

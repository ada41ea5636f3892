"""Join parts into a unit shape: centred, of bounding radius 1, standing upright."""

from collections.abc import Sequence

import numpy as np

from scenegen.objects.families.parts.surfaces import Part
from scenegen.objects.solids import UnitShape

UPRIGHT = np.array([[0.0, -1.0, 0.0]])


def assemble(name: str, parts: Sequence[Part]) -> UnitShape:
    """Return the parts as one unit shape: its box centred at 0, its farthest corner at 1."""
    triangles = np.concatenate([part.triangles for part in parts])
    normals = np.concatenate([part.normals for part in parts])
    corners = triangles.reshape(-1, 3)
    center = np.array([(axis.min() + axis.max()) / 2 for axis in corners.T])
    corners -= center
    x, y, z = corners.T
    scale = 1.0 / float(np.sqrt((x * x + y * y + z * z).max()))
    corners *= scale
    hull = (np.concatenate([part.hull_points for part in parts]) - center) * scale
    discs = np.concatenate([part.hull_discs for part in parts]) * scale
    return UnitShape(name, lambda: (triangles, normals), hull, discs, 0.0, UPRIGHT)

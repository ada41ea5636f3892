"""Newell's teapot (the "Utah teapot") as bicubic Bezier patches.

The control points, with z up, are from M. Newell, "The Utilization of Procedure Models in Digital
Image Synthesis", PhD thesis, University of Utah, 1975, and those of the bottom from F. Crow, "The
Origins of the Teapot", IEEE CG&A 7(1), 1987. Surfaces of revolution are stored as profiles: rows
(r, t, z), for which a quarter turn has the control points (r, 0), (r, -t), (t, -r), (0, -r) at the
height z. Handle and spout are stored as halves (y <= 0) and mirrored.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

PROFILES = (  # rim, upper body, lower body, knob, lid, bottom
    ((1.4, 0.784, 2.4), (1.3375, 0.749, 2.53125), (1.4375, 0.805, 2.53125), (1.5, 0.84, 2.4)),
    ((1.5, 0.84, 2.4), (1.75, 0.98, 1.875), (2.0, 1.12, 1.35), (2.0, 1.12, 0.9)),
    ((2.0, 1.12, 0.9), (2.0, 1.12, 0.45), (1.5, 0.84, 0.225), (1.5, 0.84, 0.15)),
    ((0.0, 0.0, 3.15), (0.8, 0.45, 3.15), (0.0, 0.0, 2.85), (0.2, 0.112, 2.7)),
    ((0.2, 0.112, 2.7), (0.4, 0.224, 2.55), (1.3, 0.728, 2.55), (1.3, 0.728, 2.4)),
    ((1.5, 0.84, 0.15), (1.5, 0.84, 0.075), (1.425, 0.798, 0.0), (0.0, 0.0, 0.0)),
)

# Half tubes, four rows of four points: from the outer seam (y = 0) round to the inner one.
HALVES = (
    (  # handle, upper
        ((-1.6, 0.0, 2.025), (-1.6, -0.3, 2.025), (-1.5, -0.3, 2.25), (-1.5, 0.0, 2.25)),
        ((-2.3, 0.0, 2.025), (-2.3, -0.3, 2.025), (-2.5, -0.3, 2.25), (-2.5, 0.0, 2.25)),
        ((-2.7, 0.0, 2.025), (-2.7, -0.3, 2.025), (-3.0, -0.3, 2.25), (-3.0, 0.0, 2.25)),
        ((-2.7, 0.0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0.0, 1.8)),
    ),
    (  # handle, lower
        ((-2.7, 0.0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0.0, 1.8)),
        ((-2.7, 0.0, 1.575), (-2.7, -0.3, 1.575), (-3.0, -0.3, 1.35), (-3.0, 0.0, 1.35)),
        ((-2.5, 0.0, 1.125), (-2.5, -0.3, 1.125), (-2.65, -0.3, 0.9375), (-2.65, 0.0, 0.9375)),
        ((-2.0, 0.0, 0.9), (-2.0, -0.3, 0.9), (-1.9, -0.3, 0.6), (-1.9, 0.0, 0.6)),
    ),
    (  # spout, lower
        ((1.7, 0.0, 1.425), (1.7, -0.66, 1.425), (1.7, -0.66, 0.6), (1.7, 0.0, 0.6)),
        ((2.6, 0.0, 1.425), (2.6, -0.66, 1.425), (3.1, -0.66, 0.825), (3.1, 0.0, 0.825)),
        ((2.3, 0.0, 2.1), (2.3, -0.25, 2.1), (2.4, -0.25, 2.025), (2.4, 0.0, 2.025)),
        ((2.7, 0.0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0.0, 2.4)),
    ),
    (  # spout, upper
        ((2.7, 0.0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0.0, 2.4)),
        ((2.8, 0.0, 2.475), (2.8, -0.25, 2.475), (3.525, -0.25, 2.49375), (3.525, 0.0, 2.49375)),
        ((2.9, 0.0, 2.475), (2.9, -0.15, 2.475), (3.45, -0.15, 2.5125), (3.45, 0.0, 2.5125)),
        ((2.8, 0.0, 2.4), (2.8, -0.15, 2.4), (3.2, -0.15, 2.4), (3.2, 0.0, 2.4)),
    ),
)


def patches() -> NDArray[np.float64]:
    """Return the 32 control nets, y up, all with the same orientation, (32, 4, 4, 3)."""
    quarters = []
    for profile in PROFILES:
        quarter = np.array([((r, 0, z), (r, -t, z), (t, -r, z), (0, -r, z)) for r, t, z in profile])
        for cos, sin in ((1, 0), (0, -1), (-1, 0), (0, 1)):
            quarters.append(quarter @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]))
    # Mirroring turns a net inside out, so its columns are reversed as well.
    halves = np.array(HALVES, float)
    mirrored = (halves * (1, -1, 1))[:, :, ::-1]
    z_up = np.concatenate([quarters, halves, mirrored])
    return np.asarray(z_up[..., (0, 2, 1)] * (1, 1, -1))


def tessellate(divisions: int) -> tuple[Array, Array]:
    """Return the corners and corner normals of divisions^2 quadrilaterals a patch.

    Returns:
        corners, normals: (Q, 4, 3); corners run counter-clockwise seen from outside. Normals come
        from the patch's derivatives, taken slightly inside its edges as these vanish at the poles.
    """
    nets = patches()
    t = np.linspace(0, 1, divisions + 1)
    points = np.einsum("ai,bj,pijk->pabk", _bernstein(t), _bernstein(t), nets)
    s = np.clip(t, 1e-3, 1 - 1e-3)
    along_u = np.einsum("ai,bj,pijk->pabk", _derivative(s), _bernstein(s), nets)
    along_v = np.einsum("ai,bj,pijk->pabk", _bernstein(s), _derivative(s), nets)
    normals = np.cross(along_v, along_u)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)

    def quads(grid: Array) -> Array:
        around = [grid[:, :-1, :-1], grid[:, :-1, 1:], grid[:, 1:, 1:], grid[:, 1:, :-1]]
        return np.stack(around, axis=3).reshape(-1, 4, 3)

    return quads(points), quads(normals)


def turned_quads(divisions: int) -> int:
    """Return how many of the first quadrilaterals of `tessellate` are surfaces of revolution."""
    return 4 * len(PROFILES) * divisions**2


def _bernstein(t: Array) -> Array:
    s = 1 - t
    return np.stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3], axis=1)


def _derivative(t: Array) -> Array:
    s = 1 - t
    return 3 * np.stack([-(s**2), s**2 - 2 * s * t, 2 * s * t - t**2, t**2], axis=1)

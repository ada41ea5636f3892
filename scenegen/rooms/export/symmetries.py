"""Rotations that map a model to itself, as a data set of BOP lists them.

Pose errors of BOP take the best of all poses that look alike, so a model without its symmetries
counts right poses of a ball or a can as wrong.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
WITHIN = 0.01  # of the size: rounded parts are made of flat faces
SAMPLES = 8_000  # points of the surface
NEAREST = 8
FIRST = slice(4), slice(4, 24)  # of them are turned: few tell most rotations from symmetries
OTHERS = slice(24, 500)
FEW = 62  # corners of a convex hull whose corners, edges and faces may hold an axis
ORDERS = range(2, 13)
ANY_ANGLES = (0.41, 1.13, 2.3)  # radians; no fractions of a turn


@dataclass(frozen=True)
class Symmetries:
    """Rotations about lines through one point that map a surface to itself.

    Attributes:
        middle: the point, (3,).
        axes: unit vectors; rotations about these by any angle, (A, 3).
        rotations: all others, or those that are left when the first are divided out, (R, 3, 3).
    """

    middle: Array
    axes: Array
    rotations: Array

    def fields(self, scale: float) -> dict[str, Any]:
        """Return the fields of a model that is larger by this factor, without empty ones."""
        middle = scale * self.middle
        whole = np.tile(np.eye(4), (len(self.rotations), 1, 1))
        whole[:, :3, :3], whole[:, :3, 3] = self.rotations, middle - self.rotations @ middle
        lists = {
            "symmetries_continuous": [
                {"axis": axis, "offset": middle.tolist()} for axis in self.axes.tolist()
            ],
            "symmetries_discrete": [matrix.ravel().tolist() for matrix in whole],
        }
        return {name: values for name, values in lists.items() if values}


def symmetries(mesh: trimesh.Trimesh) -> Symmetries:
    """Return the rotations that move no point farther than WITHIN of the size from the surface.

    The size is the diagonal of the box. Axes go through the middle of the surface. Tried are x, y,
    z and their diagonals, and of a convex hull with at most FEW corners the lines through corners,
    edges and faces. With one axis of any angle, all others are a half turn across it at most.
    """
    points, faces = trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)
    normals, tree = mesh.face_normals[faces], cKDTree(points)
    within = WITHIN * float(mesh.scale)
    middle = mesh.triangles_center.T @ mesh.area_faces / mesh.area  # every symmetry keeps it

    def alike(turns: Array, some: slice) -> NDArray[np.bool_]:
        """Return which rotations, (T, 3, 3), leave some points where the surface is, (T,)."""
        moved = (points[some] - middle) @ turns.transpose(0, 2, 1) + middle
        apart, near = tree.query(moved, k=NEAREST)
        off = np.abs(((moved[..., None, :] - points[near]) * normals[near]).sum(axis=-1))
        # In the plane of a sample, and close to it. At an edge, others have the other side.
        return np.asarray(np.maximum(off, apart / 5.0).min(axis=-1).max(axis=-1) <= within)

    axes = [np.array(d, float) for d in product((1, 0, -1), repeat=3) if any(d)]
    axes = _each_once(axes)
    free = []
    for axis in axes:
        about = Rotation.from_rotvec(np.outer(ANY_ANGLES, axis)).as_matrix()
        if all(alike(about, some).all() for some in (*FIRST, OTHERS)):
            free.append(axis)
    turns = []
    if len(free) == 1:
        across = np.cross(free[0], np.roll(free[0], 1))
        turns = [np.pi * across / np.linalg.norm(across)]
    elif not free:
        angles = sorted({2.0 * np.pi * k / n for n in ORDERS for k in range(1, n)})
        turns = [t * a for a in _each_once([*axes, *_of_hull(mesh, middle)]) for t in angles]
    matrices = Rotation.from_rotvec(np.reshape(turns, (-1, 3))).as_matrix()
    for some in FIRST:
        matrices = matrices[alike(matrices, some)]
    found: list[Array] = []
    for matrix in matrices:
        new = all(np.abs(matrix - other).max() > 0.05 for other in found)
        if new and alike(matrix[None], OTHERS).all():
            found.append(matrix)
    ball = len(free) > 1
    return Symmetries(
        middle, np.eye(3) if ball else np.reshape(free, (-1, 3)), np.reshape(found, (-1, 3, 3))
    )


def _of_hull(mesh: trimesh.Trimesh, middle: Array) -> list[Array]:
    """Return directions from the middle to the corners, edges and faces of a simple convex hull."""
    hull = mesh.convex_hull
    if len(hull.vertices) > FEW:
        return []
    corners = np.asarray(hull.vertices) - middle
    return [*corners, *corners[hull.edges_unique].sum(axis=1), *hull.face_normals]


def _each_once(lines: list[Array]) -> list[Array]:
    """Return unit vectors of these lines through the origin, each once, without regard to sign."""
    axes: list[Array] = []
    for line in lines:
        length = float(np.linalg.norm(line))
        axis = line / max(length, 1e-9)
        if length > 1e-9 and all(abs(float(axis @ other)) < 1.0 - 1e-9 for other in axes):
            axes.append(axis)
    return axes

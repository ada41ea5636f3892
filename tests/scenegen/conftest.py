"""Fixtures that check the code under test by other means, and a folder of models."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

Array = NDArray[Any]


@pytest.fixture(scope="session")
def gap_between() -> Callable[[Array, Array], float]:
    """Width of a slab that separates the hulls of two sets of points; 0 where they overlap.

    A linear program over planes n . p = c, given the points that the last plane cut off, until it
    cuts off none.
    """

    def gap(a: Array, b: Array) -> float:
        n = b.mean(axis=0) - a.mean(axis=0)
        low, high = {int((a @ n).argmax())}, {int((b @ n).argmin())}
        for _ in range(100):
            below, above = a[sorted(low)], b[sorted(high)]  # n . below + m <= c <= n . above - m
            rows = np.vstack(
                [np.insert(below, 3, [[-1], [1]], axis=1), np.insert(-above, 3, [[1], [1]], axis=1)]
            )
            bounds = [(-1, 1)] * 3 + [(None, None)] * 2
            found = linprog([0, 0, 0, 0, -1], A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds)
            n, margin = found.x[:3], found.x[4]
            if margin < 1e-9:
                return 0.0
            first, last = int((a @ n).argmax()), int((b @ n).argmin())
            width = float((b[last] - a[first]) @ n) / float(np.linalg.norm(n))
            if width > 0 or (first in low and last in high):
                return max(width, 0.0)
            low.add(first)
            high.add(last)
        raise AssertionError("the linear programs do not settle")

    return gap


@pytest.fixture(scope="session")
def unit_corners() -> Callable[[str], Array]:
    """Corners of a unit shape's mesh, each once."""
    from scenegen.objects.basic_shapes import unit_shape
    from scenegen.objects.scene_mesh import welded

    return cache(lambda name: np.asarray(welded(unit_shape(name)).vertices))


@pytest.fixture(scope="session")
def world_corners(unit_corners: Callable[[str], Array]) -> Callable[[Any], Array]:
    """Corners of a placed object in the world, by SciPy's rotations."""
    from scipy.spatial.transform import Rotation

    def corners(item: Any) -> Array:
        w, x, y, z = item.rotation
        turned = Rotation.from_quat((x, y, z, w)).apply(unit_corners(item.shape))
        return np.asarray(item.position + item.scale * turned)

    return corners


@pytest.fixture(scope="session")
def scenes_of() -> Callable[..., list[Any]]:
    """The first so many scenes of a request whose first proposal finds room."""
    from scenegen.sampling.scenes import sample_scene

    def scenes(spec: Any, count: int) -> list[Any]:
        found: list[Any] = []
        for index in range(20 * count):
            scene = sample_scene(spec, index)
            if scene is not None and len(found) < count:
                found.append(scene)
        assert len(found) == count, "proposals fail too often"
        return found

    return scenes


@pytest.fixture(scope="session")
def model_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of nine models in two classes; no test changes it."""
    import trimesh

    root = tmp_path_factory.mktemp("models")
    for name in ("block", "round"):
        (root / name).mkdir()
    rng = np.random.default_rng(0)
    for i in range(5):
        trimesh.creation.box(rng.uniform(0.5, 1, 3)).export(root / "block" / f"{i}.obj")
    for i in range(4):
        trimesh.creation.torus(1, 0.2 + 0.1 * i).export(root / "round" / f"{i}.stl")
    return root


@pytest.fixture(scope="session")
def embree_cast() -> Callable[[str, Array, Array], tuple[Array, Array]]:
    """A `numpy_renderer.Cast` by trimesh and Embree; exact surfaces in closed form, in float64."""
    from trimesh import Trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector
    from trimesh.triangles import points_to_barycentric

    from scenegen.objects.basic_shapes import unit_shape
    from scenegen.rendering.numpy_renderer import smooth_normals
    from scenegen.rendering.surfaces.in_numpy import cast_at_surface

    @cache
    def intersector(name: str) -> Any:
        corners = unit_shape(name).triangles.reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        return RayMeshIntersector(Trimesh(corners, faces, process=False))

    def cast(name: str, origins: Array, directions: Array) -> tuple[Array, Array]:
        surface = unit_shape(name).surface
        if surface is not None:
            t, normals = cast_at_surface(surface, origins, directions)
            return t, -normals * np.sign(np.einsum("ri,ri->r", normals, directions))[:, None]
        t = np.full(len(origins), np.inf)
        triangle, weights = np.zeros(len(origins), np.int64), np.zeros((len(origins), 3))
        if len(origins):
            points, rays, faces = intersector(name).intersects_location(
                origins, directions, multiple_hits=False
            )
            along = directions[rays]
            t[rays] = np.einsum("ri,ri->r", points - origins[rays], along)
            t[rays] /= np.einsum("ri,ri->r", along, along)
            triangle[rays] = faces
            weights[rays] = points_to_barycentric(unit_shape(name).triangles[faces], points)
        u, v = weights[:, 1], weights[:, 2]
        return t, smooth_normals(unit_shape(name), triangle, u, v, directions)

    return cast


@pytest.fixture(scope="session")
def variant() -> str:
    """Put the fast variant in force; before that, no test may import Mitsuba or Dr.Jit."""
    from scenegen.rendering.backend import select_variant

    chosen = select_variant("auto")
    import mitsuba as mi

    mi.set_variant(chosen)
    return chosen

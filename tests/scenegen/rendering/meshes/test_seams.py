"""No ray slips through the edges between triangles, wherever a model is placed."""

import importlib
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.objects import cast_meshes
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.catalogue import built_in_shape

RAYS = 40_000
BASIC = ("box", "torus", "teapot", "icosahedron", "cone")
MODELS = ("mug/0001", "chair/0002", "bottle/0003", "bag/0004", "table/0005")


@pytest.fixture(scope="module")
def unit(variant):
    """Return the module of unit scenes, whose import needs the variant to be chosen."""
    return importlib.import_module("scenegen.rendering.meshes.unit_scene")


@pytest.fixture(scope="module")
def models(variant):
    """Return the module of models' scenes, whose import needs it, too."""
    return importlib.import_module("scenegen.rendering.meshes.model_scene")


def slips(unit, i, shape, seed=0):
    """Count rays that pass a point of an edge of a triangle that faces them."""
    import mitsuba as mi

    rng = np.random.default_rng(seed)
    face, corner = rng.integers(len(shape.triangles), size=RAYS), rng.integers(3, size=RAYS)
    triangles = shape.triangles[face].astype(np.float32).astype(float)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    start, end = (triangles[np.arange(RAYS), (corner + k) % 3] for k in (0, 1))
    target = start + rng.random((RAYS, 1)) * (end - start)
    direction = rng.standard_normal((RAYS, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    cosine = np.einsum("ri,ri->r", direction, normals)
    direction *= -np.sign(cosine)[:, None]
    origin = target - direction * rng.uniform(0.3, 1.0, (RAYS, 1))
    if unit.grid:
        origin = np.round(origin / unit.grid) * unit.grid
    direction = target - origin
    origin = origin + unit.offset[i]
    o, d = (mi.Vector3f(*(mi.Float(x) for x in v.T)) for v in (origin, direction))
    hit = unit.scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(o), d), coherent=False)
    late = np.asarray(hit.t) > 1 + 1e-4 / np.linalg.norm(direction, axis=1)
    return int((late & (abs(cosine) > 0.2)).sum())


@pytest.mark.parametrize("names", [MODELS, pytest.param(BASIC, marks=pytest.mark.slow)])
def test_no_ray_slips_through_models_and_without_overlap_some_do(
    names, variant, models, monkeypatch
):
    """At the middle of a lattice of 5 x 5 x 5, and at either end."""

    def count():
        own = partial(built_in_shape)  # models are kept by where they come from
        others = names[:1] * 50
        shown = [*names, *others, *names, *others, *names]
        meshes = [cast_meshes.cast_mesh(own(name).mesh) for name in shown]
        scene, offset = models.model_scene(variant, own, shown, meshes)
        unit = SimpleNamespace(scene=scene, offset=offset, grid=models.GRID)
        places = [k + start for start in (0, 55, 110) for k in range(5)]
        return sum(slips(unit, i, own(names[i % 55])) for i in places)

    assert count() == 0
    monkeypatch.setattr(cast_meshes, "OVERLAP", 0.0)
    assert count() > 3000


@pytest.mark.parametrize("count", [0, 1, 2, 9, 700, "most"])
def test_places_of_models_are_exact_in_single_precision(count, variant, models):
    """Coordinates stay below 16, so that every point of the grid is a float32."""
    count = models.MOST_MODELS if count == "most" else count
    mesh = cast_meshes.cast_mesh(unit_shape("tetrahedron").mesh)
    _, offset = models.model_scene(variant, unit_shape, ["tetrahedron"] * count, [mesh] * count)
    assert abs(offset).max() + 1.0002 < 2.0**24 * models.GRID
    np.testing.assert_array_equal(np.round(offset / models.GRID) * models.GRID, offset)
    assert len(np.unique(offset, axis=0)) == max(1, count)
    if count > 1:
        gaps = np.diff(np.unique(offset[:, 2]))
        assert gaps.min() > 2.0004, "their bounding spheres, a bit enlarged, are apart"

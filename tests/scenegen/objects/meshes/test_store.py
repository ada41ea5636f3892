"""Models as unit shapes: their surface, their hull, and the store that keeps them."""

from unittest.mock import Mock

import numpy as np
import pytest
import trimesh
from shape_checks import (
    DOWN,
    check_body,
    check_centred,
    check_size,
    first_hits,
    rays_inwards,
    support,
    unit_triangles,
    unit_vectors,
)

from scenegen.objects.coarse_hulls import coarse_hull
from scenegen.objects.meshes import hull
from scenegen.objects.meshes import models as model_files
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.folders import open_objects
from scenegen.objects.meshes.hull import hull_points
from scenegen.objects.meshes.store import MeshStore
from scenegen.objects.solids import Mesh, UnitShape


def bumpy(seed, faces=1280):
    """A ball with dents, off its centre, without any symmetry."""
    mesh = trimesh.creation.icosphere(subdivisions={320: 2, 1280: 3, 5120: 4, 81920: 6}[faces])
    rng = np.random.default_rng(seed)
    waves = np.sin(mesh.vertices @ rng.uniform(-4, 4, (3, 5))).sum(axis=1)
    mesh.vertices = mesh.vertices * (3 + 0.3 * waves)[:, None] * (1, 2, 0.7) + (50, -20, 7)
    return mesh


@pytest.fixture
def models(tmp_path):
    root = tmp_path / "models"
    for name, seeds in (("odd", range(4)), ("other", range(4, 6))):
        (root / name).mkdir(parents=True)
        for seed in seeds:
            (root / name / f"{seed}.ply").write_bytes(bumpy(seed).export(file_type="ply"))
    (root / "odd" / "bad.obj").write_text("v 1 2 3\n")
    return root


@pytest.fixture
def opened(models, tmp_path):
    return lambda: MeshStore(open_objects(models), tmp_path / "cache")


def check_shape(shape):
    """Check what holds for every model: size, exact values, flat normals, and its hull."""
    triangles = shape.triangles
    assert triangles.dtype == np.float64
    np.testing.assert_array_equal(triangles, triangles.astype(np.float32), "exact in float32")
    check_size(shape, 1e-6)
    check_centred(triangles.reshape(-1, 3), 1e-6)
    edges = triangles[:, 1:] - triangles[:, :1]
    np.testing.assert_allclose(edges @ shape.normals.transpose(0, 2, 1), 0, atol=1e-9)
    cross = np.cross(edges[:, 0], edges[:, 1])
    assert (np.einsum("fi,fki->fk", cross, shape.normals) > 0).all()
    check_hull(shape)
    assert shape.rounding == 0.0
    np.testing.assert_array_equal(shape.hull_discs, np.zeros(len(shape.hull_points)))
    np.testing.assert_array_equal(shape.resting_directions, DOWN)


def check_hull(shape):
    check_body(shape, shape.triangles, 0.03, unit_vectors(500), slack=1e-9)
    assert support(shape, DOWN)[0] == -shape.triangles[..., 1].min(), "it stands exactly"


def test_models_are_unit_shapes(opened):
    models = opened()
    for name in ("odd/0", "odd/3", "other/5"):
        shape = models.shape(name)
        assert shape.name == name
        assert len(shape.triangles) == 1280
        check_shape(shape)
        assert len(shape.hull_points) < 642


def test_the_surface_is_the_file_s(opened):
    """Cast Embree's rays at trimesh's reading of the file, normalised here."""
    models, rays = opened(), rays_inwards(4000)
    for file in models.folder.models["odd"][:3]:
        mesh = trimesh.load_mesh(file.path, process=False)
        expected, face = first_hits(unit_triangles(mesh), *rays)
        shape = models.shape(file.name)
        found, index = first_hits(shape.triangles, *rays)
        hit = np.isfinite(expected)
        assert hit.mean() > 0.5
        np.testing.assert_array_equal(hit, np.isfinite(found))
        np.testing.assert_allclose(found[hit], expected[hit], atol=1e-4)
        along = np.abs(np.einsum("fi,fi->f", shape.normals[index, 0], mesh.face_normals[face]))
        assert np.median(along[hit]) > 1 - 1e-6
        assert (along[hit] > 0.999).mean() > 0.98, "elsewhere rays meet the edge of two faces"


def test_a_coarser_hull_holds_the_model_and_stands_where_it_stands():
    angle = np.linspace(0, 6.28, 5000)
    disc = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    ball = trimesh.creation.icosphere(subdivisions=6).vertices
    drum = np.concatenate([disc, disc + np.array([0, 1, 0])])
    for corners in (bumpy(3, 81920).vertices, ball, drum):
        centered = corners - (corners.min(axis=0) + corners.max(axis=0)) / 2
        points = np.asarray(centered / np.linalg.norm(centered, axis=1).max())
        body = hull_points(points)
        mesh = Mesh(points, np.arange(len(points))[:, None], None)
        shape = UnitShape("x", lambda mesh=mesh: mesh, body, np.zeros(len(body)), 0.0, DOWN)
        check_hull(shape)
        assert len(body) < 2 * hull.MOST_POINTS
        assert body[:, 1].min() == points[:, 1].min(), "nothing below the floor"


def test_a_hair_below_a_level_base_is_not_lost_in_rounding():
    angle = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    rings = [np.stack([np.cos(angle), y + 0 * angle, np.sin(angle)], 1) for y in (-0.5, 0.5)]
    for depth in np.geomspace(1e-15, 1e-10, 30):
        points = np.concatenate([*rings, [(0.1, -0.5 - depth, 0.2)]])
        assert hull_points(points)[:, 1].min() == -0.5 - depth


@pytest.mark.parametrize("turn", [0.0, 0.3])
@pytest.mark.parametrize("side", [0, 2])
def test_flat_models_have_hulls(turn, side, tmp_path):
    """An upright or leaning disc along either axis."""
    disc = trimesh.creation.icosphere(subdivisions=3).vertices
    disc[:, side] = 0.0
    disc = disc @ trimesh.transformations.rotation_matrix(turn, (1, 1, 0))[:3, :3].T
    faces = trimesh.creation.icosphere(subdivisions=3).faces
    (tmp_path / "flat").mkdir()
    mesh = trimesh.Trimesh(disc, faces, process=False)
    (tmp_path / "flat" / "disc.ply").write_bytes(mesh.export(file_type="ply"))
    check_shape(MeshStore(open_objects(tmp_path), None).shape("flat/disc"))


def test_refusals_are_remembered(opened):
    models = opened()
    models.shape("odd/0")
    assert models.problems == {}
    for ask in (models.shape, models.digest, models.shape):
        with pytest.raises(BadMeshError) as refused:
            ask("odd/bad")
        assert str(refused.value) == f"odd/bad: {models.problems['odd/bad']}"
    (models.folder.models["odd"][-1].path).write_bytes(bumpy(0).export(file_type="obj").encode())
    with pytest.raises(BadMeshError):  # the answer stays the same within one run
        models.shape("odd/bad")
    with pytest.raises(BadMeshError) as refused:
        models.shape("odd/none")
    assert (refused.value.where, refused.value.found) == ("model", "'odd/none'")
    models.folder.models["odd"][1].path.unlink()
    with pytest.raises(BadMeshError) as refused:
        models.shape("odd/1")
    assert refused.value.where == "odd/1: file"
    assert set(models.problems) == {"odd/bad", "odd/1"}


def test_a_coarse_body_is_kept(models, tmp_path, monkeypatch):
    """It is the same when it comes from the cache, where it is not computed again."""
    monkeypatch.setattr(model_files, "MOST_CORNERS", 100)
    shapes = [MeshStore(open_objects(models), tmp_path / "cache").shape("odd/0") for _ in range(2)]
    hull = np.column_stack([shapes[0].hull_points, shapes[0].hull_discs])
    expected = coarse_hull(hull)
    counted = Mock(wraps=coarse_hull)
    monkeypatch.setattr(model_files, "coarse_hull", counted)
    shapes.append(MeshStore(open_objects(models), tmp_path / "cache").shape("odd/0"))
    for shape in shapes:
        np.testing.assert_array_equal(shape.coarse[0], expected[0])
        assert shape.coarse[1] == expected[1]
    assert counted.call_count == 0

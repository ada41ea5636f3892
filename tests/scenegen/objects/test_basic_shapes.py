"""The basic shapes against closed forms, the room, and the mesh of a whole scene."""

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation
from shape_checks import check_body, check_size, unit_vectors

from scenegen.common.rotations import rotation_matrix
from scenegen.description.names import SHAPE_NAMES
from scenegen.description.shapes import BASIC_SHAPES
from scenegen.objects import basic_hulls
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.scene_mesh import welded, world_from_object

SOLID = [shape for shape in BASIC_SHAPES if shape.volume]  # the teapot has no seam at its lid
CURVED = [shape.name for shape in SOLID if shape.curved]
TESSELLATION = 4.5e-5  # the most that a unit mesh may lie off its smooth surface
CYLINDER = 1.64**-0.5  # its scale
SIDES = {"box": 6, "pyramid": 5, "prism": 5, "tetrahedron": 4, "octahedron": 8}
SIDES |= {"dodecahedron": 12, "icosahedron": 20, "torus": 2, "sphere": 0}


def off_surface(name, p):
    """Signed distance of points near the smooth surface, positive outside."""
    r, y = np.hypot(p[..., 0], p[..., 2]), p[..., 1]
    if name == "sphere":
        return np.hypot(r, y) - 1
    if name == "torus":
        return np.hypot(r - 0.68, y) - 0.32
    if name == "capsule":
        return np.hypot(r, np.maximum(abs(y) - 0.5, 0)) - 0.5
    if name == "cylinder":
        return np.maximum(r - 0.8 * CYLINDER, abs(y) - CYLINDER)
    return np.maximum(-y - 0.5**0.5, (2 * r + y - 0.5**0.5) / 5**0.5)  # cone


@pytest.mark.parametrize("name", SHAPE_NAMES)
def test_bounding_radius_is_one_and_normals_agree_with_faces(name):
    shape = unit_shape(name)
    assert shape.name == name
    assert unit_shape(name) is shape, "built once"
    check_size(shape, 3e-8 if name == "teapot" else 1e-12)
    face = np.cross(*(shape.triangles[:, i] - shape.triangles[:, 0] for i in (1, 2)))
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    agreement = np.einsum("fi,fki->fk", face, shape.normals).min()
    assert agreement > (0.9 if name == "teapot" else 0.9999)


@pytest.mark.parametrize("solid", SOLID, ids=lambda shape: shape.name)
def test_solids_are_closed_and_have_the_volume_of_their_formula(solid):
    mesh = welded(unit_shape(solid.name))
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    missing = solid.volume - mesh.volume
    if solid.curved:
        assert 0 < missing < TESSELLATION * mesh.area
    else:
        assert missing == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", CURVED)
def test_curved_meshes_follow_the_smooth_surface(name):
    shape = unit_shape(name)
    assert abs(off_surface(name, shape.triangles)).max() < 1e-12
    middles = (shape.triangles + np.roll(shape.triangles, 1, axis=1)) / 2
    centers = shape.triangles.mean(axis=1)
    for points in (middles, centers):
        assert abs(off_surface(name, points)).max() < TESSELLATION
    rng = np.random.default_rng(1)
    some = rng.choice(len(centers), 2000)
    p = shape.triangles[some] * (1 - 1e-3) + centers[some, None] * 1e-3  # not on rims
    gradient = np.stack(
        [off_surface(name, p + e) - off_surface(name, p - e) for e in 1e-6 * np.eye(3)], axis=-1
    )
    np.testing.assert_allclose(shape.normals[some], gradient / 2e-6, atol=7e-3)  # half a facet


def test_the_teapot_is_open_at_its_seams_only():
    mesh = welded(unit_shape("teapot"))
    assert mesh.is_winding_consistent
    users = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)[1]
    assert users.max() == 2
    assert np.count_nonzero(users == 1) == 2 * 4 * 32 + 4 * 2 * 32  # rim, lid; handle and spout
    assert 0.7 < mesh.volume < 0.75


@pytest.mark.parametrize("name", SHAPE_NAMES)
def test_support_bounds_the_mesh_closely(name):
    shape, most = unit_shape(name), 3e-3 if name == "teapot" else 5e-5
    rounding = 3e-8 if name == "teapot" else 0  # its triangles are rounded after the body
    check_body(shape, (1 - rounding) * welded(shape).vertices, most, unit_vectors(200))


@pytest.mark.parametrize("name", SHAPE_NAMES)
def test_bodies_stay_on_every_resting_side(name):
    """The centre of mass projects to a convex combination of the points that touch the floor."""
    shape, mesh = unit_shape(name), welded(unit_shape(name))
    solid = mesh.convex_hull if name == "teapot" else mesh
    sides = shape.resting_directions
    if name in SIDES:
        assert len(sides) == SIDES[name]
    for down in sides[:: max(1, len(sides) // 20)]:
        assert np.linalg.norm(down) == pytest.approx(1.0, abs=1e-8)
        reach = mesh.vertices @ down
        touching = mesh.vertices[reach > reach.max() - 1e-7]
        foot = solid.center_mass + (reach.max() - solid.center_mass @ down) * down
        rows = np.vstack([touching.T, np.full(len(touching), 10.0)])
        assert nnls(rows, np.append(foot, 10.0))[1] < 2e-6, down


def test_rotations_are_scipys():
    turns = Rotation.random(20, rng=1)
    for turn, (x, y, z, w) in zip(turns.as_matrix(), turns.as_quat(), strict=True):
        np.testing.assert_allclose(rotation_matrix((w, x, y, z)), turn, atol=1e-12)
        matrix = world_from_object((1.0, 2.0, 3.0), (w, x, y, z), 0.5)
        np.testing.assert_allclose(matrix[:3], np.c_[0.5 * turn, [1, 2, 3]], atol=1e-12)
        np.testing.assert_array_equal(matrix[3], [0, 0, 0, 1])


@pytest.mark.parametrize("name", SHAPE_NAMES)
def test_hulls_that_are_kept_are_those_of_qhull(name, monkeypatch):
    monkeypatch.setattr(basic_hulls, "all_kept", dict)
    expected, shape = unit_shape.__wrapped__(name), unit_shape(name)
    for field in ("hull_points", "hull_discs", "resting_directions"):
        np.testing.assert_allclose(getattr(shape, field), getattr(expected, field), atol=1e-9)
    np.testing.assert_allclose(shape.triangles, expected.triangles, atol=1e-9)
    np.testing.assert_allclose(shape.normals, expected.normals, atol=1e-9)
    if hasattr(shape.surface, "slabs"):
        np.testing.assert_allclose(shape.surface.slabs, expected.surface.slabs, atol=1e-9)

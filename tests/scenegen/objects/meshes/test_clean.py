"""Cleaning: every defect of real meshes on a small example, and the surface that is left."""

import numpy as np
import pytest
import trimesh
from shape_checks import check_centred, first_hits, rays_inwards, unit_triangles

from scenegen.objects.meshes import clean
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError

BALL = trimesh.creation.icosphere(subdivisions=2)
BOX = trimesh.creation.box((1.0, 2.0, 3.0))


def check_whole(mesh):
    """Check what holds for every clean mesh."""
    vertices = mesh.vertices.astype(float)
    assert mesh.vertices.dtype == np.float32
    assert mesh.faces.dtype == np.int32
    assert np.linalg.norm(vertices, axis=1).max() == pytest.approx(1, abs=1e-6)
    check_centred(vertices, 2e-6)
    assert len(np.unique(mesh.vertices, axis=0)) == len(vertices), "merged"
    assert set(mesh.faces.ravel().tolist()) == set(range(len(vertices))), "all used"
    assert len({frozenset(face) for face in mesh.faces.tolist()}) == len(mesh.faces), "no doubles"
    assert all(len(set(face)) == 3 for face in mesh.faces.tolist())
    triangles = vertices[mesh.faces]
    edges = np.roll(triangles, -1, axis=1) - triangles
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    assert (area / np.linalg.norm(edges, axis=2).max(axis=1) >= clean.NARROWEST).all()
    assert not np.signbit(mesh.vertices[mesh.vertices == 0]).any()


def same_surface(a, b):
    """Check that rays see no difference, but for a few that graze an edge of the silhouette."""
    one, two = (first_hits(triangles, *rays_inwards(3000))[0] for triangles in (a, b))
    assert np.isfinite(one).mean() > 0.2, "the rays miss: a weak test"
    differ = ~np.isclose(one, two, atol=2e-5)
    assert differ.mean() < 0.003, f"{differ.sum()} rays differ"


@pytest.mark.parametrize("scale", [1e-20, 0.3, 1.0, 2000.0, 1e20])
@pytest.mark.parametrize("shift", [(0, 0, 0), (5e3, -7e3, 1e4)])
def test_odd_scales_and_places(scale, shift):
    mesh = clean_mesh((BOX.vertices + shift) * scale, BOX.faces)
    check_whole(mesh)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.array([2, 4, 6]) / 14**0.5)
    assert sum(mesh.mended.values()) == 0


def test_z_up_is_turned_not_mirrored():
    mesh = clean_mesh(BOX.vertices, BOX.faces, "z")
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.array([2, 6, 4]) / 14**0.5)
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)  # front is -y, up is z
    mesh = clean_mesh(vertices, [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)], "z")
    top = mesh.vertices[mesh.vertices[:, 1].argmax()]
    back = mesh.vertices[mesh.vertices[:, 2].argmin()]
    # y of the file goes to -z, z to y: a turn about x by -90 degrees
    np.testing.assert_allclose(top, (-1, 1, 1) / np.sqrt(3), atol=1e-6)
    np.testing.assert_allclose(back, (-1, -1, -1) / np.sqrt(3), atol=1e-6)


def with_nan(v, f):
    more = np.array([(np.nan, 0, 0), (np.inf, 1, 1), (1e300, 0, 0)])
    return np.concatenate([v, more]), np.concatenate([f, len(v) + np.array([(0, 0, 1), (1, 2, 2)])])


DEFECTS = {
    "not merged": (lambda v, f: (v[f].reshape(-1, 3), np.arange(f.size)), {"merged_vertices": 798}),
    "inverted winding": (lambda v, f: (v, f[:, ::-1]), {}),
    "mixed winding": (lambda v, f: (v, np.concatenate([f[::2], f[1::2, ::-1]])), {}),
    "double faces": (lambda v, f: (v, np.concatenate([f, f])), {"double_faces": 320}),
    "double faces, back to back": (
        lambda v, f: (v, np.concatenate([f, f[:, [1, 0, 2]], f[:9, [2, 0, 1]]])),
        {"double_faces": 329},
    ),
    "double faces, not merged": (
        lambda v, f: (np.concatenate([v, v]), np.concatenate([f, len(v) + f[:, ::-1]])),
        {"double_faces": 320, "merged_vertices": 162},
    ),
    "repeated corners": (
        lambda v, f: (v, np.concatenate([f, f[:5, [0, 0, 1]], f[:5, [1, 1, 1]]])),
        {"degenerate_faces": 10},
    ),
    "on a line": (
        lambda v, f: (np.concatenate([v, 0.3 * v[:1] + 0.7 * v[1:2]]), np.vstack([f, [0, 162, 1]])),
        {"degenerate_faces": 1, "unused_vertices": 1},
    ),
    "slivers": (
        lambda v, f: (np.concatenate([v, v[:1] + 3e-8]), np.vstack([f, [0, 162, 1]])),
        {"degenerate_faces": 1, "unused_vertices": 1},
    ),
    "a sliver that sticks out": (
        lambda v, f: (np.vstack([v, [9, 9, 9], [9, 9, 9.000001]]), np.vstack([f, [0, 162, 163]])),
        {"degenerate_faces": 1, "unused_vertices": 2},
    ),
    "a line that sticks out far": (
        lambda v, f: (np.concatenate([v, [(9e9, 0, 0)]]), np.vstack([f, [0, 162, 162]])),
        {"degenerate_faces": 1, "unused_vertices": 1},
    ),
    "loose vertices": (lambda v, f: (np.concatenate([v, [(99, 0, 0)]]), f), {"unused_vertices": 1}),
    "not finite": (with_nan, {"faces_not_finite": 2, "unused_vertices": 3}),
    "out of range": (
        lambda v, f: (v, np.vstack([f, [0, 1, 162], [-1, 0, 1], [0, 1, 2**40]])),
        {"faces_out_of_range": 3},
    ),
    "corners minus zero": (lambda v, f: (np.where(v == 0, -0.0, v), f), {}),
}


@pytest.mark.parametrize(("break_it", "expected"), DEFECTS.values(), ids=DEFECTS.keys())
def test_defects_are_mended_and_counted(break_it, expected):
    mesh = clean_mesh(*break_it(np.array(BALL.vertices), np.array(BALL.faces)))
    check_whole(mesh)
    assert {name: count for name, count in mesh.mended.items() if count} == expected
    assert len(mesh.faces) == 320
    same_surface(mesh.vertices[mesh.faces], unit_triangles(BALL))


def test_what_is_clean_stays_as_it_is_to_the_bit():
    once = clean_mesh(BALL.vertices, BALL.faces)
    twice = clean_mesh(once.vertices, once.faces)
    np.testing.assert_array_equal(twice.vertices, once.vertices)
    np.testing.assert_array_equal(twice.faces, once.faces)


def test_edges_of_three_faces_and_lone_corners_may_stay():
    """Not manifold: three sheets at one edge, and two boxes that share a corner."""
    sheets = np.array([(0, 0, 0), (0, 1, 0), (1, 0, 0), (-1, 0.5, 1), (-1, 0.5, -1)], float)
    mesh = clean_mesh(sheets, [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    check_whole(mesh)
    assert len(mesh.faces) == 3
    other = BOX.copy()
    other.apply_translation(BOX.extents)
    both = trimesh.util.concatenate([BOX, other])
    mesh = clean_mesh(both.vertices, both.faces)
    assert len(mesh.faces) == 24
    assert len(mesh.vertices) == 15


@pytest.mark.parametrize(
    ("vertices", "faces", "where", "found"),
    [
        (np.empty((0, 3)), np.empty((0, 3), int), "faces", "0 vertices"),
        (BOX.vertices, np.empty((0, 3), int), "faces", "8 vertices"),
        (np.empty((0, 3)), BOX.faces, "faces", "12 faces out of range"),
        (BOX.vertices * np.nan, BOX.faces, "faces", "12 faces not finite"),
        (BOX.vertices * 0, BOX.faces, "faces", "12 degenerate faces"),
        (BOX.vertices * (1, 0, 0), BOX.faces, "faces", "12 degenerate faces"),
        (BOX.vertices * 1e-200, BOX.faces, "faces", "12 degenerate faces"),
        (BOX.vertices * (1, 0, 1), BOX.faces, "height", "none"),
        (BOX.vertices * (1, 1e-5, 1), BOX.faces, "height", "none"),
        (BOX.vertices, np.zeros((2_000_001, 3), int), "faces", "2000001"),
    ],
)
def test_what_cannot_be_used_is_refused_with_a_reason(vertices, faces, where, found):
    with pytest.raises(BadMeshError) as refused:
        clean_mesh(vertices, faces)
    assert refused.value.where == where
    assert found in refused.value.found

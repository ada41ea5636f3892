"""Cleaning: every defect of real meshes on a small example, and the surface that is left."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from scenegen.objects.meshes import clean
from scenegen.objects.meshes.clean import CleanMesh, clean_mesh
from scenegen.objects.meshes.errors import BadMeshError

Array = NDArray[Any]
BALL = trimesh.creation.icosphere(subdivisions=2)
BOX = trimesh.creation.box((1.0, 2.0, 3.0))


def clean_of(mesh: trimesh.Trimesh, up: str = "y") -> CleanMesh:
    return clean_mesh(mesh.vertices, mesh.faces, up)


def check_whole(mesh: CleanMesh) -> None:
    """Check what holds for every clean mesh."""
    vertices = mesh.vertices.astype(float)
    assert mesh.vertices.dtype == np.float32
    assert mesh.faces.dtype == np.int32
    assert np.linalg.norm(vertices, axis=1).max() == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(vertices.min(axis=0) + vertices.max(axis=0), 0, atol=2e-6)
    assert len(np.unique(mesh.vertices, axis=0)) == len(vertices), "merged"
    assert set(mesh.faces.ravel().tolist()) == set(range(len(vertices))), "all used"
    assert len({frozenset(face) for face in mesh.faces.tolist()}) == len(mesh.faces), "no doubles"
    assert all(len(set(face)) == 3 for face in mesh.faces.tolist())
    triangles = vertices[mesh.faces]
    edges = np.roll(triangles, -1, axis=1) - triangles
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    assert (area / np.linalg.norm(edges, axis=2).max(axis=1) >= clean.NARROWEST).all()
    assert not np.signbit(mesh.vertices[mesh.vertices == 0]).any()


def first_hits(triangles: Array, seed: int = 0, count: int = 3000) -> Array:
    """Return Embree's distances along rays into the unit sphere; inf where nothing is hit."""
    rng = np.random.default_rng(seed)
    origins, targets = rng.standard_normal((2, count, 3))
    origins *= 2 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = 0.3 * targets - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    corners = np.asarray(triangles, float).reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    caster = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)
    points, rays, _ = caster.intersects_location(origins, directions, multiple_hits=False)
    distance = np.full(count, np.inf)
    distance[rays] = np.linalg.norm(points - origins[rays], axis=1)
    return distance


def unit_triangles(mesh: trimesh.Trimesh) -> Array:
    """A mesh brought to unit size by trimesh's own numbers, in double precision."""
    centered = mesh.triangles - mesh.bounds.mean(axis=0)
    return np.asarray(centered / np.linalg.norm(centered, axis=2).max())


def same_surface(a: Array, b: Array) -> None:
    """Check that rays see no difference, but for a few that graze an edge of the silhouette."""
    one, two = first_hits(a), first_hits(b)
    assert np.isfinite(one).mean() > 0.2, "the rays miss: a weak test"
    differ = ~np.isclose(one, two, atol=2e-5)
    assert differ.mean() < 0.003, f"{differ.sum()} rays differ"


def soup(mesh: trimesh.Trimesh) -> tuple[Array, Array]:
    """Return a mesh whose triangles share no vertices."""
    corners = np.asarray(mesh.triangles.reshape(-1, 3))
    return corners, np.arange(len(corners)).reshape(-1, 3)


@pytest.mark.parametrize("scale", [1e-20, 0.3, 1.0, 2000.0, 1e20])
@pytest.mark.parametrize("shift", [(0, 0, 0), (5e3, -7e3, 1e4)])
def test_odd_scales_and_places(scale: float, shift: tuple[float, ...]) -> None:
    mesh = clean_mesh((BOX.vertices + shift) * scale, BOX.faces)
    check_whole(mesh)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.array([2, 4, 6]) / 14**0.5)
    assert sum(mesh.mended.values()) == 0


def test_z_up_is_turned_not_mirrored() -> None:
    mesh = clean_mesh(*soup(BOX), "z")
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.array([2, 6, 4]) / 14**0.5)
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)  # front is -y, up is z
    mesh = clean_mesh(vertices, [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)], "z")
    middle = mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)
    np.testing.assert_allclose(middle, 0, atol=1e-6)
    top = mesh.vertices[mesh.vertices[:, 1].argmax()]
    right = mesh.vertices[mesh.vertices[:, 0].argmax()]
    back = mesh.vertices[mesh.vertices[:, 2].argmin()]
    assert np.linalg.det([right - top, top - back, back + 2 * top]) != 0
    # y of the file goes to -z, z to y: a turn about x by -90 degrees
    np.testing.assert_allclose(top, (-1, 1, 1) / np.sqrt(3), atol=1e-6)
    np.testing.assert_allclose(back, (-1, -1, -1) / np.sqrt(3), atol=1e-6)


def with_nan(v: Array, f: Array) -> tuple[Array, Array]:
    more = np.array([(np.nan, 0, 0), (np.inf, 1, 1), (1e300, 0, 0)])
    return np.concatenate([v, more]), np.concatenate([f, len(v) + np.array([(0, 0, 1), (1, 2, 2)])])


DEFECTS: dict[str, tuple[Callable[[Array, Array], tuple[Array, Array]], dict[str, int]]] = {
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
        lambda v, f: (
            np.concatenate([v, [(9, 9, 9), (9, 9, 9.000001)]]),
            np.vstack([f, [0, 162, 163]]),
        ),
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
def test_defects_are_mended_and_counted(
    break_it: Callable[[Array, Array], tuple[Array, Array]], expected: dict[str, int]
) -> None:
    mesh = clean_mesh(*break_it(np.array(BALL.vertices), np.array(BALL.faces)))
    check_whole(mesh)
    assert {name: count for name, count in mesh.mended.items() if count} == expected
    assert len(mesh.faces) == 320
    same_surface(mesh.vertices[mesh.faces], unit_triangles(BALL))


def test_what_is_clean_stays_as_it_is_to_the_bit() -> None:
    once = clean_of(BALL)
    twice = clean_mesh(once.vertices, once.faces)
    np.testing.assert_array_equal(twice.vertices, once.vertices)
    np.testing.assert_array_equal(twice.faces, once.faces)


def test_edges_of_three_faces_and_lone_corners_may_stay() -> None:
    """Not manifold: three sheets at one edge, and two boxes that share a corner."""
    sheets = np.array([(0, 0, 0), (0, 1, 0), (1, 0, 0), (-1, 0.5, 1), (-1, 0.5, -1)], float)
    mesh = clean_mesh(sheets, [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    check_whole(mesh)
    assert len(mesh.faces) == 3
    other = BOX.copy()
    other.apply_translation(BOX.extents)
    mesh = clean_of(trimesh.util.concatenate([BOX, other]))
    assert len(mesh.faces) == 24
    assert len(mesh.vertices) == 15


def test_an_open_sheet_that_stands_is_a_model() -> None:
    mesh = clean_mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)])
    check_whole(mesh)
    assert len(mesh.faces) == 2


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
def test_what_cannot_be_used_is_refused_with_a_reason(
    vertices: Array, faces: Array, where: str, found: str
) -> None:
    with pytest.raises(BadMeshError) as refused:
        clean_mesh(vertices, faces)
    assert refused.value.where == where
    assert found in refused.value.found


def test_many_faces_and_many_parts() -> None:
    """A terrain of 200,000 faces, and 4,000 boxes, each triangle with corners of its own."""
    side = np.arange(317)
    x, z = np.meshgrid(side, side)
    terrain = np.stack([x, 40 * np.sin(x / 30) * np.cos(z / 40), z], axis=-1).reshape(-1, 3)
    at = (side[:-1, None] * 317 + side[:-1]).ravel()
    faces = np.concatenate(
        [np.stack([at, at + 1, at + 317], 1), np.stack([at + 1, at + 318, at + 317], 1)]
    )
    place = np.random.default_rng(0).uniform(-50, 50, (4000, 1, 1, 3))
    boxes = (BOX.triangles + place).reshape(-1, 3)
    one = clean_mesh(terrain[faces].reshape(-1, 3), np.arange(faces.size))
    two = clean_mesh(boxes, np.arange(len(boxes)))
    assert (len(one.faces), len(one.vertices)) == (2 * 316**2, 317**2)
    assert (len(two.faces), len(two.vertices)) == (48_000, 32_000)
    centered = boxes - (boxes.min(axis=0) + boxes.max(axis=0)) / 2
    same_surface(
        two.vertices[two.faces],
        (centered / np.linalg.norm(centered, axis=1).max()).reshape(-1, 3, 3),
    )

"""Members of the built-in families: closed surfaces, close placement bodies, and no two alike."""

import hashlib

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shape_checks import DOWN, check_body, check_centred, check_size, support, unit_vectors

from scenegen.common.errors import SpecError
from scenegen.description.names import FAMILY_NAMES
from scenegen.objects.families.members import MEMBERS, member_shape

FAMILIES = pytest.mark.parametrize("family", FAMILY_NAMES)
# SHA-256 of members 0, 1 and 999, coordinates rounded to 1e-6. A change of geometry changes every
# data set made with these families, so these digests must not change.
DIGESTS = {
    "bag": "2b1cbf45bc3b9940",
    "bottle": "f1505180b88207ca",
    "bowl": "a3c7985a4303162b",
    "can": "e863ed64b23933e5",
    "cap": "751e0c92c2281926",
    "chair": "d4fb9abba4a11746",
    "lamp": "d49067bf36c2e9af",
    "mug": "fcf53df21b766e59",
    "table": "9a86c4af2fd566fb",
}
DIRECTIONS = np.concatenate([unit_vectors(300), np.eye(3), -np.eye(3)])


def spread(family):
    return (member_shape(family, member) for member in (4, 10, 24, *range(0, MEMBERS, 74)))


def welded(shape):
    """Vertex numbers (F, 3): corners at one place, to 1e-8, are one vertex."""
    places = np.round(shape.triangles.reshape(-1, 3) * 1e8).astype(np.int64)
    return np.unique(places, axis=0, return_inverse=True)[1].reshape(-1, 3)


def pieces(shape):
    """The triangles of each connected part."""
    vertices = welded(shape)
    edges = vertices[:, [0, 1, 1, 2]].reshape(-1, 2).T
    count = vertices.max() + 1
    graph = coo_array((np.ones(edges.shape[1]), edges), shape=(count, count))
    found, label = connected_components(graph, directed=False)
    return [shape.triangles[label[vertices[:, 0]] == i] for i in range(found)]


@FAMILIES
def test_members_are_closed_bodies_that_stand(family):
    wide, total, rows = 0.0, 0.0, []
    for shape in spread(family):
        check_closed(shape)
        check_size(shape)
        check_centred(shape.triangles.reshape(-1, 3), 1e-12)
        check_stands(shape)
        area, agreement = faces_and_normals(shape)
        assert area.min() > 1e-9, shape.name
        assert agreement.min() > 0.7, shape.name
        wide += area[agreement < np.cos(np.radians(16))].sum()
        total += area.sum()
        check_body(shape, shape.triangles, 0.02, DIRECTIONS)
        assert len(shape.triangles) <= 4000
        assert len(shape.hull_discs) == len(shape.hull_points) <= 250
        rows.append(len(shape.hull_points))
    assert wide < 0.03 * total, "few and tiny faces deviate from their normals by 16 degrees"
    assert np.median(rows) <= 150


def check_closed(shape):
    """Check that each part is closed and faces outwards, and that their boxes hang together."""
    vertices = welded(shape)
    edges = np.concatenate([vertices[:, [i, (i + 1) % 3]] for i in range(3)])
    assert (edges[:, 0] != edges[:, 1]).all(), shape.name
    there, back = (np.sort(edges @ order) for order in ([1, 10**6], [10**6, 1]))
    np.testing.assert_array_equal(there, back, err_msg=shape.name)
    parts = pieces(shape)
    for part in parts:
        about = part - part.mean(axis=(0, 1))
        volume = np.einsum("fi,fi->", about[:, 0], np.cross(about[:, 1], about[:, 2])) / 6
        assert volume > 1e-8, shape.name
    low = np.array([part.min(axis=(0, 1)) for part in parts])
    high = np.array([part.max(axis=(0, 1)) for part in parts])
    meets = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    assert connected_components(coo_array(meets))[0] == 1, shape.name


def check_stands(shape):
    corners = shape.triangles.reshape(-1, 3)
    low = corners[:, 1].min()
    assert abs(support(shape, DOWN)[0] + low) < 1e-9
    on_floor = corners[corners[:, 1] < low + 1e-9]
    assert (np.ptp(on_floor[:, [0, 2]], axis=0) > 0.1).all(), f"{shape.name}: no base"
    np.testing.assert_array_equal(shape.resting_directions, DOWN)


def faces_and_normals(shape):
    """Return twice the faces' areas, and the least cosine of each to its corners' normals."""
    assert np.isfinite(shape.triangles).all()
    a, b, c = (shape.triangles[:, i] for i in range(3))
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1)
    return area, np.einsum("fi,fki->fk", cross / area[:, None], shape.normals).min(axis=1)


@FAMILIES
def test_members_look_as_they_did(family):
    code = hashlib.sha256()
    for member in (0, 1, 999):
        shape = member_shape(family, member)
        for values in (shape.triangles, shape.normals, shape.hull_points, shape.hull_discs):
            code.update(np.round(values * 1e6).astype(np.int64).tobytes())
    assert code.hexdigest()[:16] == DIGESTS[family]


@pytest.mark.parametrize(
    ("family", "member", "where", "found"),
    [("tray", 0, "family", "'tray'"), ("mug", MEMBERS, "mug", "1000"), ("mug", -1, "mug", "-1")],
)
def test_unknown_members_are_refused(family, member, where, found):
    with pytest.raises(SpecError) as error:
        member_shape(family, member)
    assert error.value.where == where
    assert found in error.value.found
    assert error.value.expected

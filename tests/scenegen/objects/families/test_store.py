"""Members from the store are those that `make_member` makes, and each is made once."""

from unittest.mock import Mock

import numpy as np
import pytest

from scenegen.objects.cast_meshes import cast_mesh
from scenegen.objects.families import store
from scenegen.objects.families.members import make_member
from scenegen.objects.families.store import MemberStore

MUG = ("mug", 7)


@pytest.fixture
def made(monkeypatch):
    """Its `call_count` says how often a member was made, not read from the cache."""
    counted = Mock(wraps=make_member)
    monkeypatch.setattr(store, "make_member", counted)
    return counted


def check(members):
    shape = make_member(*MUG)
    outline, face_count = members.outline(*MUG)
    assert (outline.name, face_count) == (shape.name, len(shape.triangles))
    for name in ("hull_points", "hull_discs", "resting_directions", "rounding"):
        np.testing.assert_array_equal(getattr(outline, name), getattr(shape, name))
    mesh, expected = members.mesh(*MUG), cast_mesh(shape.mesh)
    np.testing.assert_array_equal(mesh.faces, expected.faces)
    for name in ("vertices", "normals"):
        found = getattr(mesh, name)
        assert (found.dtype, (np.rint(found * 2.0**26) == found * 2.0**26).all()) == ("f4", True)
        np.testing.assert_allclose(found, getattr(expected, name), rtol=0, atol=7e-8)


def test_a_member_is_made_once_and_comes_back_as_it_was(tmp_path, made):
    for _ in range(2):
        check(MemberStore(tmp_path))
    assert made.call_count == 1
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:-30])
    check(MemberStore(tmp_path))
    assert made.call_count == 2

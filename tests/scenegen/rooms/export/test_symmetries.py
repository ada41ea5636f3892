"""Symmetries of models: rotation groups known from geometry, and corners that land on corners."""

import numpy as np
import pytest

from scenegen.objects.catalogue import built_in_shape
from scenegen.objects.scene_mesh import welded
from scenegen.rooms.export.symmetries import symmetries

# Axes of any angle, and rotations beside these and the identity.
GROUPS = {
    "box": (0, 23),
    "prism": (0, 5),
    "tetrahedron": (0, 11),
    "icosahedron": (0, 59),
    "cone": (1, 0),
    "cylinder": (1, 1),
    "sphere": (3, 0),
    "mug/0001": (0, 0),
}


@pytest.mark.parametrize("shape", GROUPS)
def test_rotations_are_those_of_the_shape(shape):
    mesh = welded(built_in_shape(shape))
    found = symmetries(mesh)
    assert (len(found.axes), len(found.rotations)) == GROUPS[shape]
    fields = found.fields(1000.0)
    assert set(fields) == {
        name
        for name, n in zip(("symmetries_continuous", "symmetries_discrete"), GROUPS[shape])
        if n
    }
    for axis in fields.get("symmetries_continuous", []):
        # An axis goes through the middle, which a rotation about it keeps.
        np.testing.assert_allclose(axis["offset"], 1000.0 * found.middle)
    corners = 1000.0 * np.asarray(mesh.vertices)
    if len(corners) > 20:
        return
    for matrix in np.reshape(fields["symmetries_discrete"], (-1, 4, 4)):
        moved = corners @ matrix[:3, :3].T + matrix[:3, 3]
        apart = np.linalg.norm(moved[:, None] - corners, axis=-1).min(axis=1)
        assert apart.max() < 1e-3
        assert np.linalg.det(matrix) == pytest.approx(1.0)

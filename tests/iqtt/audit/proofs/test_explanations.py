"""Whether a wrong answer explains the reference: a copy does, a hidden cube is no excuse."""

from dataclasses import replace

import numpy as np
import pytest
from audit_tables import audit_table

from iqtt.audit.proofs.explanations import no_other_explanation
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.polycube import ROTATIONS
from scenegen.common.rotations import rotation_matrix

# A narrow lens from afar, so that what lies behind a cube is hidden by it.
SPEC = SplitSpec(height=64, width=64, min_cube_pixels=5, fov_degrees=5)
ROD = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]
OBLIQUE = rotation_matrix(np.array([0.8, 0.36, 0.48, 0.0]))


def judged(reference, wrong, view, *, told_right=False):
    """Judge a question of one wrong answer, stored turned and moved."""
    turned = np.asarray(wrong) @ ROTATIONS[11].T + (2, -1, 3)
    views = np.stack([view, OBLIQUE, OBLIQUE])[None]
    cubes = np.stack([reference, reference, turned])[None]
    table, shapes = audit_table(cubes, [[-1, 1]], views, SPEC)
    if not told_right:
        shapes = replace(shapes, right=np.array([[True, False]]))
    return no_other_explanation([table], [shapes], [np.arange(1)])


@pytest.mark.parametrize("view", [np.eye(3), OBLIQUE])
def test_the_same_shape_explains_the_reference(view):
    shape = [*ROD, [2, 1, 1]]
    hidden = bool((view == np.eye(3)).all())  # the last cube hides the one behind it
    assert judged(shape, shape, view).status == ("ok" if hidden else "FAIL")
    assert judged(shape, shape, view, told_right=True).status == "ok"  # it is no wrong answer


def test_a_shape_that_hides_a_cube_explains_nothing():
    """Straight from the front, a cube behind the rod does not show wherever it is."""
    one, other = [*ROD, [0, 0, -1]], [*ROD, [1, 0, -1]]
    found = judged(one, other, np.eye(3))
    assert found.status == "ok"
    assert "1 would" in found.detail
    assert "would" not in judged(one, other, OBLIQUE).detail


def test_a_shape_that_differs_in_what_shows():
    assert judged([*ROD, [0, 1, 0]], [*ROD, [0, -1, 0]], np.eye(3)).status == "ok"

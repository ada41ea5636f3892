"""Angles between views by hand."""

from dataclasses import replace

import numpy as np
import pytest
from audit_tables import audit_table
from scipy.spatial.transform import Rotation

from iqtt.audit.proofs.views import angles, lines_of_sight
from iqtt.questions.specs import SplitSpec

LEAN = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1]])  # no turn leaves it
SPEC = replace(SplitSpec(), min_angle_degrees=30.0, min_sight_angle_degrees=20.0)


@pytest.mark.parametrize(
    ("axis", "degrees", "stored", "statuses"),
    [
        ("x", 40.0, 40.0, ("ok", "ok")),
        ("x", 40.0, 41.0, ("FAIL", "ok")),
        ("x", 25.0, 25.0, ("FAIL", "ok")),
        ("x", 15.0, 15.0, ("FAIL", "FAIL")),
        ("x", 165.0, 165.0, ("ok", "FAIL")),  # from behind
        ("z", 40.0, 40.0, ("ok", "FAIL")),  # the picture is turned, and shows nothing new
    ],
)
def test_views_are_as_far_apart_as_told_and_asked_for(axis, degrees, stored, statuses):
    views = np.tile(np.eye(3), (1, 4, 1, 1))
    views[0, 1] = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    others = [LEAN * [-1, 1, 1], LEAN[:, [1, 0, 2]]]
    table, shapes = audit_table([[LEAN, LEAN, *others]], [[-1, 2, 2]], views, SPEC)
    table.truth["angle_degrees"] = np.array([stored])
    proofs = angles([table], [shapes]), lines_of_sight([table], [shapes])
    assert tuple(proof.status for proof in proofs) == statuses

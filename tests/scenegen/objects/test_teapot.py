"""The teapot's patches: a wrong number opens a crack, breaks a symmetry or bends a seam."""

from collections import defaultdict

import numpy as np

from scenegen.objects.teapot import patches

RIM, LID, KNOB, BOTTOM = range(4), range(16, 20), range(12, 16), range(20, 24)
# Handle above and below, spout at the body and at its mouth; each half and its mirror image.
TUBE_ENDS = {(24, 0), (28, 0), (25, 1), (29, 1), (26, 0), (30, 0), (27, 1), (31, 1)}


def borders():
    """Return (patch, side) by the border's control points, in either direction.

    Sides 0 and 1 are the first and last row, 2 and 3 the first and last column.
    """
    found = defaultdict(list)
    for i, net in enumerate(patches().round(9) + 0.0):
        for side, curve in enumerate((net[0], net[-1], net[:, 0], net[:, -1])):
            key = min(tuple(curve.ravel()), tuple(curve[::-1].ravel()))
            found[key].append((i, side))
    return found


def test_every_border_is_shared_by_two_or_known_to_be_open_or_a_pole():
    by_border = borders()
    alone = {users[0] for users in by_border.values() if len(users) == 1}
    open_rings = {(i, 0) for i in RIM} | {(i, 1) for i in LID}
    assert alone == open_rings | TUBE_ENDS
    poles = {key: users for key, users in by_border.items() if len(users) > 2}
    assert sorted(poles.values()) == [[(i, 0) for i in KNOB], [(i, 1) for i in BOTTOM]]
    points = sorted(tuple(np.unique(np.reshape(key, (4, 3)), axis=0).ravel()) for key in poles)
    assert points == [(0.0, 0.0, 0.0), (0.0, 3.15, 0.0)]


def test_published_points_are_where_they_were_published():
    """Some vertices as printed, z up and y <= 0: rim, belly, knob, lid, bottom, handle, spout."""
    printed = [(1.3375, -0.749, 2.53125), (1.75, -0.98, 1.875), (0.8, -0.45, 3.15)]
    printed += [(0.4, -0.224, 2.55), (0.798, -1.425, 0.0), (-2.65, -0.3, 0.9375)]
    printed += [(-2.5, 0.0, 1.125), (3.525, -0.25, 2.49375), (3.1, -0.66, 0.825), (2.4, 0, 2.025)]
    z_up = patches().reshape(-1, 3)[:, [0, 2, 1]] * (1, -1, 1)
    for point in printed:
        assert np.linalg.norm(z_up - point, axis=1).min() < 1e-12, point

"""What the audit reads of stored frames: known turns, known orders, and nothing of other files."""

import numpy as np

from iqtt.audit.features.frames import stored_frames
from iqtt.files.layout import NO_CUBE
from iqtt.shapes.polycube import ROTATIONS
from scenegen.common.rotations import rotation_matrix

CUBES = np.array([[2, 1, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [NO_CUBE] * 3], np.int8)


def about_x(degrees):
    half = np.radians(degrees) / 2
    return rotation_matrix(np.array([np.cos(half), np.sin(half), 0, 0]))


def test_turns_and_orders():
    ordered = CUBES[[1, 2, 3, 0, 4]]  # in the order of their coordinates but for the last
    cubes = np.stack([CUBES, CUBES, ordered])[None]
    views = np.stack([about_x(20), about_x(65), about_x(-10)])[None]
    angle, same, own, place = stored_frames(cubes, views, np.array([True]))[0, :, :4].T
    np.testing.assert_allclose(angle, [45, 30], atol=1e-5)
    np.testing.assert_allclose(own, [65, 10], atol=1e-5)
    assert same.tolist() == [4, 0]
    assert place.tolist() == [0, 4]
    between = stored_frames(cubes, views, np.array([True]))[0, 0, 4:13].reshape(3, 3)
    np.testing.assert_allclose(between @ views[0, 0], views[0, 1], atol=1e-12)


def test_a_common_frame_changes_what_is_told_in_a_known_way():
    """The symmetric part is that of the turn between the frames, which pictures do not show."""
    views = np.stack([np.eye(3), ROTATIONS[1], ROTATIONS[2]])[None]
    cubes = np.stack([CUBES] * 3)[None]
    found = stored_frames(cubes, views, np.array([True]))[0, :, 13:]
    for k in (1, 2):
        expected = (ROTATIONS[k] + ROTATIONS[k].T)[np.triu_indices(3)]
        assert found[k - 1].tolist() == expected.tolist()


def test_shapes_that_are_not_whole_tell_nothing():
    cubes, views = np.stack([CUBES] * 6).reshape(2, 3, 5, 3), np.tile(np.eye(3), (2, 3, 1, 1))
    found = stored_frames(cubes, views, np.array([True, False]))
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()

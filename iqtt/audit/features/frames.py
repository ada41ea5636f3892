"""Numbers that tell how a file stores shapes, and nothing of the shapes themselves.

A shape can be stored in 24 turns and its cubes in any order. If the generator chose these in
another way for right answers, whoever reads the truth could tell right answers without comparing
shapes; a probe tries.
"""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.files.layout import NO_CUBE

Array = NDArray[Any]


def stored_frames(cubes: Array, world_from_shape: Array, whole: Array) -> Array:
    """Return numbers about each answer's frame next to the reference's, (Q, K, 19).

    They are the angle between the two stored rotations, degrees; how many cubes have the same
    place in the order of coordinates; both for the answer alone; and the elements of the
    rotation between the two, and of its symmetric part.

    Args:
        cubes: as stored, (Q, 1 + K, most, 3).
        world_from_shape: stored rotations, (Q, 1 + K, 3, 3).
        whole: which questions have whole shapes, (Q,).
    """
    reference, answers = world_from_shape[:, :1], world_from_shape[:, 1:]
    between = answers @ reference.swapaxes(2, 3)
    within = reference.swapaxes(2, 3) @ answers
    angle, answer_angle = _angle(between), _angle(answers)
    order = _order(cubes)
    used = (cubes[:, 1:] != NO_CUBE).all(axis=3)
    same = np.count_nonzero((order[:, 1:] == order[:, :1]) & used, axis=2)
    place = np.count_nonzero((order[:, 1:] == np.arange(order.shape[2])) & used, axis=2)
    symmetric = [
        within[..., i, j] + within[..., j, i]
        for i, j in itertools.combinations_with_replacement(range(3), 2)
    ]
    flat = between.reshape(*between.shape[:2], 9)
    numbers = [angle, same, answer_angle, place, *np.moveaxis(flat, 2, 0), *symmetric]
    return np.where(whole[:, None, None], np.stack(numbers, axis=2), np.nan)


def _angle(rotation: Array) -> Array:
    """Return the angle of rotations, degrees, (..., 3, 3) to (...)."""
    cosine = (np.trace(rotation, axis1=-2, axis2=-1) - 1) / 2
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def _order(cubes: Array) -> Array:
    """Return which rows come first when cubes are sorted by their coordinates, (Q, I, most)."""
    wide = cubes.astype(np.int64) + 128
    code = (wide[..., 0] * 256 + wide[..., 1]) * 256 + wide[..., 2]
    used = (cubes != NO_CUBE).all(axis=3)
    return np.argsort(np.where(used, code, np.iinfo(np.int64).max), axis=2, kind="stable")

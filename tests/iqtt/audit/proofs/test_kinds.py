"""Proofs of kinds: fair questions pass, and each rule is seen to be broken."""

from dataclasses import replace

import numpy as np
from audit_tables import audit_table

from iqtt.audit.proofs.kinds import (
    MOMENTS,
    answers_differ,
    labels,
    matched,
    mirror_images,
    moment_lengths,
)
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.matched import contacts, matched_rows, moments
from iqtt.shapes.polycube import ROTATIONS, is_chiral, mirror
from iqtt.shapes.splits import known_classes
from scenegen.common.rotations import rotation_matrix

ARM = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1], [2, 1, 2]], np.int8)
IMAGE = mirror(ARM[None])[0]
NEAR = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1], [3, 1, 1]], np.int8)
FAR = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 2, 0], [2, 2, 0], [2, 2, 1]], np.int8)
PAIR, MIRROR = [-1, 2, 2], [-1, 2, 1]


def about_z(degrees):
    half = np.radians(degrees) / 2
    return rotation_matrix(np.array([np.cos(half), 0, 0, np.sin(half)]))


def status(rule, cubes, kinds, views=None):
    found = audit_table([cubes], [kinds], None if views is None else np.stack(views)[None])
    return str(rule([found[0]], [found[1]]).status)


def test_labels_of_mirror_images_and_near_shapes():
    near_image = mirror(NEAR[None])[0]
    assert is_chiral(NEAR[None]).all()
    for shapes, kinds, expected in (
        ([ARM, ARM, IMAGE, IMAGE], PAIR, "ok"),
        ([ARM, ARM, IMAGE, NEAR], MIRROR, "ok"),
        ([ARM, ARM, NEAR, IMAGE], MIRROR, "FAIL"),
        ([ARM, ARM, IMAGE, NEAR], PAIR, "FAIL"),
        ([ARM, ARM, NEAR, near_image], PAIR, "FAIL"),  # not of the right one
        ([ARM, ARM, IMAGE], [-1, 2], "ok"),
        ([ARM, ARM, NEAR], [-1, 2], "FAIL"),
        # Where the near shape is right, the mirror image is the other wrong answer's.
        ([NEAR, NEAR, ARM, IMAGE], [-1, 1, 4], "ok"),
        ([NEAR, NEAR, ARM, IMAGE], [-1, 1, 2], "FAIL"),
        ([IMAGE, IMAGE, ARM, NEAR], [-1, 2, 4], "ok"),
        ([IMAGE, IMAGE, ARM, NEAR], MIRROR, "FAIL"),  # near to the mirror image alone
        ([ARM, ARM, IMAGE, NEAR], [-1, 2, 4], "FAIL"),
        ([NEAR, NEAR, ARM, near_image], [-1, 1, 4], "FAIL"),
        ([ARM, ARM, NEAR @ ROTATIONS[9].T + 3, FAR], [-1, 1, 0], "ok"),
        ([ARM, ARM, FAR, NEAR], [-1, 1, 1], "FAIL"),  # more than one cube moved
        ([ARM, ARM, IMAGE, FAR], [-1, 0, 0], "FAIL"),  # another shape must be no mirror image
        ([ARM, ARM, IMAGE, FAR], [-1, 3, 0], "FAIL"),
    ):
        assert status(labels, shapes, kinds) == expected, (kinds, expected)


def test_two_mirror_images_from_two_sides():
    least = SplitSpec().min_angle_degrees
    for apart, expected in ((least - 0.01, "FAIL"), (least + 0.01, "ok")):
        turned = IMAGE @ ROTATIONS[5].T  # another frame makes no difference
        views = [np.eye(3), np.eye(3), np.eye(3), about_z(apart) @ ROTATIONS[5].T]
        assert status(mirror_images, [ARM, ARM, IMAGE, turned], PAIR, views) == expected


def test_answers_differ():
    assert status(answers_differ, [ARM, ARM, IMAGE, IMAGE], PAIR) == "ok"
    assert status(answers_differ, [ARM, ARM, NEAR, NEAR], [-1, 1, 1]) == "FAIL"
    assert status(answers_differ, [ARM, ARM, ARM @ ROTATIONS[3].T, NEAR], [-1, 2, 2]) == "FAIL"


def test_matched():
    pool = known_classes(9, "chain", 3.5)
    row = next(iter(matched_rows(pool)))
    first, one, two = pool[row[:3]]
    kinds = [-1, 3, 3]
    assert status(matched, [first, first, one, two], kinds) == "ok"
    box = np.sort(np.ptp(pool, axis=1), axis=1)
    same_box = (box == np.sort(np.ptp(first, axis=0))).all(axis=1)
    touching = contacts(pool) == contacts(first[None])
    far = np.linalg.norm(moments(pool) - moments(first[None]), axis=1)
    for group in (
        same_box & touching & (far > MOMENTS + 1e-3) & (far < MOMENTS + 0.05),
        same_box & ~touching & (far < MOMENTS),
        ~same_box & touching & (far < MOMENTS),
    ):
        other = pool[np.flatnonzero(group)[0]]
        assert status(matched, [first, first, other, two], kinds) == "FAIL"
        assert status(matched, [first, first, other, two], [-1, 0, 3]) == "ok"


def test_moments_are_those_by_which_shapes_are_matched():
    """Two formulas: the generator's sums of tensors, and the audit's of dot products."""
    rod = np.stack([np.arange(9), *np.zeros((2, 9), int)], axis=1).astype(np.int8)
    pool = np.concatenate([known_classes(9, "tree", 3.5)[:500], rod[None]])
    np.testing.assert_allclose(moment_lengths(pool), moments(pool), atol=2e-5)


def test_unknown_shapes_are_not_judged():
    table, shapes = audit_table([[ARM, ARM, NEAR, NEAR]], [[-1, 1, 1]])
    blind = replace(shapes, whole=np.zeros(1, np.bool_))
    assert answers_differ([table], [blind]).status == "ok"

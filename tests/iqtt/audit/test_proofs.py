"""Proofs of kinds, images, views, splits and explanations: each rule is seen to be broken."""

import hashlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from audit_tables import audit_table
from scipy.spatial.transform import Rotation

from iqtt.audit.proofs.explanations import no_other_explanation
from iqtt.audit.proofs.images import balance, distinct_images, distinct_questions, visibility
from iqtt.audit.proofs.kinds import (
    MOMENTS,
    answers_differ,
    labels,
    matched,
    mirror_images,
    moment_lengths,
)
from iqtt.audit.proofs.splits import class_splits, is_walk, splits_for_ever, splits_share_nothing
from iqtt.audit.proofs.views import angles, lines_of_sight
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.matched import contacts, matched_rows, moments
from iqtt.shapes.polycube import ROTATIONS, canonical_class, is_chiral, mirror
from iqtt.shapes.splits import known_classes, split_of
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


@pytest.mark.parametrize(
    ("counts", "status"), [((3, 2, 2), "ok"), ((3, 1, 2), "FAIL"), ((0, 0, 0), "skipped")]
)
def test_places_come_equally_often_up_to_one(counts, status):
    table = SimpleNamespace(name="x", images=4)
    right = np.repeat([0, 1, 2, -1], [*counts, 2])
    assert balance([table], [right]).status == status


CUBES = np.tile(np.arange(3)[:, None] * [1, 0, 0], (2, 4, 1, 1))
KINDS = [[-1, 0, 0]] * 2


@pytest.mark.parametrize(
    ("second", "status"),
    [
        ([0, 1, 2, 3], "FAIL"),
        ([0, 3, 1, 2], "FAIL"),  # the same answers in another order
        ([1, 0, 2, 3], "ok"),  # another reference
        ([0, 1, 2, 4], "ok"),
        ([0, 1, 1, 4], "ok"),
    ],
)
def test_a_question_is_its_reference_and_its_answers_in_any_order(second, status):
    images = np.random.default_rng(0).bytes(5 * 16)
    digests = np.frombuffer(images, "V16")[[[0, 1, 2, 3], second]]
    table = replace(audit_table(CUBES, KINDS)[0], digests=digests)
    assert distinct_questions([table]).status == status
    assert distinct_images([table]).status == "FAIL"


@pytest.mark.parametrize(
    ("least", "silhouette", "status"), [(10, 30, "ok"), (11, 30, "FAIL"), (10, 31, "FAIL")]
)
def test_every_cube_shows_and_no_silhouette_is_larger_than_them(least, silhouette, status):
    table, _ = audit_table(CUBES, KINDS, spec=SplitSpec(min_cube_pixels=least))
    table.truth["visible_pixels"] = np.full((2, 4, 3), 10)
    table = replace(table, silhouette=np.full((2, 4), silhouette))
    assert visibility([table]).status == status


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


SPLITS = ("train", "val", "test")


@pytest.mark.parametrize(
    ("cubes", "kind"), [(4, "chain"), (7, "chain"), (8, "chain"), (6, "tree"), (7, "tree")]
)
def test_the_generator_and_the_audit_agree(cubes, kind):
    classes = known_classes(cubes, kind)
    rng = np.random.default_rng(0)
    turned = mirror(classes) @ ROTATIONS[7].T
    turned = turned[:, rng.permutation(cubes)] + rng.integers(-3, 3, (len(classes), 1, 3))
    split = class_splits(turned, kind == "chain")
    assert (split == split_of(classes, kind == "chain")).all()
    assert len(np.unique(split)) == 3


def test_the_hash_is_the_one_that_the_documents_state():
    """Four cubes in a row: their canonical form is x = 0 to 3, two bytes for each, 255 after."""
    text = b"".join(bytes([x, 0]) for x in range(4)).ljust(32, b"\xff")
    number = int.from_bytes(hashlib.sha256(b"3D-IQTT split " + text).digest()[:8], "big")
    rod = np.array([[[0, k, 0] for k in range(4)]])
    expected = (number >= 0x50A8A9012D0867D4) + (number >= 0xD263C9889C717E4D)
    assert class_splits(rod, True).tolist() == [expected]


def test_walks():
    assert is_walk([[0, 0, 0], [2, 0, 0], [1, 0, 0], [2, 1, 0]])
    assert not is_walk([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0]])
    assert is_walk([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def question_of(shapes, split, spec=SplitSpec()):
    """Ask about the first of three shapes, with the others as wrong answers."""
    cubes = np.stack([shapes[0], *shapes[:3]])[None]
    return audit_table(cubes, [[-1, 0, 0]], spec=spec, split=split)


def test_every_shape_is_in_its_split():
    classes = canonical_class(known_classes(8, "chain", 3.5))
    owner = split_of(classes, True)
    fair = [question_of(classes[owner == i], name) for i, name in enumerate(SPLITS)]
    tables, shapes = zip(*fair, strict=True)
    assert splits_for_ever(tables, shapes).status == "ok"
    # One wrong answer of another split is enough, and only a released file may have it.
    mixed = [*classes[owner == 2][:2], mirror(classes[owner == 0][:1])[0]]
    for spec, expected in ((SplitSpec(), "FAIL"), (None, "skipped")):
        table, one = question_of(mixed, "test", spec)
        assert splits_for_ever([table], [one]).status == expected


def test_shapes_in_two_splits():
    from iqtt.audit.proofs.shapes import compare_shapes

    classes = known_classes(8, "chain", 3.5)
    first, second = question_of(classes[:3], "train")[0], question_of(classes[3:6], "test")[0]
    again = question_of(mirror(classes[2:5]), "test")[0]
    for other, expected in ((second, "ok"), (again, "FAIL")):
        shapes = compare_shapes([first, other])
        assert splits_share_nothing([first, other], shapes).status == expected
    assert splits_share_nothing([first], compare_shapes([first])).status == "skipped"


# A narrow lens from afar, so that what lies behind a cube is hidden by it.
NARROW = SplitSpec(height=64, width=64, min_cube_pixels=5, fov_degrees=5)
ROD = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]
OBLIQUE = rotation_matrix(np.array([0.8, 0.36, 0.48, 0.0]))


def judged(reference, wrong, view, *, told_right=False):
    """Judge a question of one wrong answer, stored turned and moved."""
    turned = np.asarray(wrong) @ ROTATIONS[11].T + (2, -1, 3)
    views = np.stack([view, OBLIQUE, OBLIQUE])[None]
    cubes = np.stack([reference, reference, turned])[None]
    table, shapes = audit_table(cubes, [[-1, 1]], views, NARROW)
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
    assert "1 match" in found.detail
    assert "match" not in judged(one, other, OBLIQUE).detail


def test_a_shape_that_differs_in_what_shows():
    assert judged([*ROD, [0, 1, 0]], [*ROD, [0, -1, 0]], np.eye(3)).status == "ok"

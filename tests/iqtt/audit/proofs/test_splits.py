"""Proofs of splits: the audit's own hash and table of borders against the generator's rule."""

import hashlib

import numpy as np
import pytest
from audit_tables import audit_table

from iqtt.audit.proofs.splits import class_splits, is_walk, splits_for_ever, splits_share_nothing
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.polycube import ROTATIONS, canonical_class, mirror
from iqtt.shapes.splits import known_classes, split_of

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

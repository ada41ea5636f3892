"""Places of right answers, copies and visible pixels, by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from audit_tables import audit_table

from iqtt.audit.proofs.images import balance, distinct_images, distinct_questions, visibility
from iqtt.questions.specs import SplitSpec


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

"""Places of right answers: each as often as the others, by no pattern, and what goes there."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from iqtt.questions.distractors import (
    answer_positions,
    arrange,
    draw_shapes,
    make_pools,
    question_key,
)
from iqtt.questions.kinds import QUESTION_KINDS
from iqtt.questions.specs import SPLITS, SplitSpec

SPEC = SplitSpec(seed=11, cubes=(6, 8), max_radius=2.7)


def test_arranging_puts_the_right_answer_at_its_place():
    spec = replace(SPEC, distractors="mirror")
    [drawn] = draw_shapes(make_pools(spec), "train", [(0, 0)])
    seen = set()
    for answer in range(3):
        for seed in range(12):
            shapes = arrange(drawn, answer, np.random.default_rng(seed))
            assert shapes.answer == answer
            assert shapes.kinds[answer] == -1
            assert (shapes.cubes[0] == drawn[0][0]).all()
            assert (shapes.cubes[1 + answer] == drawn[0][0]).all()
            for cubes, kind in zip(shapes.cubes[1:], shapes.kinds, strict=True):
                assert (cubes == drawn[0][drawn[1].tolist().index(kind)]).all()
            seen.add(tuple(shapes.kinds.tolist()))
    assert len(seen) == 6


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 200, 1001])
@pytest.mark.parametrize("answers", [2, 3])
def test_answer_positions_are_balanced_exactly(count, answers):
    spec = replace(SPEC, distractors="near", answers=answers)
    for split in SPLITS:
        places = answer_positions(spec, split, 7, count)
        assert (places.dtype, places.shape) == (np.uint8, (count,))
        assert sorted(places.tolist()) == sorted(i % answers for i in range(count))
        others = replace(
            spec, train=7, labeled=3, val=8, test=9, image_dtype="float32", ambient=(0,) * 3
        )
        assert (answer_positions(others, split, 7, count) == places).all()


def test_answer_positions_of_one_split_tell_nothing_of_another_s():
    """Whatever they have in common, two keys agree in a third of the questions."""
    changes = (
        *({"distractors": kind} for kind in QUESTION_KINDS),
        {"seed": 12}, {"cubes": (6, 7)}, {"shapes": "tree"}, {"min_angle_degrees": 31},
        {"max_radius": 2.8}, {"lights": (1, 2)}, {"height": 127},
    )  # fmt: skip
    keys = [answer_positions(replace(SPEC, **change), "val", 0, 3000) for change in changes]
    keys.append(answer_positions(SPEC, "test", 0, 3000))
    for one, other in itertools.combinations(keys, 2):
        assert stats.binomtest(int((one == other).sum()), 3000, 1 / 3).pvalue > 1e-4


def test_answer_positions_follow_no_pattern():
    rows = np.array([answer_positions(replace(SPEC, seed=s), "val", 0, 6) for s in range(600)])
    for column in rows.T:
        assert stats.chisquare(np.bincount(column, minlength=3)).pvalue > 1e-4
    assert len({row.tobytes() for row in rows}) > 85, "of 90 orders"
    tables = [(split, first) for split in SPLITS for first in (0, 30)]
    orders = {answer_positions(SPEC, split, first, 30).tobytes() for split, first in tables}
    assert len(orders) == 6
    keys = {question_key(split, index) for split in SPLITS for index in (0, 1, 10**8)}
    assert len(keys) == 9

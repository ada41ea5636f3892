"""Draws are balanced over kinds and places, differ by participant, and never repeat a question."""

from collections import Counter

import pytest
from refusals import refused

from iqtt.quiz.draw import cells_of, draw_rows
from scenegen.common.errors import SpecError

KINDS = ["matched", "mirror", "near", "other", "mirror-pair"] * 60
PLACES = [(i // 5) % 3 for i in range(300)]
CELLS = cells_of(KINDS, PLACES, range(300))


@pytest.mark.parametrize("count", [1, 7, 20, 45])
def test_kinds_and_places_come_equally_often(count):
    for participant in range(20):
        rows = draw_rows(CELLS, count, 4, participant)
        assert len(set(rows)) == count
        for labels, number in ((KINDS, 5), (PLACES, 3)):
            found = Counter(labels[row] for row in rows)
            assert set(found.values()) <= {count // number, -(-count // number)}


def test_every_question_is_drawn_by_somebody_and_no_order_is_fixed():
    draws = [draw_rows(CELLS, 20, 4, participant) for participant in range(200)]
    assert {row for rows in draws for row in rows} == set(range(300))
    assert len(set(map(tuple, draws))) == 200
    first = Counter(KINDS[rows[0]] for rows in draws)
    assert len(first) == 5
    assert max(first.values()) < 70
    # Who is balanced one after the other could guess: three in a row would have three places.
    assert any(len({PLACES[row] for row in rows[:3]}) == 1 for rows in draws)
    places = Counter((i, PLACES[rows[i]]) for rows in draws for i in range(20))
    assert max(places.values()) < 100, "a place is more likely at some position"


def test_a_draw_depends_on_its_arguments_alone():
    assert draw_rows(CELLS, 20, 4, 7) == draw_rows(CELLS, 20, 4, 7)
    others = [draw_rows(CELLS, 20, 5, 7), draw_rows(CELLS, 20, 4, 8), draw_rows(CELLS, 20, 4, 7, 1)]
    assert draw_rows(CELLS, 20, 4, 7) not in others


def test_small_and_lopsided_pools():
    cells = cells_of(["near"] * 9 + ["other"], [0] * 8 + [1, 2], range(10))
    assert sorted(draw_rows(cells, 10, 0, 0)) == list(range(10))
    assert {8, 9} <= set(draw_rows(cells, 3, 0, 0))
    with refused(SpecError, found="11"):
        draw_rows(cells, 11, 0, 0)

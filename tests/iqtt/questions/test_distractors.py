"""The shapes of questions: right, fair, each on its own, and of no other split."""

import itertools
import math
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from iqtt.audit.congruence import congruent_rows
from iqtt.questions import distractors as module
from iqtt.questions.distractors import (
    Pools,
    answer_positions,
    arrange,
    draw_shapes,
    make_pools,
    question_key,
)
from iqtt.questions.kinds import DISTRACTORS, QUESTION_KINDS, question_kind
from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.shapes.matched import TOLERANCE, contacts, moments
from iqtt.shapes.near import is_chain, is_connected
from iqtt.shapes.polycube import (
    bounding_radius,
    canonical,
    canonical_class,
    is_chiral,
    set_ids,
    symmetries,
)
from iqtt.shapes.splits import TooFewShapesError, split_of
from scenegen.common.errors import PlacementError

SPEC = SplitSpec(seed=11, cubes=(6, 8), max_radius=2.7)
CASES = [
    *((kind, shapes, 3) for shapes in ("chain", "tree") for kind in DISTRACTORS),
    *((kind, "chain", 2) for kind in DISTRACTORS if kind != "mirror"),
]


@cache
def pools_of(spec):
    return make_pools(spec)


def draw(spec, count, split="train"):
    return draw_shapes(pools_of(spec), split, [(i, 0) for i in range(count)])


def by_size(drawn):
    """Shapes and kinds of the questions of each number of cubes, (Q, 3, n, 3) and (Q, 3)."""
    sizes = sorted({cubes.shape[1] for cubes, _ in drawn})
    some = [[one for one in drawn if one[0].shape[1] == size] for size in sizes]
    return [tuple(np.stack(part) for part in zip(*one, strict=True)) for one in some]


def congruent(a, b, turned=(1, 1, 1)):
    return congruent_rows(a, b * np.array(turned, np.int8))


def shared_cubes(*shapes):
    return len(set.intersection(*({tuple(c) for c in shape.tolist()} for shape in shapes)))


def check_near(three, names, mirrors):
    """One of the three is the odd one: near to a shape, and the other two are mirror images."""
    assert mirrors.sum() == 1
    odd = int((2, 1, 0)[mirrors.argmax()])
    pair = [i for i in range(3) if i != odd]
    near = {names[i] for i in pair if shared_cubes(three[odd], three[i]) == len(three[0]) - 1}
    if names[odd] == -1:
        assert sorted(names) == [-1, 1, 4]
        assert 1 in near
    else:  # near to the reference, or to its mirror image
        assert sorted(names[i] for i in pair) == [-1, 2]
        assert (-1 if names[odd] == 1 else 2) in near


@pytest.mark.parametrize(("kind", "shapes", "answers"), CASES)
def test_one_answer_is_right_and_the_others_are_what_their_kind_says(kind, shapes, answers):
    spec = replace(SPEC, distractors=kind, shapes=shapes, answers=answers)
    if kind in ("matched", "mixed"):  # there are few matched shapes of fewer cubes
        spec = replace(spec, cubes=(9, 9), max_radius=3.5)
    met = set()
    for cubes, kinds in by_size(draw(spec, 60)):
        size, flat = cubes.shape[2], cubes.reshape(-1, *cubes.shape[2:])
        assert (cubes.dtype, kinds.dtype, cubes.shape[1]) == (np.int8, np.int8, answers)
        assert spec.cubes[0] <= size <= spec.cubes[1]
        assert (bounding_radius(flat) <= spec.max_radius).all()
        assert (is_chain if shapes == "chain" else is_connected)(flat).all()
        pairs = list(itertools.combinations(range(answers), 2))
        same, mirrored = (
            np.stack([congruent(cubes[:, i], cubes[:, j], turned) for i, j in pairs], axis=1)
            for turned in ((1, 1, 1), (1, 1, -1))
        )
        assert not same[:, : answers - 1].any(), "the right one is first, and unlike the others"
        for three, names, alike, mirrors in zip(cubes, kinds.tolist(), same, mirrored, strict=True):
            name = question_kind(names).removesuffix("-2")
            met.add(name)
            assert names.count(-1) == 1
            assert alike.any() == (name == "mirror-pair" and answers == 3)
            if name == "mirror":
                check_near(three, names, mirrors)
            elif name == "mirror-pair":
                assert mirrors[: answers - 1].all()
            else:
                assert not mirrors.any()
            if name == "near":
                assert shared_cubes(*three) == size - 1
            if name == "matched":
                edges = np.sort(np.ptp(three, axis=1), axis=1)
                assert (edges == edges[0]).all()
                assert len(set(contacts(three).tolist())) == 1
                assert np.ptp(moments(three), axis=0).max() <= 2 * TOLERANCE
    assert met == set(spec.kinds)


@pytest.mark.parametrize("cubes", [(6, 7), (12, 12)])
def test_no_class_is_met_in_two_splits(cubes, monkeypatch):
    monkeypatch.setattr(module, "DRAWN_CLASSES", 2000)
    spec = replace(SPEC, cubes=cubes, max_radius=3.5)
    met = []
    for index, split in enumerate(SPLITS):
        met.append(set())
        for shapes, _ in by_size(draw(spec, 60, split)):
            flat = shapes.reshape(-1, *shapes.shape[2:])
            assert (split_of(canonical_class(flat)) == index).all()
            met[-1] |= {bytes(i) for i in set_ids(canonical_class(flat))}
        assert len(met[-1]) > 20
    assert not met[0] & met[1] | met[0] & met[2] | met[1] & met[2]


def test_a_question_depends_on_itself_alone():
    requests = [(i, attempt) for i in (0, 5, 2**30) for attempt in (0, 1, 7)]
    together = draw_shapes(pools_of(SPEC), "val", requests)
    key = [(cubes.tobytes(), kinds.tobytes()) for cubes, kinds in together]
    assert len(set(key)) == len(key)
    for order in (range(9), range(9)[::-1], (4, 4, 0)):
        again = draw_shapes(pools_of(SPEC), "val", [requests[i] for i in order])
        assert [(c.tobytes(), k.tobytes()) for c, k in again] == [key[i] for i in order]
    for i, request in enumerate(requests):
        [(cubes, kinds)] = draw_shapes(
            make_pools(SPEC) if i == 3 else pools_of(SPEC), "val", [request]
        )
        assert (cubes.tobytes(), kinds.tobytes()) == key[i]
    others = replace(SPEC, train=5, labeled=5, val=9, test=2, width=256, min_angle_degrees=3)
    again = draw_shapes(make_pools(others), "val", requests)
    assert [c.tobytes() for c, _ in again] == [c for c, _ in key]
    assert draw_shapes(pools_of(SPEC), "val", []) == []
    for changed in ("train", "test"):
        elsewhere = draw_shapes(pools_of(SPEC), changed, requests)
        assert not {c.tobytes() for c, _ in elsewhere} & {c for c, _ in key}


def test_each_kind_each_size_and_each_hand_is_as_likely():
    drawn = draw(replace(SPEC, cubes=(9, 10), max_radius=3.5), 900)
    kinds = Counter(question_kind(kinds) for _, kinds in drawn)
    sizes = Counter(cubes.shape[1] for cubes, _ in drawn)
    assert set(sizes) == {9, 10}
    assert set(kinds) == set(QUESTION_KINDS)
    for counts in (kinds, sizes):
        assert stats.chisquare(list(counts.values())).pvalue > 1e-3
    left = []
    for cubes, _ in by_size(drawn):
        flat = cubes.reshape(-1, *cubes.shape[2:])
        flat = flat[is_chiral(flat)]
        left += (canonical(flat) == canonical_class(flat)).all(axis=(1, 2)).tolist()
    assert len(left) > 1500
    assert stats.binomtest(sum(left), len(left)).pvalue > 1e-3


def test_any_cube_may_be_the_moved_one():
    """It keeps its row, so its row is where near shapes differ."""
    drawn = draw(replace(SPEC, cubes=(7, 7), distractors="near"), 300)
    apart = np.stack([(cubes != cubes[0]).any(axis=(0, 2)) for cubes, _ in drawn])
    assert (apart.sum(axis=1) == 1).all()
    assert (apart.sum(axis=0) >= 5).all()


def check_that_answers_alone_tell_nothing(kind, cubes, count):
    """The odd one out, the most and the least compact, wide or symmetric: each is right as often as
    by chance, ties by lot, within 4 standard errors.
    """
    spec = replace(SPEC, distractors=kind, cubes=(cubes, cubes), max_radius=3.5)
    shapes = np.stack([three for three, _ in draw(spec, count)])
    flat = shapes.reshape(-1, cubes, 3)
    _, names = np.unique(set_ids(canonical_class(flat)), return_inverse=True)
    names = names.reshape(-1, 3)
    apart = abs(shapes[:, :, :, None] - shapes[:, :, None].astype(int)).sum(axis=4)
    clues = {
        "odd": -(names[:, :, None] == names[:, None]).sum(axis=2),
        "compact": (apart == 1).sum(axis=(2, 3)),
        "wide": bounding_radius(flat).reshape(-1, 3),
        "symmetric": symmetries(flat).sum(axis=1).reshape(-1, 3),
    }
    for clue, rows in clues.items():
        for values in (rows, -rows):
            best = values == values.max(axis=1, keepdims=True)
            score = best[:, 0] / best.sum(axis=1)
            error = max(score.std(), 0.02) / math.sqrt(count)
            assert abs(score.mean() - 1 / 3) < 4 * error, f"{clue}: {score.mean():.3f}"


@pytest.mark.parametrize("kind", [*QUESTION_KINDS][:4])
def test_answers_alone_tell_nothing(kind):
    check_that_answers_alone_tell_nothing(kind, 9 if kind == "matched" else 7, 1500)


def test_two_answers_of_a_mirror_pair_are_each_the_right_one_as_often():
    """The hand that `canonical_class` shows is right in half of the questions."""
    spec = replace(SPEC, distractors="mirror-pair", answers=2)
    right = [
        (canonical(c[:, 0]) == canonical_class(c[:, 0])).all(axis=(1, 2))
        for c, _ in by_size(draw(spec, 1500))
    ]
    right = np.concatenate(right)
    assert stats.binomtest(int(right.sum()), len(right)).pvalue > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("cubes", [9, 12])
@pytest.mark.parametrize("kind", [*QUESTION_KINDS][:4])
def test_many_answers_alone_tell_nothing(kind, cubes):
    check_that_answers_alone_tell_nothing(kind, cubes, 10_000)


def test_a_reference_without_distractors_is_searched_for_so_often_only(monkeypatch):
    rod = np.array(
        [[[i, 0, 0] for i in range(4)]], np.int8
    )  # no near shape is left: no split has it
    monkeypatch.setattr(module, "split_of", lambda classes, chains: np.full(len(classes), 9))
    monkeypatch.setattr(module, "SHAPE_ATTEMPTS", 3)
    for kind in ("near", "mirror"):
        with pytest.raises(PlacementError) as error:
            draw_shapes(Pools(SPEC, {4: (rod,) * 3}, {}, {kind: (4,)}), "test", [(4, 0), (9, 2)])
        assert error.value.where == "test question 4"


@pytest.mark.parametrize(
    ("settings", "kind"),
    [
        ({"cubes": (3, 3)}, "mixed"),
        ({"cubes": (4, 4), "distractors": "other"}, "other"),
        ({"cubes": (4, 4), "shapes": "tree", "distractors": "near"}, "near"),
        ({"cubes": (4, 4), "distractors": "near"}, "near"),
        ({"cubes": (4, 4), "distractors": "mirror"}, "mirror"),
        ({"cubes": (8, 8), "max_radius": 1.5, "min_cube_pixels": 1}, "mixed"),
        ({"cubes": (7, 7), "distractors": "matched"}, "matched"),
        ({"cubes": (3, 3), "distractors": "mirror-pair"}, "mirror-pair"),
    ],
)
def test_too_few_shapes_are_told_before_anything_is_rendered(settings, kind, monkeypatch):
    monkeypatch.setattr("scenegen.rendering.renderer.launch_fields", None)
    spec = SplitSpec(**settings)
    low, high = spec.cubes
    with pytest.raises(TooFewShapesError) as error:
        make_pools(spec)
    assert error.value.where == "cubes"
    assert f"{low}-{high}" in error.value.found
    assert repr(kind) in error.value.expected


def test_sizes_that_do_not_allow_a_kind_are_left_out_of_it_alone():
    sizes = make_pools(replace(SPEC, seed=0, cubes=(3, 8), max_radius=3.5)).sizes
    assert sizes == {
        "other": (5, 6, 7, 8),
        "near": (5, 6, 7, 8),
        "mirror": (6, 7, 8),
        "mirror-pair": (5, 6, 7, 8),
    }
    few = make_pools(replace(SPEC, cubes=(5, 7))).sizes
    assert set(few) == {"other", "near", "mirror", "mirror-pair"}, "no shapes are matched"
    alone = replace(SPEC, cubes=(5, 5), distractors="other")
    assert len(draw_shapes(make_pools(alone), "train", [(0, 0), (1, 0)])) == 2


def test_where_few_shapes_of_many_cubes_are_found_those_are_shared_out(monkeypatch):
    monkeypatch.setattr(module, "DRAWN_CLASSES", 4000)
    spec = replace(SPEC, cubes=(12, 12), max_radius=2.5)
    pools = make_pools(spec)
    assert all(3 < len(part) < 4000 for part in pools.classes[12])
    for shapes, _ in draw_shapes(pools, "val", [(i, 0) for i in range(6)]):
        assert (bounding_radius(shapes) <= 2.5).all()


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

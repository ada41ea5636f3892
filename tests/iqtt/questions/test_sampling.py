"""Shapes, answers, rotations and lights of questions: right, fair, and each on its own."""

import math
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from iqtt.questions import sampling as questions
from iqtt.questions.sampling import (
    KIND_NAMES,
    Drawn,
    Pools,
    arrange,
    draw_shapes,
    make_pools,
)
from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.shapes.congruence import congruent_rows
from iqtt.shapes.near import is_chain, is_connected
from iqtt.shapes.polycube import (
    bounding_radius,
    canonical,
    canonical_class,
    is_chiral,
    set_ids,
    symmetries,
)
from scenegen.common.errors import PlacementError

SPEC = SplitSpec(seed=11, cubes=(6, 8), max_radius=2.7)
CASES = [
    (kind, shapes) for shapes in ("chain", "tree") for kind in ("other", "near", "mirror", "mixed")
]
RNG = np.random.default_rng


@cache
def pools_of(spec: SplitSpec) -> Pools:
    return make_pools(spec)


def draw(spec: SplitSpec, count: int, split: str = "train") -> list[Drawn]:
    return draw_shapes(spec, pools_of(spec), split, [(i, 0) for i in range(count)])


def by_size(drawn: list[Drawn]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Shapes and kinds of the questions of each number of cubes, (Q, 3, n, 3) and (Q, 3)."""
    sizes = sorted({cubes.shape[1] for cubes, _ in drawn})
    some = [[one for one in drawn if one[0].shape[1] == size] for size in sizes]
    return [tuple(np.stack(part) for part in zip(*one, strict=True)) for one in some]


def congruent(a, b, turned=(1, 1, 1)):
    return congruent_rows(a, b * np.array(turned, np.int8))


def shared_cubes(*shapes) -> int:
    return len(set.intersection(*({tuple(c) for c in shape.tolist()} for shape in shapes)))


@pytest.mark.parametrize(("kind", "shapes"), CASES)
def test_one_answer_is_right_and_the_others_are_what_their_kind_says(kind, shapes):
    spec = replace(SPEC, distractors=kind, shapes=shapes)
    met = set()
    for cubes, kinds in by_size(draw(spec, 60)):
        size, flat = cubes.shape[2], cubes.reshape(-1, *cubes.shape[2:])
        assert (cubes.dtype, kinds.dtype) == (np.int8, np.int8)
        assert 6 <= size <= 8
        assert (bounding_radius(flat) <= spec.max_radius).all()
        assert (is_chain if shapes == "chain" else is_connected)(flat).all()
        pairs = [(cubes[:, i], cubes[:, j]) for i, j in ((0, 1), (0, 2), (1, 2))]
        assert not any(congruent(*pair).any() for pair in pairs)
        mirrored = np.stack([congruent(*pair, (1, 1, -1)) for pair in pairs], axis=1)
        for three, names, mirrors in zip(cubes, kinds.tolist(), mirrored, strict=True):
            met.add(tuple(names))
            if 2 not in names:
                assert not mirrors.any()
                assert names == [-1, 0, 0] or shared_cubes(*three) == size - 1
                continue
            assert mirrors.sum() == 1
            odd = int((2, 1, 0)[mirrors.argmax()])
            assert names[odd] in (-1, 1)
            pair = [i for i in range(3) if i != odd]
            assert 2 in (names[pair[0]], names[pair[1]])
            assert max(shared_cubes(three[odd], three[i]) for i in pair) == size - 1
    expected = {"other": {(-1, 0, 0)}, "near": {(-1, 1, 1)}, "mirror": {(-1, 2, 1), (-1, 1, 2)}}
    expected["mixed"] = set().union(*expected.values())
    assert met == expected[kind]


@pytest.mark.parametrize("cubes", [(6, 7), (12, 12)])
def test_no_class_is_met_in_two_splits(cubes):
    spec = replace(SPEC, cubes=cubes, max_radius=3.5)
    met = []
    for index, split in enumerate(SPLITS):
        met.append(set())
        for shapes, _ in by_size(draw(spec, 60, split)):
            flat = shapes.reshape(-1, *shapes.shape[2:])
            owners = pools_of(spec).catalogues[shapes.shape[2]].owner(flat)
            assert (owners == index).all()
            met[-1] |= {bytes(i) for i in set_ids(canonical_class(flat))}
        assert len(met[-1]) > 20
    assert not met[0] & met[1] | met[0] & met[2] | met[1] & met[2]


def test_a_question_depends_on_itself_alone():
    requests = [(i, attempt) for i in (0, 5, 2**30) for attempt in (0, 1, 7)]
    together = draw_shapes(SPEC, pools_of(SPEC), "val", requests)
    key = [(cubes.tobytes(), kinds.tobytes()) for cubes, kinds in together]
    assert len(set(key)) == len(key)
    for order in (range(9), range(9)[::-1], (4, 4, 0)):
        again = draw_shapes(SPEC, pools_of(SPEC), "val", [requests[i] for i in order])
        assert [(c.tobytes(), k.tobytes()) for c, k in again] == [key[i] for i in order]
    for i, request in enumerate(requests):
        [(cubes, kinds)] = draw_shapes(
            SPEC, make_pools(SPEC) if i == 3 else pools_of(SPEC), "val", [request]
        )
        assert (cubes.tobytes(), kinds.tobytes()) == key[i]
    others = replace(SPEC, train=5, labeled=5, val=9, test=2, height=64, min_angle_degrees=3)
    again = draw_shapes(others, make_pools(others), "val", requests)
    assert [c.tobytes() for c, _ in again] == [c for c, _ in key]
    assert draw_shapes(SPEC, pools_of(SPEC), "val", []) == []
    for changed in ("train", "test"):
        elsewhere = draw_shapes(SPEC, pools_of(SPEC), changed, requests)
        assert not {c.tobytes() for c, _ in elsewhere} & {c for c, _ in key}


def test_each_kind_each_size_and_each_hand_is_as_likely():
    drawn = draw(replace(SPEC, cubes=(7, 9)), 900)
    kinds = Counter(max(kinds) for _, kinds in drawn)
    sizes = Counter(cubes.shape[1] for cubes, _ in drawn)
    assert set(sizes) == {7, 8, 9}
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


def check_that_answers_alone_tell_nothing(kind: str, cubes: int, count: int) -> None:
    """The odd one out, the most and the least compact, wide or symmetric: each is right as often as
    by chance, ties by lot, within 4 standard errors.
    """
    spec = replace(SPEC, distractors=kind, cubes=(cubes, cubes))
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


@pytest.mark.parametrize("kind", KIND_NAMES)
def test_answers_alone_tell_nothing(kind):
    check_that_answers_alone_tell_nothing(kind, 7, 3000)


@pytest.mark.slow
@pytest.mark.parametrize("cubes", [6, 9, 12])
@pytest.mark.parametrize("kind", KIND_NAMES)
def test_many_answers_alone_tell_nothing(kind, cubes):
    check_that_answers_alone_tell_nothing(kind, cubes, 10_000)


def test_arranging_puts_the_right_answer_at_its_place():
    drawn = draw(replace(SPEC, distractors="mirror"), 1)[0]
    seen = set()
    for answer in range(3):
        for seed in range(12):
            shapes = arrange(drawn, answer, RNG(seed))
            assert shapes.answer == answer
            assert shapes.kinds[answer] == -1
            assert (shapes.cubes[0] == drawn[0][0]).all()
            assert (shapes.cubes[1 + answer] == drawn[0][0]).all()
            for cubes, kind in zip(shapes.cubes[1:], shapes.kinds, strict=True):
                assert (cubes == drawn[0][drawn[1].tolist().index(kind)]).all()
            seen.add(tuple(shapes.kinds.tolist()))
    assert len(seen) == 6


def test_a_reference_without_distractors_is_searched_for_so_often_only(monkeypatch):
    spec = replace(SPEC, cubes=(7, 7), distractors="near")
    pools = Pools(pools_of(SPEC).catalogues, {"near": (7,)})
    monkeypatch.setattr(questions, "SHAPE_ATTEMPTS", 3)
    monkeypatch.setitem(
        questions._MAKERS, "near", lambda spec, pool, split, rngs: [None] * len(rngs)
    )
    with pytest.raises(PlacementError) as error:
        draw_shapes(spec, pools, "test", [(4, 0), (9, 2)])
    assert str(error.value) == (
        "test question 4: none of 3 chain shapes of 7 cubes has 'near' distractors that no other"
        " split may use; take more --cubes, or another kind of --distractors"
    )

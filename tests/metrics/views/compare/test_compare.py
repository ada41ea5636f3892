"""Paired comparison against brute force, scipy and values worked out by hand."""

import itertools
import json
from dataclasses import fields, replace

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores
from scipy.stats import binomtest, norm

from metrics.measures.statistics import bootstrap_interval
from metrics.views.compare.compare import Comparison, Difference, compare, least_p_value
from metrics.views.compare.paired_tests import holm
from metrics.views.compare.report import to_json

SCENES = np.repeat(np.arange(8), 2)


def three_methods(views=2, scenes=8):
    """A reference, one that is worse in all scenes, one that hardly differs."""
    rng = np.random.default_rng(3)
    labels = np.repeat(np.arange(scenes), views)
    base = rng.gamma(2.0, 0.1, len(labels))
    columns = {
        "first": base,
        "worse": base + 0.05 + 0.01 * rng.random(len(labels)),
        "same": base + 0.01 * rng.standard_normal(len(labels)),
    }
    return [
        rooms_scores(name, {"chamfer": column, "f_score_0.05": np.exp(-column)}, labels)
        for name, column in columns.items()
    ]


def test_distances_by_brute_force():
    files = three_methods()
    comparison = compare(files, ["chamfer", "f_score_0.05"], seed=5)
    assert (comparison.reference, comparison.methods) == ("first", ("worse", "same"))
    assert (comparison.items, comparison.clusters, comparison.comparable) == (16, 8, True)
    expected = itertools.product(("chamfer", "f_score_0.05"), ("worse", "same"))
    assert [(d.metric, d.method) for d in comparison.differences] == list(expected)
    for d in comparison.differences:
        pair = (files[1 + comparison.methods.index(d.method)], files[0])
        a, b = (file.items[d.metric].reshape(8, 2) for file in pair)
        apart, a, b = ((a - b).mean(axis=1), a.mean(axis=1), b.mean(axis=1))
        patterns = np.array(list(itertools.product([1, -1], repeat=8)))
        reached = np.abs((patterns * apart).mean(axis=1)) >= abs(apart.mean()) - 1e-12
        assert d.p_value == pytest.approx(reached.mean())
        assert d.difference == pytest.approx(apart.mean(), rel=1e-12)
        assert (d.value, d.reference_value) == pytest.approx((a.mean(), b.mean()), rel=1e-12)
        assert ((d.low,), (d.high,)) == bootstrap_interval(apart[:, None], seed=5)
        better = apart > 0 if d.metric == "f_score_0.05" else apart < 0
        assert (d.wins, d.losses, d.ties) == (better.sum(), (~better).sum(), 0)
        reach = norm.ppf(1 - 0.05 / 4 / 2) + norm.ppf(0.8)
        assert d.smallest == pytest.approx(reach * apart.std(ddof=1) / np.sqrt(8), rel=1e-6)
    expected = holm([d.p_value for d in comparison.differences])
    assert [d.p_holm for d in comparison.differences] == expected.tolist()
    assert [d.verdict for d in comparison.differences] == ["worse", "not shown"] * 2


def test_the_correction_goes_over_every_score_and_file():
    files = three_methods()
    alone = compare(files[:2], ["chamfer"]).differences[0]
    assert alone.p_holm == alone.p_value == 2 / 2**8
    first = compare(files, ["chamfer", "f_score_0.05"]).differences[0]
    assert first.p_value == alone.p_value
    assert first.p_holm == 4 * alone.p_value
    assert first.smallest > alone.smallest
    again = compare([*files, *files[1:]], ["chamfer", "f_score_0.05", "chamfer"])
    assert len(again.differences) == 8
    assert again.differences[0].p_holm == 8 * alone.p_value


@pytest.mark.parametrize(("only_a", "only_b"), [(9, 1), (6, 0), (5, 0), (0, 0), (7, 7)])
def test_questions_by_the_binomial_test(only_a, only_b):
    right = np.repeat([[1, 0], [0, 1], [1, 1], [0, 0]], [only_a, only_b, 20, 15], axis=0)
    files = [iqtt_scores("b", right[:, 1]), iqtt_scores("a", right[:, 0])]
    (d,) = compare(files).differences
    trials, count = only_a + only_b, len(right)
    assert d.test == "exact McNemar"
    assert (d.wins, d.losses, d.ties) == (only_a, only_b, 35)
    expected = binomtest(only_a, trials).pvalue if trials else 1.0
    assert d.p_value == d.p_holm == pytest.approx(expected)
    assert d.difference == pytest.approx((only_a - only_b) / count)
    assert d.verdict == ("better" if expected <= 0.05 else "not shown")
    assert d.smallest >= 6 / count


def test_the_least_difference_of_questions_is_corrected_too():
    """2^(1 - d) <= 0.05 / 3 needs d = 7 discordant questions, where one comparison needs 6."""
    files = [iqtt_scores(name, [1] * 40) for name in "abcd"]
    assert compare(files[:2]).differences[0].smallest == 6 / 40
    assert compare(files).differences[0].smallest == 7 / 40
    few = [iqtt_scores(name, [1, 0, 1, 1, 1]) for name in "ab"]
    assert compare(few).differences[0].smallest is None


def test_answers_averaged_over_runs_go_by_sign_flips():
    rng = np.random.default_rng(0)
    one = (rng.random(60) < 0.5).astype(float)
    mean = np.clip(one + rng.integers(0, 2, 60) / 3, 0.0, 1.0)
    files = [iqtt_scores("one", one), iqtt_scores("three", mean, runs=3)]
    comparison = compare(files)
    (d,) = comparison.differences
    assert d.test == "sign flips"
    assert d.difference == pytest.approx((mean - one).mean())
    assert d.verdict == "better"
    # Even where all runs agree, so that every mean is 0 or 1.
    agreeing = iqtt_scores("three", one, runs=3)
    assert compare([files[0], agreeing]).differences[0].test == "sign flips"


def test_questions_about_one_shape_are_not_independent():
    """Eight questions about each of 6 shapes, answered alike: as if there were 6 questions."""
    shapes = np.repeat(np.arange(6), 8)
    right = np.repeat([[1, 0], [1, 0], [1, 0], [1, 0], [1, 0], [1, 1]], 8, axis=0)
    plain = [iqtt_scores(name, right[:, k]) for k, name in ((1, "b"), (0, "a"))]
    files = [replace(file, columns={**file.columns, "shape": shapes}) for file in plain]
    (each,), (alike,) = (compare(some).differences for some in (plain, files))
    assert each.difference == alike.difference == pytest.approx(5 / 6)
    assert (each.test, alike.test) == ("exact McNemar", "sign flips")
    assert each.p_value < 1e-10
    assert alike.p_value == 2 / 2**5
    assert alike.high - alike.low > 2 * (each.high - each.low)
    single = [replace(file, columns={**file.columns, "shape": np.arange(48)}) for file in plain]
    assert compare(single).differences == compare(plain).differences


def test_rows_in_another_order_are_paired_by_number():
    rng = np.random.default_rng(1)
    columns = {"chamfer": rng.random(16)}
    first = rooms_scores("a", columns, SCENES)
    turned = rng.permutation(16)
    other = replace(first, columns={k: v[..., turned] for k, v in first.columns.items()})
    (d,) = compare([first, other], ["chamfer"]).differences
    assert (d.difference, d.low, d.high, d.p_value, d.ties) == (0.0, 0.0, 0.0, 1.0, 8)
    assert d.smallest is None
    assert d.verdict == "not shown"


@pytest.mark.parametrize(("scenes", "may"), [(1, False), (5, False), (6, True)])
def test_too_few_scenes_can_show_nothing(scenes, may):
    files = three_methods(views=3, scenes=scenes)[:2]
    comparison = compare(files, ["chamfer"])
    (d,) = comparison.differences
    assert d.p_value == least_p_value(scenes)
    assert (d.smallest is not None, d.verdict == "worse") == (may, may)
    assert (d.low is None) == (scenes == 1)
    assert (len(comparison.notes) == 0) == may


def test_rows_without_the_score_are_left_out():
    """A whole scene, and a view of another; values below 0 are as good as any."""
    nan = float("nan")
    ours = np.array([-0.5, nan, 0.25, 0.5, nan, nan, 0.75, 0.125])
    theirs = ours - np.array([0.25, 0.0, 0.5, -0.5, 0.0, 0.0, 0.125, 0.125])
    scenes = [0, 0, 1, 1, 2, 2, 3, 3]
    files = [rooms_scores(name, {"chamfer": np.zeros(8)}, scenes) for name in ("theirs", "ours")]
    files = [
        replace(file, columns={**file.columns, "relief_correlation": column})
        for file, column in zip(files, (theirs, ours), strict=True)
    ]
    (difference,) = compare(files, ["relief_correlation"]).differences
    assert (difference.wins, difference.losses, difference.ties) == (2, 0, 1)
    assert difference.difference == pytest.approx(np.mean([0.25, 0.0, 0.125]))
    assert difference.value == pytest.approx(np.mean([-0.5, 0.375, 0.4375]))
    assert difference.low <= difference.difference <= difference.high


def test_json_holds_every_attribute_and_no_nan():
    comparison = compare(three_methods(), ["chamfer", "f_score_0.05"])
    content = json.loads(to_json(comparison), parse_constant=pytest.fail)
    assert content["format"] == "pix2shape-bench/comparison"
    assert {field.name for field in fields(Comparison)} < set(content)
    assert (content["family"], content["alpha"], content["confidence"]) == (4, 0.05, 0.95)
    for difference, stored in zip(comparison.differences, content["differences"], strict=True):
        for field in fields(Difference):
            assert stored[field.name] == getattr(difference, field.name)
        assert stored["verdict"] == difference.verdict
    single = compare(
        [rooms_scores(n, {"chamfer": [0.1 * i]}, [0]) for i, n in enumerate("abc", 1)], ["chamfer"]
    )
    stored = json.loads(to_json(single), parse_constant=pytest.fail)["differences"][0]
    assert (stored["low"], stored["high"], stored["smallest"]) == (None, None, None)

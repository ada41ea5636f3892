"""Tests of the probes: they find planted leaks, and accuse no fair questions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from iqtt.audit.features.statistics import SHAPE_STATISTICS, statistics_record
from iqtt.audit.probes import rules
from iqtt.audit.probes.masks import RULES
from iqtt.audit.probes.rules import FRAMES, LIGHT, MIRRORED, OUTLINE, WITHOUT, Evidence, run_probes


@pytest.fixture(autouse=True)
def few_folds(monkeypatch):
    """Trees are fitted twice instead of five times: that is enough to find what is planted."""
    monkeypatch.setattr("iqtt.audit.probes.trees.FOLDS", 2)


def fair(seed, count=300, answers=3, **changes):
    """Questions of noise alone, whose right answers stand at balanced places."""
    rng = np.random.default_rng(seed)
    statistics = np.zeros(count, statistics_record(1 + answers))
    for name in statistics.dtype.names:
        shape = statistics[name].shape
        scalar = len(shape) == 2
        statistics[name] = rng.normal(1, 0.1, shape) if scalar else rng.random(shape)
    for name in ("pixel_distance", "outline_distance"):
        statistics[name] += statistics[name].swapaxes(1, 2).copy()
    right = rng.permutation(np.arange(count) % answers)
    mirrored = np.where(
        rng.random(count) < 0.5, (right + rng.integers(1, answers, count)) % answers, -1
    )
    cubes = {name: rng.integers(0, 6, (count, answers)).astype(float) for name in SHAPE_STATISTICS}
    frames = rng.random((count, answers, 19))
    return replace(Evidence(statistics, right, mirrored, cubes, frames, [right]), **changes)


def shortcuts(evidence):
    return {(p.statistic, p.rule, p.sees) for p in run_probes(evidence) if p.is_shortcut}


def one(evidence, statistic, rule, sees):
    asked = (statistic, rule, sees)
    (found,) = [p for p in run_probes(evidence) if (p.statistic, p.rule, p.sees) == asked]
    return found


def changed(evidence, name, values):
    statistics = evidence.statistics.copy()
    statistics[name] = values
    return replace(evidence, statistics=statistics)


@pytest.fixture
def quick(monkeypatch):
    """Leave out what is learned by forests."""
    monkeypatch.setattr(rules, "LEAST_QUESTIONS", 10**9)


@pytest.mark.usefixtures("quick")
def test_numbers_are_those_of_the_binomial_test():
    found = one(fair(0), "shape brightness", "nearest", LIGHT)
    values = fair(0).statistics["brightness"]
    nearest = np.abs(values[:, 1:] - values[:, :1]).argmin(axis=1)
    test = binomtest(int((nearest == fair(0).right).sum()), 300, 1 / 3, alternative="greater")
    assert (found.correct, found.n, found.chance) == (test.k, 300, 1 / 3)
    assert found.p_value == test.pvalue
    # Wilson 1927, as written there.
    p, z, n = found.accuracy, 1.959963984540054, 300
    half = z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    assert (found.low, found.high) == pytest.approx((middle - half, middle + half))


@pytest.mark.usefixtures("quick")
def test_fair_questions_are_seldom_accused():
    accused = [bool(shortcuts(fair(seed, 100))) for seed in range(20)]
    # One in a hundred; more than two of twenty would happen once in a thousand runs.
    assert sum(accused) <= 2


@pytest.mark.parametrize(
    ("name", "title", "factor"),
    [("brightness", "shape brightness", 1.02), ("extent", "silhouette extent", 0.95)],
)
@pytest.mark.usefixtures("quick")
def test_right_answers_brighter_or_smaller(name, title, factor):
    evidence = fair(1)
    values = 1 + (evidence.statistics[name] - 1) * 0.3  # images alike to 3%
    values[np.arange(300), 1 + evidence.right] *= factor
    found = shortcuts(changed(evidence, name, values))
    assert (title, "largest" if factor > 1 else "smallest", WITHOUT) in found


@pytest.mark.usefixtures("quick")
def test_light_that_goes_with_the_shape():
    evidence = fair(2)
    colors = evidence.statistics["colors"].copy()
    rows = np.arange(300)
    colors[rows, 1 + evidence.right] += 0.3 * (colors[:, 0] - colors[rows, 1 + evidence.right])
    assert ("shape colours", "nearest", LIGHT) in shortcuts(changed(evidence, "colors", colors))


@pytest.mark.usefixtures("quick")
def test_mirror_images_of_another_size():
    evidence = fair(4, 600)
    rows = np.flatnonzero(evidence.mirrored >= 0)
    area = np.ones((600, 4))
    area[rows, 1 + evidence.mirrored[rows]] = 1.02
    found = shortcuts(changed(evidence, "area", area))
    assert ("silhouette area", "nearest", MIRRORED) in found


@pytest.mark.usefixtures("quick")
def test_right_answers_like_the_reference_are_no_fault():
    evidence = fair(5)
    apart = evidence.statistics["pixel_distance"].copy()
    apart[np.arange(300), 0, 1 + evidence.right] *= 0.7
    evidence = changed(evidence, "pixel_distance", apart)
    assert one(evidence, "pixel distance", "nearest", OUTLINE).beats_chance
    assert shortcuts(evidence) == set()


@pytest.mark.parametrize(
    ("places", "rule"),
    [(np.arange(300) % 3, "after the last"), (np.arange(300) % 5 % 3 // 2, "most frequent")],
)
@pytest.mark.usefixtures("quick")
def test_places_that_can_be_foretold(places, rule):
    assert ("position", rule, WITHOUT) in shortcuts(fair(6, right=places, places=[places]))


def test_places_are_learned_from_other_questions():
    learned = rules.likely_places(np.array([1, 2, 1, 2, 1, 2]), np.array([0, 1, 2, 3, 4, 4]), 3)
    assert learned.tolist() == [0, 0, 0, 0, 2, 1]


def test_what_only_a_forest_sees():
    """A corner of the image, a number of stored frames, and cubes; outlines are no fault."""
    evidence, rows = fair(7), np.arange(300)
    statistics = evidence.statistics.copy()
    statistics["thumbnails"][rows, 1 + evidence.right, :40] += 0.25
    outline = statistics["outline"]
    outline[rows, 1 + evidence.right, 3] = outline[rows, 0, 3]
    evidence.frames[rows, evidence.right, 7] += 0.8  # no rule looks at this number
    evidence.cubes["spread of cubes"][rows, evidence.right] += 2
    probes = run_probes(replace(evidence, statistics=statistics))
    found = {(p.statistic, p.sees) for p in probes if p.is_shortcut and p.rule == "learned"}
    pixels = {("low-resolution pixels", WITHOUT), ("small patterns of pixels", WITHOUT)}
    certain = {("cubes of the options", WITHOUT), ("rotations and order of cubes", FRAMES)}
    certain |= {("low-resolution pixels", WITHOUT)}
    assert certain <= found <= certain | pixels
    assert {p.statistic for p in probes if p.is_shortcut and p.rule != "learned"} == {
        "spread of cubes"
    }
    (outlines,) = (p for p in probes if p.statistic == "silhouettes, by trees")
    assert (outlines.accuracy > 0.8, outlines.sees) == (True, OUTLINE)


@pytest.mark.usefixtures("quick")
def test_two_answers():
    found = run_probes(fair(15, answers=2))
    assert {p.chance for p in found} == {1 / 2}
    assert "odd one out" not in {p.rule for p in found}
    assert not any(p.is_shortcut for p in found)


@pytest.mark.usefixtures("quick")
def test_ties_are_no_answer():
    evidence = fair(9, 3000)
    found = one(changed(evidence, "area", 1), "silhouette area", "largest", WITHOUT)
    assert found.low < 1 / 3 < found.high
    every_first = changed(fair(9, 3000, right=np.zeros(3000, int)), "area", 1)
    assert one(every_first, "silhouette area", "largest", WITHOUT).accuracy < 0.36


@pytest.mark.usefixtures("quick")
def test_few_questions_or_none():
    assert run_probes(fair(0, 0)) == ()
    assert {p.n for p in run_probes(fair(0, 6)) if p.sees != MIRRORED} == {6}
    untold = fair(0, cubes={name: np.full((300, 3), np.nan) for name in SHAPE_STATISTICS})
    found = {p.statistic for p in run_probes(untold)}
    assert not found & {*SHAPE_STATISTICS, "cubes of the options"}


@pytest.mark.parametrize(
    ("p_values", "beat"), [((0.009, 0.0045, 0.004), 0), ((0.009, 0.0045, 0.003), 3)]
)
def test_holms_method_stops_at_the_first_that_may_be_chance(p_values, beat):
    """Of three, the least must be at most a third of ERROR_RATE, and the next a half."""
    assert rules.ERROR_RATE == 0.01
    probe = rules.Probe("s", "r", WITHOUT, 1, 2, 0.5, 0.0, 1.0, 0.0, beats_chance=False)
    judged = rules._judged([replace(probe, p_value=p) for p in p_values])
    assert sum(p.beats_chance for p in judged) == beat


def test_rules_on_masks_are_told_by_angle_and_are_no_shortcut(quick):
    evidence, angles = fair(3, 60), np.linspace(20, 120, 60)
    masks = np.random.default_rng(0).random((60, 3, len(RULES)))
    masks[np.arange(60), evidence.right, 0] -= angles < 40  # the first rule is right up to 40
    probes = run_probes(replace(evidence, masks=masks, angles=angles))
    by_angle = {p.rule: p for p in probes if p.statistic == f"{RULES[0]}, nearest"}
    assert by_angle.keys() == {"20-40", "40-60", "60-90", "90-120"}
    assert (by_angle["20-40"].accuracy, by_angle["20-40"].beats_chance) == (1, True)
    assert sum(p.n for p in by_angle.values()) == 60
    assert not [p for p in probes if p.is_shortcut]

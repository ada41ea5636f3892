"""Intervals: known values, coverage by simulation, and the same numbers every time."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.stats import binomtest

from metrics.measures import statistics
from metrics.measures.statistics import (
    bootstrap_interval,
    cluster_means,
    clustered_wilson_interval,
    design_effect,
    linearised_means,
    wilson_interval,
)

# Scenes of skewed errors, as distances are, with their means.
SKEWED = {
    "exponential": (lambda rng, n: rng.exponential(1.0, n), 1.0),
    "lognormal": (lambda rng, n: rng.lognormal(0.0, 0.8, n), np.exp(0.32)),
    "gamma": (lambda rng, n: rng.gamma(0.5, 1.0, n), 0.5),
    "nearly always right": (lambda rng, n: 1.0 - rng.beta(1.0, 20.0, n), 1.0 - 1.0 / 21.0),
}


def bootstrap_coverage(name, scenes, trials, resamples, seed):
    """How often the interval of scenes with 1 to 4 views each holds the true mean."""
    draw, mean = SKEWED[name]
    rng = np.random.default_rng(seed)
    hits = 0
    for trial in range(trials):
        views = np.repeat(np.arange(scenes), rng.integers(1, 5, scenes))
        # Views differ within a scene and agree with it on average.
        values = draw(rng, scenes)[views] * rng.uniform(0.5, 1.5, len(views))
        low, high = bootstrap_interval(cluster_means(values, views)[:, None], trial, resamples)
        hits += low[0] <= mean <= high[0]
    return hits / trials


@pytest.mark.parametrize("name", ["lognormal", "nearly always right"])
def test_bootstrap_covers(name):
    # 3 standard errors of 400 trials; the slow test below is the sharp one.
    assert bootstrap_coverage(name, 200, 400, 500, 1) == pytest.approx(0.95, abs=0.033)


@pytest.mark.slow
@pytest.mark.parametrize(("scenes", "least"), [(30, 0.92), (40, 0.925), (200, 0.93), (500, 0.93)])
@pytest.mark.parametrize("name", SKEWED)
def test_bootstrap_covers_92_to_97_percent(name, scenes, least):
    assert least <= bootstrap_coverage(name, scenes, 4000, 1000, 2) <= 0.97


@given(st.integers(1, 10**6), st.floats(0.0, 1.0), st.sampled_from([0.5, 0.9, 0.95, 0.999]))
def test_wilson_agrees_with_scipy(n, share, confidence):
    successes = round(n * share)
    expected = binomtest(successes, n).proportion_ci(confidence, method="wilson")
    found = wilson_interval(successes, n, confidence)
    assert found == pytest.approx((expected.low, expected.high), rel=1e-9, abs=1e-12)
    assert 0.0 <= found[0] <= successes / n <= found[1] <= 1.0


def correlated(rng, clusters, share):
    """Answers to 1 to 8 questions about each shape, whose own difficulties differ."""
    labels = np.repeat(np.arange(clusters), rng.integers(1, 9, clusters))
    return rng.random(len(labels)) < rng.beta(3 * share, 3 * (1 - share), clusters)[labels], labels


def test_the_first_terms_of_a_mean_over_clusters():
    """Of clusters (1, 3) and (5), the mean is 3; their sums are 2 below and 2 above 3 each."""
    terms = linearised_means([1.0, 3.0, 5.0], [0, 0, 1])
    assert terms[:, 0] == pytest.approx([3.0 - 4.0 / 3.0, 3.0 + 4.0 / 3.0])


def test_the_design_effect_is_kishs():
    """Of clusters of m equal values it is m, but for (S m - 1) / (S m - m); of none it is 1."""
    each = np.array([1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    for size in (1, 4):
        values, labels = np.repeat(each, size), np.repeat(np.arange(7), size)
        expected = size * (7 * size - 1) / (7 * size - size)
        assert design_effect(values, labels) == pytest.approx(expected)
    assert design_effect([1.0, 0.0, 0.0, 1.0], [0, 0, 1, 1]) == 1.0  # alike, were it not for chance
    assert design_effect([1.0, 0.0, 1.0], [5, 5, 5]) == 3.0
    assert design_effect([1.0, 1.0, 1.0], [0, 0, 1]) == 1.0


@given(st.integers(0, 2**32 - 1), st.integers(1, 30))
def test_clusters_never_shorten_an_interval(seed, clusters):
    right, labels = correlated(np.random.default_rng(seed), clusters, 0.6)
    low, high = clustered_wilson_interval(right.astype(int), labels)
    plain = wilson_interval(int(right.sum()), len(right))
    assert 0.0 <= low <= plain[0] + 1e-12
    assert plain[1] - 1e-12 <= high <= 1.0
    alone = clustered_wilson_interval(right.astype(int), np.arange(len(right)))
    assert alone == pytest.approx(plain, abs=1e-12)
    values = right + 0.5
    assert linearised_means(values, labels).mean() == pytest.approx(values.mean())
    assert linearised_means(values, np.arange(len(values)))[:, 0].tolist() == values.tolist()


@pytest.mark.parametrize("rare", [False, True])
def test_the_studentised_interval_is_that_of_a_plain_loop(rare):
    values = np.random.default_rng(3).lognormal(0.0, 1.0, 25)
    if rare:  # resamples without the one that differs have no variance of their own
        values = np.where(np.arange(25) == 7, 1.0, 0.0)
    error = values.std()
    drawn = np.random.default_rng(5).integers(0, 25, (400, 25))
    scaled = [
        (values[d].mean() - values.mean()) / max(values[d].std(), np.sqrt(0.1) * error)
        for d in drawn
    ]
    low, high = values.mean() - error * np.quantile(scaled, [0.975, 0.025])
    ends = bootstrap_interval(values[:, None], 5, 400)
    expected = (max(low, values.min()), min(high, values.max()))
    assert (ends[0].item(), ends[1].item()) == pytest.approx(expected)


def test_means_of_scenes_then_of_all():
    values, scenes = [1.0, 3.0, 10.0, 20.0, 30.0], ["b", "b", "a", "a", "a"]
    assert cluster_means(values, scenes).tolist() == [20.0, 2.0]
    two = cluster_means(np.stack([values, np.ones(5)], axis=1), scenes)
    assert two.tolist() == [[20.0, 1.0], [2.0, 1.0]]


@given(st.integers(0, 2**32 - 1), st.floats(-5.0, 5.0), st.sampled_from([0.01, 3.0, 1e30]))
def test_the_interval_moves_with_the_values_and_holds_the_mean(seed, shift, scale):
    values = np.random.default_rng(seed).exponential(1.0, (40, 2))
    low, high = bootstrap_interval(values, 1, 200)
    assert (low < values.mean(axis=0)).all()
    assert (values.mean(axis=0) < high).all()
    ends = bootstrap_interval(scale * (values + shift), 1, 200)
    assert ends[0] == pytest.approx(scale * (low + shift), rel=1e-6, abs=1e-6 * scale)
    assert ends[1] == pytest.approx(scale * (high + shift), rel=1e-6, abs=1e-6 * scale)


@example([1 / 3, 1 / 3 + 1e-16, 1 / 3 - 5e-17], 0, 43)
@given(
    st.lists(
        st.sampled_from([0.0, 1 / 3, 1 / 3 + 1e-16, 1 / 3 - 5e-17, 1e-162, -2e-162, 1e90, 5e-324]),
        min_size=1,
    ),
    st.integers(0, 2**32 - 1),
    st.integers(1, 40),
)
def test_the_mean_of_odd_values_lies_in_its_interval(some, seed, count):
    values = np.random.default_rng(seed).choice(some, (count, 1))
    low, high = bootstrap_interval(values, seed, 100)
    mean = values.mean(axis=0)
    assert np.isnan(low).all() if count == 1 else (low <= mean).all() and (mean <= high).all()


def test_the_size_of_the_pieces_does_not_matter(monkeypatch):
    values = np.random.default_rng(0).random((60, 2))
    expected = bootstrap_interval(values, 9)
    monkeypatch.setattr(statistics, "DRAWS_HELD", 1)
    assert np.array_equal(bootstrap_interval(values, 9), expected)


def test_few_scenes_and_constant_scores():
    assert np.isnan(bootstrap_interval(cluster_means([[2.0], [4.0]], [7, 7]), seed=0)).all()
    for value in (0.1, 0.7, 0.0, 1e90):
        constant = np.full((30, 1), value)
        low, high = bootstrap_interval(constant, seed=0)
        assert low == high == constant.mean() == pytest.approx(value)
    assert bootstrap_interval([[0.0], [1.0]], seed=0) == ([0.0], [1.0])

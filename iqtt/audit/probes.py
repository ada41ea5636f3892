"""Can questions be answered without comparing shapes? Fixed rules try, and learned ones.

What a probe looks at decides what its success means:

- WITHOUT: it looks at the three answers only, at their images or even their cubes, or at the
  positions of right answers. If it beats chance, the questions have a fault.
- LIGHT: it compares brightness and colours of the answers with the reference's. Lights are drawn
  for each image, so they must not tell a shape: beating chance is a fault too.
- MIRRORED: it chooses between the right answer and its mirror image, by what a mirror keeps: size,
  framing, light and outline. Turned at random, both have the same distribution of these, so beating
  chance, 1/2 here, is a fault of the images.
- OUTLINE: it compares size, framing and outline of the answers with the reference's. All images
  have one camera and one size of cubes, so these depend on the shape: a long shape has a long
  silhouette. Such a probe may beat chance; its share says how much can be seen without rotating
  anything in the mind.

The rules are fixed beforehand; learned ones are cross-validated, so a question is never answered by
a classifier that saw it. Whether a probe beats chance is decided by a one-sided binomial test,
corrected by Holm's method ("A simple sequentially rejective multiple test procedure", 1979) for the
number of probes that must not, so that a fair set of questions fails in one audit of a hundred. As
the classifiers of cross-validation share most of their training questions, their counts vary a
fifth more on noise than those of independent guesses.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
WITHOUT, LIGHT, MIRRORED, OUTLINE = "without the reference", "light", "mirrored", "outline"
FAULTS = (WITHOUT, LIGHT, MIRRORED)
"""Kinds of probes that must not beat chance."""
ERROR_RATE = 0.01  # probability that some probe of a fair set of questions seems to beat chance
FOLDS = 5  # of the cross-validation
LEAST_QUESTIONS = 50  # a classifier learns nothing from fewer
COMPONENTS = 24  # principal components of thumbnails that classifiers see

_LIGHT = {
    "brightness": "shape's brightness",
    "contrast": "shape's contrast",
    "colors": "shape's colours",
}
_OUTLINE = {
    "area": "silhouette's area",
    "extent": "silhouette's extent",
    "offset": "silhouette's place",
    "moments": "silhouette's moments",
    "image_brightness": "image's brightness",
}
_SIZE, _NEARNESS = ("largest", "smallest"), ("nearest", "farthest")
_SUMMARY = ("mean_color", "contrast", *_OUTLINE)


@dataclass(frozen=True)
class Probe:
    """How often a rule found the right answer.

    Attributes:
        statistic: what it looks at.
        rule: how it chooses.
        sees: the kind of probe: WITHOUT, LIGHT, MIRRORED or OUTLINE.
        correct, n: number of questions answered rightly, and of all that were tried.
        chance: share of right answers of a guess.
        low, high: 95% Wilson interval of the share of right answers.
        p_value: probability that guessing gets so many right, or more.
        beats_chance: whether that is too improbable, the number of probes considered.
    """

    statistic: str
    rule: str
    sees: str
    correct: int
    n: int
    chance: float
    low: float
    high: float
    p_value: float
    beats_chance: bool

    @property
    def accuracy(self) -> float:
        """Share of questions answered rightly."""
        return self.correct / self.n

    @property
    def is_shortcut(self) -> bool:
        """Whether it beats chance, though a probe of its kind must not."""
        return self.beats_chance and self.sees in FAULTS


@dataclass(frozen=True, eq=False)
class Evidence:
    """What probes may look at, of N questions.

    Attributes:
        statistics: `statistics.STATISTICS` of the images, (N,).
        right: which answer is right, (N,).
        mirrored: which answer is the right one's mirror image, (N,); -1 for none.
        cubes: numbers that describe the answers' shapes, (N, 3) each, by name; NaN where the file
            does not tell the shapes.
        places: positions of the right answers of whole tables, in their order, (Q,) each.
    """

    statistics: Array
    right: Array
    mirrored: Array
    cubes: dict[str, Array]
    places: Sequence[Array]


_Guess: TypeAlias = tuple[str, str, str, Array]
"""Statistic, rule and kind of a probe, and which questions it answered rightly, (n,) bool."""


def run_probes(evidence: Evidence) -> tuple[Probe, ...]:
    """Run all probes that the evidence allows; none without questions."""
    guesses = [*_by_rule(evidence), *_by_mirror(evidence), *_learned(evidence)]
    guesses += _by_place(evidence.places)
    probes = [_probe(*guess) for guess in guesses if len(guess[3])]
    faults = [probe for probe in probes if probe.sees in FAULTS]
    others = [probe for probe in probes if probe.sees not in FAULTS]
    return (*_judged(faults), *_judged(others))


def _probe(statistic: str, rule: str, sees: str, hits: Array) -> Probe:
    from scipy.stats import binomtest

    correct, n = int(np.count_nonzero(hits)), len(hits)
    chance = 1 / 2 if sees == MIRRORED else 1 / 3
    test = binomtest(correct, n, chance, alternative="greater")
    interval = binomtest(correct, n, chance).proportion_ci(0.95, method="wilson")
    numbers = (float(interval.low), float(interval.high), float(test.pvalue))
    return Probe(statistic, rule, sees, correct, n, chance, *numbers, beats_chance=False)


def _judged(probes: Sequence[Probe]) -> list[Probe]:
    """Find out by Holm's method which probes beat chance: the smallest p-values up to one that is
    too large.
    """
    p_values = np.array([probe.p_value for probe in probes])
    order = np.argsort(p_values, kind="stable")
    small = p_values[order] <= ERROR_RATE / np.arange(len(probes), 0, -1)
    beats = np.empty(len(probes), np.bool_)
    beats[order] = np.logical_and.accumulate(small)
    return [replace(p, beats_chance=b) for p, b in zip(probes, beats.tolist(), strict=True)]


def _by_rule(evidence: Evidence) -> Iterator[_Guess]:
    statistics, right = evidence.statistics, evidence.right
    for name, title in {**_LIGHT, **_OUTLINE}.items():
        values, sees = statistics[name], LIGHT if name in _LIGHT else OUTLINE
        if values.ndim == 2:
            yield from _by_cost(title, WITHOUT, _SIZE, -values[:, 1:], right)
        yield from _by_distance(title, sees, _distances(values), right)
    yield from _by_distance("pixel distance", OUTLINE, statistics["pixel_distance"], right)
    for title, values in evidence.cubes.items():
        told = np.isfinite(values).all(axis=1)
        yield from _by_cost(title, WITHOUT, _SIZE, -values[told], right[told])
        yield from _by_company(title, _distances(values[told]), right[told])


def _by_cost(
    statistic: str, sees: str, rules: tuple[str, str], costs: Array, right: Array
) -> Iterator[_Guess]:
    """Guess, by two rules, the answer of least and that of most cost; costs: (N, K)."""
    for rule, signed in zip(rules, (costs, -costs), strict=True):
        yield (statistic, rule, sees, _least(signed) == right)


def _by_company(title: str, apart: Array, right: Array) -> Iterator[_Guess]:
    """Guess by how far each answer is from the other two; apart: distances, (N, 3, 3)."""
    rules = ("most typical", "odd one out")
    yield from _by_cost(title, WITHOUT, rules, apart.sum(axis=2), right)


def _by_distance(title: str, sees: str, apart: Array, right: Array) -> Iterator[_Guess]:
    """Guess by the distances between the four images; apart: (N, 4, 4)."""
    yield from _by_company(title, apart[:, 1:, 1:], right)
    yield from _by_cost(title, sees, _NEARNESS, apart[:, 0, 1:], right)


def _by_mirror(evidence: Evidence) -> Iterator[_Guess]:
    rows = np.flatnonzero(evidence.mirrored >= 0)
    both = 1 + np.stack([evidence.right[rows], evidence.mirrored[rows]], axis=1)
    for name, title in {**_LIGHT, **_OUTLINE}.items():
        apart = _distances(evidence.statistics[name][rows])[:, 0]
        pair = np.take_along_axis(apart, both, axis=1)
        yield from _by_cost(title, MIRRORED, _NEARNESS, pair, np.zeros(len(rows)))


def _learned(evidence: Evidence) -> Iterator[_Guess]:
    right = evidence.right
    if len(right) < LEAST_QUESTIONS:
        return
    summary = [evidence.statistics[name][:, 1:] for name in _SUMMARY]
    wide = np.concatenate([v.reshape(len(right), 3, -1) for v in summary], axis=2)
    pixels = components(evidence.statistics["thumbnails"][:, 1:])
    features = {"low-resolution pixels": pixels, "all statistics": wide}
    for title, values in features.items():
        hits = choose(values, right) == right
        yield (title, "learned", WITHOUT, hits)
    cubes = np.stack(list(evidence.cubes.values()), axis=2)
    told = np.isfinite(cubes).all(axis=(1, 2))
    if np.count_nonzero(told) >= LEAST_QUESTIONS:
        hits = choose(cubes[told], right[told]) == right[told]
        yield ("answers' cubes", "learned", WITHOUT, hits)


def _by_place(places: Sequence[Array]) -> list[_Guess]:
    def hits(context: Callable[[Array], Array]) -> Array:
        right = [likely_places(one, context(one)) == one for one in places]
        return np.concatenate([np.zeros(0, np.bool_), *right])

    def before(one: Array) -> Array:
        return np.concatenate([[3], one[:-1]]) if len(one) else one

    return [
        ("place", "commonest", WITHOUT, hits(np.zeros_like)),
        ("place", "after the last", WITHOUT, hits(before)),
    ]


def _distances(values: Array) -> Array:
    """Return the distances between K images of each question: (N, K[, D]) to (N, K, K)."""
    wide = values if values.ndim == 3 else values[:, :, None]
    columns = [np.abs(wide - wide[:, k : k + 1]).sum(axis=2) for k in range(wide.shape[1])]
    return np.stack(columns, axis=2)


def _least(costs: Array) -> Array:
    """Return which of K costs is least, (N, K) to (N,); ties go to one that depends on the row.

    They do not go to the first, because the right answer's place would then show in every
    statistic with ties.
    """
    count = costs.shape[1]
    row = np.arange(len(costs))
    order = ((row * 2_654_435_761 >> 9)[:, None] + np.arange(count)) % count
    found = np.take_along_axis(costs, order, axis=1).argmin(axis=1)
    return np.asarray(order[row, found])


def choose(features: Array, right: Array) -> Array:
    """Return which answer gradient-boosted trees prefer in each question, cross-validated, (N,).

    They score each answer by its features and by how these stand to the features of the other two.
    The same input gives the same output: there is no random choice, and one thread.

    Args:
        features: features of the answers, (N, 3, D).
        right: which answer is right, (N,).
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    seen = _among_others(features.astype(np.float32))
    is_right = np.arange(3) == right[:, None]
    fold = np.arange(len(right)) % FOLDS
    chosen = np.zeros(len(right), np.int64)
    with _one_thread():
        for k in range(FOLDS):
            trees = HistGradientBoostingClassifier(
                max_iter=60,
                max_leaf_nodes=8,
                min_samples_leaf=20,
                l2_regularization=1.0,
                early_stopping=False,
                random_state=0,
            )
            known, asked = fold != k, fold == k
            trees.fit(seen[known].reshape(-1, seen.shape[2]), is_right[known].reshape(-1))
            score = trees.predict_proba(seen[asked].reshape(-1, seen.shape[2]))[:, 1]
            chosen[asked] = score.reshape(-1, 3).argmax(axis=1)
    return chosen


def components(thumbnails: Array) -> Array:
    """Return the images' principal components, (N, 3, P) to (N, 3, at most COMPONENTS)."""
    flat = thumbnails.reshape(-1, thumbnails.shape[2]).astype(np.float64)
    flat = flat - flat.mean(axis=0)
    with _one_thread():
        _, axes = np.linalg.eigh(flat.T @ flat)
        found = flat @ axes[:, ::-1][:, :COMPONENTS]
    return np.asarray(found.reshape(*thumbnails.shape[:2], -1))


def likely_places(answers: Array, context: Array) -> Array:
    """Return the most frequent right answer in the same context in other questions, (Q,).

    Args:
        answers: right answers, (Q,).
        context: small whole numbers, (Q,).
    """
    fold = np.arange(len(answers)) % FOLDS
    counts = np.zeros((FOLDS, context.max(initial=0) + 1, 3), np.int64)
    np.add.at(counts, (fold, context, answers), 1)
    learned = (counts.sum(axis=0) - counts).argmax(axis=2)
    return np.asarray(learned[fold, context])


def _among_others(features: Array) -> Array:
    """Return each answer's features, and how they stand to those of the other two, (N, 3, 4 D)."""
    second, third = (np.roll(features, -k, axis=1) for k in (1, 2))
    apart = np.abs(features - second) + np.abs(features - third)
    return np.concatenate(
        [features, features - (second + third) / 2, apart, np.abs(second - third)], axis=2
    )


@contextmanager
def _one_thread() -> Iterator[None]:
    """Use one thread: sums then have one order, so that the same input gives the same bits."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield

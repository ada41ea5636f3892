"""Can questions be answered without comparing shapes? Fixed rules, and learned ones.

What a probe looks at decides what its success means:

- WITHOUT: the three answers alone, or even their cubes, or where the right ones stand. Whatever
  beats chance there is a fault of the questions.
- LIGHT: brightness and colours of the shape's own pixels, beside the reference's. Lights are drawn
  for each image, so they cannot tell a shape: a fault too.
- MIRRORED: the right answer or its mirror image, by what a mirror keeps of size, framing, light
  and outline. Turned at random, both have the same distribution of these, so what beats chance,
  1/2 here, is a fault of how images are made.
- OUTLINE: size, framing and outline, beside the reference's. With one cube size and one camera for
  all images these are the shape's: a long shape has a long silhouette. A shape is told by them now
  and then, rightly; how often says how much the eye sees without turning anything in mind.

The rules fix beforehand which way they choose: nothing is tuned to the answers but by
cross-validation. Whether a probe beats chance is decided by one-sided binomial tests, corrected
(Holm, "A simple sequentially rejective multiple test procedure", 1979) for the number of probes
that must not, so that a fair set of questions is accused once in a hundred audits.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit import learned_probes
from iqtt.audit.image_statistics import Statistics

Array = NDArray[Any]
WITHOUT, LIGHT, MIRRORED, OUTLINE = "without the reference", "light", "mirrored", "outline"
FAULTS = (WITHOUT, LIGHT, MIRRORED)
"""What must not tell the right answer."""
ERROR_RATE = 0.01  # of any probe of a fair set of questions seeming to beat chance

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
_SUMMARY = ("mean_color", "contrast", *_OUTLINE)


@dataclass(frozen=True)
class Probe:
    """How often a rule found the right answer.

    Attributes:
        statistic: what it looks at.
        rule: how it chooses.
        sees: which kind of thing that is: WITHOUT, LIGHT, MIRRORED or OUTLINE.
        correct, n: questions answered rightly, of how many.
        chance: the share that guessing gets right.
        low, high: 95% Wilson interval of the share.
        p_value: how often guessing gets so many right.
        beats_chance: whether that is too seldom, the number of probes considered.
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
        """Share of the questions that were answered rightly."""
        return self.correct / self.n

    @property
    def is_shortcut(self) -> bool:
        """Whether it beats chance by what must not tell the right answer."""
        return self.beats_chance and self.sees in FAULTS


@dataclass(frozen=True, eq=False)
class Evidence:
    """What probes may look at, N questions.

    Attributes:
        statistics: of the images.
        right: which answer is right, (N,).
        mirrored: which answer is the right one's mirror image, (N,); -1 for none.
        cubes: numbers that describe the answers' shapes, each (N, 3), by name; NaN where they are
            not told.
        places: right answers of whole tables in their order, (Q,) each.
    """

    statistics: Statistics
    right: Array
    mirrored: Array
    cubes: dict[str, Array]
    places: Sequence[Array]


@dataclass(frozen=True, eq=False)
class _Guess:
    """How a probe did on each of the questions that it answered, (n,) bool."""

    statistic: str
    rule: str
    sees: str
    hits: Array


def run_probes(evidence: Evidence) -> tuple[Probe, ...]:
    """Run all probes that the evidence allows; none without questions."""
    guesses = [*_by_rule(evidence), *_by_mirror(evidence), *_learned(evidence)]
    guesses += _by_place(evidence.places)
    probes = [_probe(guess) for guess in guesses if len(guess.hits)]
    faults = [probe for probe in probes if probe.sees in FAULTS]
    others = [probe for probe in probes if probe.sees not in FAULTS]
    return (*_judged(faults), *_judged(others))


def _probe(guess: _Guess) -> Probe:
    from scipy.stats import binomtest

    correct, n = int(np.count_nonzero(guess.hits)), len(guess.hits)
    chance = 1 / 2 if guess.sees == MIRRORED else 1 / 3
    test = binomtest(correct, n, chance, alternative="greater")
    interval = binomtest(correct, n, chance).proportion_ci(0.95, method="wilson")
    low, high = float(interval.low), float(interval.high)
    names = (guess.statistic, guess.rule, guess.sees)
    return Probe(*names, correct, n, chance, low, high, float(test.pvalue), False)


def _judged(probes: Sequence[Probe]) -> list[Probe]:
    """Say which beat chance, by Holm's procedure."""
    order = np.argsort([probe.p_value for probe in probes], kind="stable").tolist()
    judged = list(probes)
    for tried, i in enumerate(order):
        if probes[i].p_value > ERROR_RATE / (len(probes) - tried):
            break
        judged[i] = replace(probes[i], beats_chance=True)
    return judged


def _by_rule(evidence: Evidence) -> Iterator[_Guess]:
    statistics, right = evidence.statistics, evidence.right
    for name, title in {**_LIGHT, **_OUTLINE}.items():
        values, sees = getattr(statistics, name), LIGHT if name in _LIGHT else OUTLINE
        if values.ndim == 2:
            yield from _by_size(title, values[:, 1:], right)
        yield from _by_distance(title, sees, _distances(values), right)
    yield from _by_distance("pixel distance", OUTLINE, statistics.pixel_distance, right)
    for title, values in evidence.cubes.items():
        told = np.isfinite(values).all(axis=1)
        yield from _by_size(title, values[told], right[told])
        apart = _distances(values[told])
        yield from _by_company(title, apart, right[told])


def _by_size(title: str, values: Array, right: Array) -> Iterator[_Guess]:
    yield _Guess(title, "largest", WITHOUT, _least(-values) == right)
    yield _Guess(title, "smallest", WITHOUT, _least(values) == right)


def _by_company(title: str, apart: Array, right: Array) -> Iterator[_Guess]:
    """Guess by how far each answer is from the other two; distances (N, 3, 3)."""
    far = apart.sum(axis=2)
    yield _Guess(title, "most typical", WITHOUT, _least(far) == right)
    yield _Guess(title, "odd one out", WITHOUT, _least(-far) == right)


def _by_distance(title: str, sees: str, apart: Array, right: Array) -> Iterator[_Guess]:
    """Guess by the distances between all four images, (N, 4, 4)."""
    yield from _by_company(title, apart[:, 1:, 1:], right)
    yield _Guess(title, "nearest", sees, _least(apart[:, 0, 1:]) == right)
    yield _Guess(title, "farthest", sees, _least(-apart[:, 0, 1:]) == right)


def _by_mirror(evidence: Evidence) -> Iterator[_Guess]:
    rows = np.flatnonzero(evidence.mirrored >= 0)
    both = 1 + np.stack([evidence.right[rows], evidence.mirrored[rows]], axis=1)
    for name, title in {**_LIGHT, **_OUTLINE}.items():
        apart = _distances(getattr(evidence.statistics, name)[rows])[:, 0]
        pair = np.take_along_axis(apart, both, axis=1)
        yield _Guess(title, "nearest", MIRRORED, _least(pair) == 0)
        yield _Guess(title, "farthest", MIRRORED, _least(-pair) == 0)


def _learned(evidence: Evidence) -> Iterator[_Guess]:
    right = evidence.right
    if len(right) < learned_probes.LEAST_QUESTIONS:
        return
    summary = [getattr(evidence.statistics, name)[:, 1:] for name in _SUMMARY]
    wide = np.concatenate([v.reshape(len(right), 3, -1) for v in summary], axis=2)
    pixels = learned_probes.components(evidence.statistics.thumbnails[:, 1:])
    features = {"low-resolution pixels": pixels, "all statistics": wide}
    for title, values in features.items():
        hits = learned_probes.choose(values, right) == right
        yield _Guess(title, "learned", WITHOUT, hits)
    cubes = np.stack(list(evidence.cubes.values()), axis=2)
    told = np.isfinite(cubes).all(axis=(1, 2))
    if np.count_nonzero(told) >= learned_probes.LEAST_QUESTIONS:
        hits = learned_probes.choose(cubes[told], right[told]) == right[told]
        yield _Guess("answers' cubes", "learned", WITHOUT, hits)


def _by_place(places: Sequence[Array]) -> list[_Guess]:
    def hits(context: Callable[[Array], Array]) -> Array:
        right = [learned_probes.places(one, context(one)) == one for one in places]
        return np.concatenate([np.zeros(0, np.bool_), *right])

    def before(one: Array) -> Array:
        return np.concatenate([[3], one[:-1]]) if len(one) else one

    return [
        _Guess("place", "commonest", WITHOUT, hits(np.zeros_like)),
        _Guess("place", "after the last", WITHOUT, hits(before)),
    ]


def _distances(values: Array) -> Array:
    """Return how far K images of each question are from each other: (N, K[, D]) to (N, K, K)."""
    wide = values if values.ndim == 3 else values[:, :, None]
    columns = [np.abs(wide - wide[:, k : k + 1]).sum(axis=2) for k in range(wide.shape[1])]
    return np.stack(columns, axis=2)


def _least(costs: Array) -> Array:
    """Return which of K costs is least, (N, K) to (N,); ties fall to any, as the row will have it.

    Not to the first: the right answer's place would then show in every statistic with ties.
    """
    count = costs.shape[1]
    row = np.arange(len(costs))
    order = ((row * 2_654_435_761 >> 9)[:, None] + np.arange(count)) % count
    found = np.take_along_axis(costs, order, axis=1).argmin(axis=1)
    return np.asarray(order[row, found])

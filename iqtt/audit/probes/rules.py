"""Can questions be answered without comparing shapes? Fixed rules try, and learned ones.

What a probe looks at decides what its success means:

- WITHOUT: it looks at the three answers only, at their images or even their cubes, or at the
  positions of right answers. If it beats chance, the questions have a fault.
- LIGHT: it compares brightness and colours of the answers with the reference's. Lights are drawn
  for each image, so they must not tell a shape: beating chance is a fault too.
- MIRRORED: it chooses between the right answer and its mirror image, by what a mirror keeps: size,
  framing, light and outline. Turned at random, both have the same distribution of these, so beating
  chance, 1/2 here, is a fault of the images.
- FRAMES: it looks at the frames in which the file stores shapes: the rotations of the answers next
  to the reference's, and the order of their cubes. A submission never sees these, but whoever
  trains on the truth does. Beating chance is a fault.
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

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.features.outlines import nearest_outline
from iqtt.audit.features.statistics import THUMBNAIL
from iqtt.audit.probes.masks import RULES
from iqtt.audit.probes.patterns import pattern_responses
from iqtt.audit.probes.trees import FOLDS, among_others, choose, next_to_reference
from iqtt.perspective.specs import ANGLE_BINS
from scenegen.common.threads import one_thread

Array = NDArray[Any]
WITHOUT, LIGHT, MIRRORED = "without the reference", "light", "mirrored"
FRAMES, OUTLINE = "stored frames", "outline"
FAULTS = (WITHOUT, LIGHT, MIRRORED, FRAMES)
"""Kinds of probes that must not beat chance."""
ERROR_RATE = 0.01  # probability that some probe of a fair set of questions seems to beat chance
LEAST_QUESTIONS = 50  # a classifier learns nothing from fewer
COMPONENTS = 24  # principal components of thumbnails that classifiers see
PATCH = 8  # pixels of a thumbnail's patch
SPANS = tuple(f"{low}-{high}" for low, high in itertools.pairwise(ANGLE_BINS))  # degrees
PATTERN_QUESTIONS = 2_000  # whose pictures are searched for small patterns

_LIGHT = {
    "brightness": "shape brightness",
    "contrast": "shape contrast",
    "colors": "shape colours",
}
_OUTLINE = {
    "area": "silhouette area",
    "extent": "silhouette extent",
    "offset": "silhouette position",
    "moments": "silhouette moments",
    "image_brightness": "image brightness",
}
_SIZE, _NEARNESS = ("largest", "smallest"), ("nearest", "farthest")
_SUMMARY = ("mean_color", "contrast", *_OUTLINE)


@dataclass(frozen=True)
class Probe:
    """How often a rule found the right answer.

    Attributes:
        statistic: what it looks at.
        rule: how it chooses.
        sees: the kind of probe: WITHOUT, LIGHT, MIRRORED, FRAMES or OUTLINE.
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
        statistics: of the images, as `statistics.measure` gives them, (N,).
        right: which answer is right, (N,).
        mirrored: which answer is the right one's mirror image, (N,); -1 for none.
        cubes: numbers that describe the answers' shapes, (N, K) each, by name; NaN where the file
            does not tell the shapes.
        frames: numbers that describe how the answers' shapes are stored next to the reference's,
            (N, K, D), as `frames.stored_frames` gives them; NaN where the file does not tell them.
        places: positions of the right answers of whole tables, in their order, (Q,) each.
        masks: how options differ by `masks.RULES`, (N, K, R), of questions about rooms; None of
            others. Light belongs to a room, so comparisons with the reference may beat chance.
        angles: between the views of reference and correct option, degrees, (N,).
    """

    statistics: Array
    right: Array
    mirrored: Array
    cubes: dict[str, Array]
    frames: Array
    places: Sequence[Array]
    masks: Array | None = None
    angles: Array | None = None

    @property
    def answers(self) -> int:
        """How many answers a question has, K."""
        return int(self.statistics.dtype["area"].shape[0]) - 1


_Guess: TypeAlias = tuple[str, str, str, Array]
"""Statistic, rule and kind of a probe, and which questions it answered rightly, (n,) bool."""


def run_probes(evidence: Evidence) -> tuple[Probe, ...]:
    """Run all probes that the evidence allows; none without questions."""
    statistics, right, masks = evidence.statistics, evidence.right, evidence.masks
    guesses = [*_by_picture(statistics, right, masks is not None)]
    guesses += [*_by_shape(evidence), *_by_mirror(evidence)]
    if masks is not None:
        guesses += _of_rooms(statistics, right, masks)
        if evidence.angles is not None:
            guesses += _by_angle(guesses, evidence.angles)
    if len(right) >= LEAST_QUESTIONS:
        guesses += [*_learned(evidence), *_learned_outlines(statistics, right)]
    return _probes(guesses + _by_place(evidence.places, evidence.answers), evidence.answers)


def run_floor_probes(
    statistics: Array, right: Array, masks: Array | None = None
) -> tuple[Probe, ...]:
    """Run the probes that may beat chance: they hold pictures of answers against the reference.

    The arguments are those of `Evidence`, of at least LEAST_QUESTIONS questions.
    """
    guesses = [*_by_picture(statistics, right, masks is not None)]
    guesses += [] if masks is None else _of_rooms(statistics, right, masks)
    answers = statistics["area"].shape[1] - 1
    seen = [guess for guess in guesses if guess[2] == OUTLINE]
    return _probes([*seen, *_learned_outlines(statistics, right)], answers)


def _probes(guesses: Sequence[_Guess], answers: int) -> tuple[Probe, ...]:
    probes = [_probe(*guess, 1 / answers) for guess in guesses if len(guess[3])]
    faults = [probe for probe in probes if probe.sees in FAULTS]
    others = [probe for probe in probes if probe.sees not in FAULTS]
    return (*_judged(faults), *_judged(others))


def _probe(statistic: str, rule: str, sees: str, hits: Array, chance: float) -> Probe:
    from scipy.stats import binomtest

    correct, n = int(np.count_nonzero(hits)), len(hits)
    chance = 1 / 2 if sees == MIRRORED else chance
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


def _by_picture(statistics: Array, right: Array, of_rooms: bool = False) -> Iterator[_Guess]:
    for name, title in {**_LIGHT, **_OUTLINE}.items():
        values, sees = statistics[name], OUTLINE if of_rooms or name not in _LIGHT else LIGHT
        if values.ndim == 2:
            yield from _by_cost(title, WITHOUT, _SIZE, -values[:, 1:], right)
        yield from _by_distance(title, sees, _distances(values), right)
    yield from _by_distance("pixel distance", OUTLINE, statistics["pixel_distance"], right)
    apart = nearest_outline(statistics["outline_distance"])
    yield from _by_distance("silhouette, rotated or flipped", OUTLINE, apart, right)


def _of_rooms(statistics: Array, right: Array, masks: Array) -> Iterator[_Guess]:
    yield from _by_patches(statistics, right)
    for number, name in enumerate(RULES):
        yield from _by_cost(name, OUTLINE, _NEARNESS, masks[..., number], right)
    if len(right) >= LEAST_QUESTIONS:
        chosen = choose(among_others(masks), right)
        yield ("rules on masks, by trees", "learned", OUTLINE, chosen == right)


def _by_angle(guesses: Sequence[_Guess], angles: Array) -> list[_Guess]:
    """Return guesses of what is nearest to the reference, for each bin of angles."""
    bins = np.digitize(angles, ANGLE_BINS[1:-1])
    return [
        (f"{statistic}, {rule}", span, OUTLINE, hits[bins == number])
        for statistic, rule, sees, hits in guesses if sees == OUTLINE and rule != "farthest"
        for number, span in enumerate(SPANS)
    ]  # fmt: skip


def _by_patches(statistics: Array, right: Array) -> Iterator[_Guess]:
    """Guess by how well patches of the reference are found anywhere in each answer.

    Patches have PATCH pixels a side of the thumbnails; their correlation is compared.
    """
    from numpy.lib.stride_tricks import sliding_window_view

    shots = statistics["thumbnails"]
    shots = shots.reshape(*shots.shape[:2], THUMBNAIL, THUMBNAIL)
    costs = np.zeros((len(right), shots.shape[1] - 1))
    for row, images in enumerate(shots):
        flat = sliding_window_view(images, (PATCH, PATCH), axis=(1, 2))[:, ::2, ::2]
        flat = flat.reshape(len(images), -1, PATCH * PATCH).astype(np.float64)
        flat = flat - flat.mean(axis=2, keepdims=True)
        flat /= np.maximum(np.linalg.norm(flat, axis=2, keepdims=True), 1e-6)
        costs[row] = [-(flat[0] @ found.T).max(axis=1).mean() for found in flat[1:]]
    yield from _by_cost("matched patches", OUTLINE, _NEARNESS, costs, right)


def _by_shape(evidence: Evidence) -> Iterator[_Guess]:
    right = evidence.right
    for title, values in evidence.cubes.items():
        whole = np.isfinite(values).all(axis=1)
        yield from _by_cost(title, WITHOUT, _SIZE, -values[whole], right[whole])
        yield from _by_company(title, _distances(values[whole]), right[whole])
    whole = np.isfinite(evidence.frames).all(axis=(1, 2))
    turns = evidence.frames[whole, :, 0]
    yield from _by_cost("stored rotation", FRAMES, _NEARNESS, turns, right[whole])


def _by_cost(
    statistic: str, sees: str, rules: tuple[str, str], costs: Array, right: Array
) -> Iterator[_Guess]:
    """Guess, by two rules, the answer of least and that of most cost; costs: (N, K)."""
    for rule, signed in zip(rules, (costs, -costs), strict=True):
        yield (statistic, rule, sees, _least(signed) == right)


def _by_company(title: str, apart: Array, right: Array) -> Iterator[_Guess]:
    """Guess by how far each answer is from the others; apart: distances, (N, K, K)."""
    if apart.shape[1] < 3:  # of two answers, none is odd
        return
    rules = ("most typical", "odd one out")
    yield from _by_cost(title, WITHOUT, rules, apart.sum(axis=2), right)


def _by_distance(title: str, sees: str, apart: Array, right: Array) -> Iterator[_Guess]:
    """Guess by the distances between the images; apart: (N, 1 + K, 1 + K)."""
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
    statistics, right = evidence.statistics, evidence.right
    alone = (len(right), evidence.answers, -1)
    outline, apart = statistics["outline"], statistics["outline_distance"]
    features = {
        "low-resolution pixels": components(statistics["thumbnails"][:, 1:]),
        "all statistics": np.concatenate(
            [statistics[name][:, 1:].reshape(alone) for name in _SUMMARY], axis=2
        ),
        "silhouettes of the options": np.concatenate(
            [outline[:, 1:], apart[:, 1:, 1:].sum(axis=2)], axis=2
        ),
    }
    for title, values in features.items():
        yield (title, "learned", WITHOUT, choose(among_others(values), right) == right)
    yield ("small patterns of pixels", "learned", WITHOUT, _by_patterns(statistics, right))
    cubes = np.stack(list(evidence.cubes.values()), axis=2)
    for title, values, sees in (
        ("cubes of the options", cubes, WITHOUT),
        ("rotations and order of cubes", evidence.frames, FRAMES),
    ):
        whole = np.isfinite(values).all(axis=(1, 2))
        if np.count_nonzero(whole) >= LEAST_QUESTIONS:
            chosen = choose(among_others(values[whole]), right[whole])
            yield (title, "learned", sees, chosen == right[whole])


def _learned_outlines(statistics: Array, right: Array) -> Iterator[_Guess]:
    columns = next_to_reference(statistics["outline"], statistics["outline_distance"][:, 0, 1:])
    yield ("silhouettes, by trees", "learned", OUTLINE, choose(columns, right) == right)


def _by_patterns(statistics: Array, right: Array) -> Array:
    """Return which questions, of at most PATTERN_QUESTIONS, small patterns answer rightly."""
    count = min(len(right), PATTERN_QUESTIONS)
    rows = np.linspace(0, len(right) - 1, count).astype(np.int64)
    pictures = statistics["thumbnails"][rows, 1:].reshape(count, -1, THUMBNAIL, THUMBNAIL)
    chosen = choose(among_others(pattern_responses(pictures)), right[rows])
    return np.asarray(chosen == right[rows])


def _by_place(places: Sequence[Array], answers: int) -> list[_Guess]:
    def hits(context: Callable[[Array], Array]) -> Array:
        right = [likely_places(table, context(table), answers) == table for table in places]
        return np.concatenate([np.zeros(0, np.bool_), *right])

    def before(table: Array) -> Array:
        return np.concatenate([[answers], table[:-1]]) if len(table) else table

    return [
        ("position", "most frequent", WITHOUT, hits(np.zeros_like)),
        ("position", "after the last", WITHOUT, hits(before)),
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
    least = np.take_along_axis(costs, order, axis=1).argmin(axis=1)
    return np.asarray(order[row, least])


def components(thumbnails: Array) -> Array:
    """Return the images' principal components, (N, K, P) to (N, K, at most COMPONENTS)."""
    flat = thumbnails.reshape(-1, thumbnails.shape[2]).astype(np.float64)
    flat = flat - flat.mean(axis=0)
    with one_thread():
        _, axes = np.linalg.eigh(flat.T @ flat)
        projected = flat @ axes[:, ::-1][:, :COMPONENTS]
    return np.asarray(projected.reshape(*thumbnails.shape[:2], -1))


def likely_places(right: Array, context: Array, answers: int) -> Array:
    """Return the most frequent right answer in the same context in other questions, (Q,).

    Args:
        right: right answers, (Q,).
        context: small whole numbers, (Q,).
        answers: how many each question has.
    """
    fold = np.arange(len(right)) % FOLDS
    counts = np.zeros((FOLDS, context.max(initial=0) + 1, answers), np.int64)
    np.add.at(counts, (fold, context, right), 1)
    learned = (counts.sum(axis=0) - counts).argmax(axis=2)
    return np.asarray(learned[fold, context])

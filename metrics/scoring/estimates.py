"""Scores of a test set from those of its items: means, intervals, skills, and groups."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from iqtt.floors import Floor, floor_of_questions
from metrics.measures.objects import size_range
from metrics.measures.skill import skill, skill_intervals
from metrics.measures.statistics import (
    bootstrap_interval,
    cluster_means,
    clustered_wilson_interval,
    linearised_means,
    pooled_means,
    wilson_interval,
)
from metrics.scoring.metric_names import OBJECT_SCORES, OTHER_SCENE, SKILLED, metric
from metrics.submissions.layout import Shown

Array = NDArray[Any]
CONFIDENCE = 0.95  # of all intervals
ACCURACY = "iqtt_accuracy"
# Of skills: what rounding of predictions to single precision makes of a method that is the floor.
ROUNDING = 1e-5


class Bootstrap(NamedTuple):
    """The seed and the number of resamples of the bootstrap."""

    seed: int
    resamples: int


@dataclass(frozen=True)
class Score:
    """A score with its interval.

    Attributes:
        value: mean over views within a scene, then over scenes; or over questions. Rows that have
            no such score, as they show no object, are left out.
        low, high: ends of the interval at `CONFIDENCE`; None where there is none.
        n: scenes, or questions, that it rests on.
        std: standard deviation over training runs (n - 1 in the denominator); None for one run.
    """

    value: float
    low: float | None
    high: float | None
    unit: str
    n: int
    std: float | None


@dataclass(frozen=True)
class Skill:
    """A score between that of a method that sees nothing, the floor, and a perfect one.

    Attributes:
        value: 1 is perfect, 0 is the floor, below 0 is worse than it; see `measures.skill`. It and
            its ends are 0 where all are that but for rounding.
        low, high: ends of the interval at `CONFIDENCE`; None where there is none. That of
            rooms is paired: it resamples the scenes of score and floor together.
        floor: the floor's score on the same items, in the unit of the score; 0 where it is less.
        floor_name: what has that score, such as "empty_room".
    """

    value: float
    low: float | None
    high: float | None
    floor: float
    floor_name: str

    @property
    def is_floor(self) -> bool:
        """Whether nothing but rounding tells the method from its floor.

        The floor of a relief is the method itself, against another scene, and so none of these.
        """
        own = self.floor_name.startswith(OTHER_SCENE)
        return not own and not any((self.value, self.low, self.high))


Scores = Mapping[str, Score]
Groups = Mapping[str, Scores]


def finite(value: float) -> float | None:
    """Return the value as Python's own float; None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def by_presence(scores: Mapping[str, Array]) -> Iterator[tuple[list[str], Array]]:
    """Yield the names of scores (..., N) that the same entries have, and which these are, (N,).

    An entry without a score is NaN, in all runs. Scores that no entry has are left out.
    """
    names_of: dict[bytes, list[str]] = {}
    for name, values in scores.items():
        there = ~np.isnan(values).reshape(-1, values.shape[-1]).any(axis=0)
        names_of.setdefault(there.tobytes(), []).append(name)
    for key, names in names_of.items():
        there = np.frombuffer(key, np.bool_)
        if there.any():
            yield names, there


def estimates(scores: Mapping[str, Array], scene: Array, bootstrap: Bootstrap) -> dict[str, Score]:
    """Return the mean of every score (R, N): runs are averaged, then views in scenes, then scenes.

    `scene` is (N,). Entries without a score are left out; a score that none has is not returned.
    `std` is over the R runs.
    """
    means_of: dict[str, Score] = {}
    for names, there in by_presence(scores):
        runs = np.stack([scores[name][:, there] for name in names], axis=-1)  # (R, M, K)
        means = cluster_means(runs.mean(axis=0), scene[there])
        value = means.mean(axis=0)
        low, high = bootstrap_interval(means, *bootstrap)
        for k, name in enumerate(names):
            low[k], high[k] = with_width(means[:, k], low[k], high[k], metric(name).unit)
        each = np.stack([cluster_means(run, scene[there]).mean(axis=0) for run in runs])
        for k, name in enumerate(names):
            means_of[name] = Score(
                float(value[k]),
                finite(low[k]),
                finite(high[k]),
                metric(name).unit,
                len(means),
                float(each[:, k].std(ddof=1)) if len(each) > 1 else None,
            )
    return {name: means_of[name] for name in scores if name in means_of}


def pooled_means_of(name: str, values: Array, clusters: Array, weights: Array) -> Array:
    """Return `pooled_means` of a score (N,): over pixels, a root is one of all of them."""
    over_pixels = bool((weights != 1.0).any())
    return pooled_means(values, clusters, weights, over_pixels and metric(name).is_root)


def pooled_estimates(
    scores: Mapping[str, Array], clusters: Array, weights: Array, bootstrap: Bootstrap
) -> dict[str, Score]:
    """Return the weighted mean of every score (R, N); intervals resample clusters (N,).

    Entries without a score are left out; a score that none has is not returned.
    """
    found: dict[str, Score] = {}
    for names, there in by_presence(scores):
        cluster, weight = clusters[there], weights[there]
        for name in names:
            runs = scores[name][:, there]
            each = np.array([pooled_means_of(name, run, cluster, weight) for run in runs])
            means, unit = each.mean(axis=0), metric(name).unit
            (low,), (high,) = bootstrap_interval(means[:, None], *bootstrap)
            low, high = with_width(means, low, high, unit)
            std = float(each.mean(axis=1).std(ddof=1)) if len(each) > 1 else None
            count = len(means)
            found[name] = Score(float(means.mean()), finite(low), finite(high), unit, count, std)
    return {name: found[name] for name in scores if name in found}


def with_width(means: Array, low: float, high: float, unit: str) -> tuple[float, float]:
    """Return an interval of fractions, means (S,) of scenes; Wilson's where all are 0, or all 1.

    No resample differs from the others then, but S scenes do not show that the next is the same.
    """
    same = unit == "fraction" and len(means) > 1 and means[0] in (0.0, 1.0)
    if not same or (means != means[0]).any():
        return low, high
    return wilson_interval(float(means.sum()), len(means), CONFIDENCE)


def grouped_estimates(
    scores: Mapping[str, Array], labels: Array, scene: Array, bootstrap: Bootstrap
) -> dict[str, Scores]:
    """Return `estimates` of the scores (R, N) of each group, by its label (N,) as a text."""
    groups: dict[str, Scores] = {}
    for label in sorted(set(labels.tolist())):
        here = labels == label
        chosen = {name: values[:, here] for name, values in scores.items()}
        groups[str(label)] = estimates(chosen, scene[here], bootstrap)
    return groups


def object_sizes(pixels: Array, image_pixels: int) -> Array:
    """Return the range of the share of the picture that each object takes, (M,) texts."""
    return np.array([size_range(share) for share in (pixels / image_pixels).tolist()], object)


def floor_column(
    items: Mapping[str, Array], scene: Array, name: str, shown: Shown = "scored_view"
) -> str | None:
    """Return which column of items is the floor of a score's skill; None where there is none.

    Of several that were shown as much as the method, it is that of the best mean over scenes,
    (N,).
    """
    columns = [begins + name for begins in metric(name).baselines_shown(shown)]
    columns = [c for c in columns if c in items and np.isfinite(items[c]).any()]

    def mean(column: str) -> float:
        there = np.isfinite(items[column])
        return float(cluster_means(items[column][there], scene[there]).mean())

    if len(columns) < 2:
        return columns[0] if columns else None
    return (max if metric(name).higher_is_better else min)(columns, key=mean)


def skills(
    items: Mapping[str, Array],
    scene: Array,
    bootstrap: Bootstrap,
    shown: Shown = "scored_view",
    weights: Array | None = None,
) -> dict[str, Skill]:
    """Return the skills of pictures from columns of items, (N,) each, those of floors among them.

    There is none where no image shows an object that counts: the empty room is then the truth. A
    floor below 0, that of relief which goes against other scenes, counts as 0, the score of the
    empty room: so a bad floor wins nothing, and the skill of a relief never exceeds its score.

    Args:
        weights: of the items in a mean over all, (N,); by default each scene weighs the same.
    """
    column_of = {name: floor_column(items, scene, name, shown) for name in SKILLED if name in items}
    names = [name for name, column in column_of.items() if column is not None]
    of_objects = [name for name in OBJECT_SCORES if name in items]
    seen = any(np.isfinite(items[name]).any() for name in of_objects)
    if weights is None and of_objects and not seen:
        return {}
    skill_of: dict[str, Skill] = {}
    pairs = {name: np.stack([items[name], items[str(column_of[name])]]) for name in names}
    for group, there in by_presence(pairs):
        each = [np.stack([pairs[name][i, there] for name in group], -1) for i in (0, 1)]
        perfect: Any = 1.0
        if weights is None:
            errors, floors = (cluster_means(values, scene[there]) for values in each)
        else:  # their means over clusters are those over all
            at = scene[there], weights[there]
            errors, floors = (
                np.stack(
                    [pooled_means_of(name, x, *at) for name, x in zip(group, v.T, strict=True)], -1
                )
                for v in each
            )
            perfect = pooled_means(np.ones(len(at[0])), *at, False)[:, None]
        floors[:, floors.mean(axis=0) < 0.0] = 0.0
        score, floor = errors.mean(axis=0), floors.mean(axis=0)
        higher = np.array([metric(name).higher_is_better for name in group])
        for table in (errors, floors):
            table[:, higher] = perfect - table[:, higher]
        values = [skill(*row) for row in zip(score.tolist(), floor.tolist(), higher, strict=True)]
        kept = [k for k, value in enumerate(values) if value is not None]
        if not kept:
            continue
        ends = skill_intervals(errors[:, kept], floors[:, kept], *bootstrap)
        for k, *interval in zip(kept, *ends, strict=True):
            (low, high), name, value = interval, group[k], values[k]
            assert value is not None
            # The ends belong to the value but for rounding; min and max keep what is not a number.
            if value == 1.0 and higher[k]:
                low, high = with_width(
                    (perfect - errors[:, [k]])[:, 0], low, high, metric(name).unit
                )
                low = (low - float(floor[k])) / (1.0 - float(floor[k]))
            span = finite(min(low, value)), finite(min(max(high, value), 1.0))  # none is above 1
            if all(abs(end) <= ROUNDING for end in (value, *span) if end is not None):
                value = 0.0
                span = None if span[0] is None else 0.0, None if span[1] is None else 0.0
            skill_of[name] = Skill(value, *span, float(floor[k]), str(column_of[name]))
    return {name: skill_of[name] for name in names if name in skill_of}


def accuracy(right: Array, shapes: Array, bootstrap: Bootstrap) -> Score:
    """Return the accuracy of R runs on Q questions, from (R, Q) of 0 or 1 and their shapes (Q,).

    Questions about one shape are alike, so intervals take the shapes as independent. Source:
    Pix2Shape, section "3D-IQTT" and Table 3: the percentage of questions answered correctly, here
    as a fraction.
    """
    runs, questions = right.shape
    unit = metric(ACCURACY).unit
    if runs == 1:
        count = int(np.count_nonzero(right))
        ends = clustered_wilson_interval(right[0], shapes)
        return Score(count / questions, *ends, unit, questions, None)
    each = right.mean(axis=0)
    low, high = bootstrap_interval(linearised_means(each, shapes), *bootstrap)
    if each.min() == each.max() and each[0] in (0.0, 1.0):
        low, high = np.array([clustered_wilson_interval(each, shapes)]).T
    std = float(right.mean(axis=1).std(ddof=1))
    return Score(float(each.mean()), finite(low[0]), finite(high[0]), unit, questions, std)


def question_skill(
    score: Score, counts: Mapping[str, int], floors: Mapping[str, Floor]
) -> Skill | None:
    """Return (accuracy - floor) / (1 - floor), and its interval by the same line.

    The arguments `counts` and `floors` are those of `floors.floor_of_questions`; None where it
    knows no floor.
    """
    found = floor_of_questions(counts, floors)
    if found is None:
        return None
    floor, name = found
    value = skill(score.value, floor, higher_is_better=True)
    assert value is not None, "no baseline is perfect"
    low, high = (
        None if end is None else skill(end, floor, higher_is_better=True)
        for end in (score.low, score.high)
    )
    return Skill(value, low, high, floor, name)

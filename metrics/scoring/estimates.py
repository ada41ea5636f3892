"""Scores of a test set from those of its images: means over views, then scenes, and skills."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.objects import size_range
from metrics.measures.skill import skill, skill_intervals
from metrics.measures.statistics import bootstrap_interval, cluster_means
from metrics.scoring.metric_names import OBJECT_SCORES, SKILLED, metric
from metrics.scoring.records import SHAPE_COLUMN, Groups, Score, Skill
from metrics.scoring.runs import known

Array = NDArray[Any]


def by_presence(scores: Mapping[str, Array]) -> Iterator[tuple[list[str], Array]]:
    """Yield the names of scores (..., N) that the same entries have, and which these are, (N,).

    An entry without a score is NaN, in all runs. Scores that no entry has are left out.
    """
    groups: dict[bytes, list[str]] = {}
    for name, values in scores.items():
        there = ~np.isnan(values).reshape(-1, values.shape[-1]).any(axis=0)
        groups.setdefault(there.tobytes(), []).append(name)
    for key, names in groups.items():
        there = np.frombuffer(key, np.bool_)
        if there.any():
            yield names, there


def estimates(
    scores: Mapping[str, Array], scene: Array, seed: int, resamples: int, confidence: float
) -> dict[str, Score]:
    """Return the mean of every score (R, N): runs are averaged, then views in scenes, then scenes.

    `scene` is (N,). Entries without a score are left out; a score that none has is not returned.
    `std` is over the R runs. The other arguments are those of `statistics.bootstrap_interval`.
    """
    found: dict[str, Score] = {}
    for names, there in by_presence(scores):
        runs = np.stack([scores[name][:, there] for name in names], axis=-1)  # (R, M, K)
        means = cluster_means(runs.mean(axis=0), scene[there])
        low, high = bootstrap_interval(means, seed, resamples, confidence)
        value = means.mean(axis=0)
        each = np.stack([cluster_means(run, scene[there]).mean(axis=0) for run in runs])
        for k, name in enumerate(names):
            found[name] = Score(
                float(value[k]),
                known(low[k]),
                known(high[k]),
                metric(name).unit,
                len(means),
                float(each[:, k].std(ddof=1)) if len(each) > 1 else None,
            )
    return {name: found[name] for name in scores if name in found}


def skills(
    items: Mapping[str, Array], scene: Array, seed: int, resamples: int, confidence: float
) -> dict[str, Skill]:
    """Return the skills of rooms from columns of items, (N,) each, those of floors among them.

    There is none where no image shows an object that counts: the empty room is then the truth. A
    floor below 0, that of relief which goes against other scenes, counts as 0, the score of the
    empty room: so a bad floor wins nothing, and the skill of a relief never exceeds its score.
    """
    names = [name for name in SKILLED if {name, SKILLED[name] + name} <= items.keys()]
    of_objects = [name for name in names if name in OBJECT_SCORES]
    if not any(np.isfinite(items[name]).any() for name in of_objects):
        return {}
    found: dict[str, Skill] = {}
    pairs = {name: np.stack([items[name], items[SKILLED[name] + name]]) for name in names}
    for group, there in by_presence(pairs):
        errors, floors = (
            cluster_means(np.stack([pairs[name][i, there] for name in group], -1), scene[there])
            for i in (0, 1)
        )
        floors[:, floors.mean(axis=0) < 0.0] = 0.0
        score, floor = errors.mean(axis=0), floors.mean(axis=0)
        higher = np.array([metric(name).higher_is_better for name in group])
        errors[:, higher], floors[:, higher] = 1.0 - errors[:, higher], 1.0 - floors[:, higher]
        values = [skill(*one) for one in zip(score.tolist(), floor.tolist(), higher, strict=True)]
        kept = [k for k, value in enumerate(values) if value is not None]
        if not kept:
            continue
        ends = skill_intervals(errors[:, kept], floors[:, kept], seed, resamples, confidence)
        for k, low, high in zip(kept, *ends, strict=True):
            name, value = group[k], values[k]
            assert value is not None
            column = SKILLED[name] + name
            # The ends belong to the value but for rounding; min and max keep what is not a number.
            span = known(min(low, value)), known(max(high, value))
            found[name] = Skill(value, *span, float(floor[k]), column)
    return {name: found[name] for name in names if name in found}


def object_labels(objects: Mapping[str, Array], pixels: int) -> dict[str, Array]:
    """Return the labels of single objects, (M,), by the grouping of score files.

    Args:
        objects: columns of `ScoreFile.objects`.
        pixels: of an image.
    """
    sizes = [size_range(share) for share in (objects["pixels"] / pixels).tolist()]
    return {"by_object_shape": objects[SHAPE_COLUMN], "by_object_size": np.array(sizes, object)}


def object_groups(
    scores: Mapping[str, Array],
    labels: Array,
    scene: Array,
    bootstrap: Sequence[Any],
) -> Groups:
    """Return the means of the scores (R, M) of single objects, by their labels (M,).

    Objects are averaged within scenes, then scenes. `scene` is (M,); `bootstrap` holds the last
    arguments of `estimates`.
    """
    found = {}
    for label in sorted(set(labels.tolist())):
        chosen = labels == label
        some = {name: values[:, chosen] for name, values in scores.items()}
        found[label] = estimates(some, scene[chosen], *bootstrap)
    return found

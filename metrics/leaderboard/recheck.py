"""Score files recomputed from their items: every number that follows from others is compared.

What a score file lacks cannot be recomputed: each training run by itself, on which `std` rests, the
noise floor, and which question is of which group. Groups of questions are held against each other.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.statistics import bootstrap_interval, cluster_means, wilson_interval
from metrics.scoring.records import GROUPINGS, Score, ScoreFile
from metrics.scoring.schema import AGREEMENT, SCORE_AGAIN, agree
from scenegen.common.errors import SceneGenError

Found = tuple[str, float | None, float | None]
ACCURACY = "iqtt_accuracy"


class RecheckError(SceneGenError):
    """A number of a score file that does not follow from its items."""


def recheck(file: ScoreFile, progress: Callable[[int], Any] = lambda done: None) -> None:
    """Recompute a score file, as `read_scores` returns it, from its items.

    All scores over images or questions and those by view angle are recomputed with their intervals.
    Of questions by group, whole numbers of right answers have to add up, and the intervals of one
    run have to be Wilson's. Numbers agree within `schema.AGREEMENT`.

    Args:
        file: what to recompute.
        progress: called with 1 for each group of scores, `steps` in all.

    Raises RecheckError at the first number that differs.
    """
    everything = np.ones(len(file.ids), bool)
    with np.errstate(all="ignore"):
        _compare(file, "metrics", file.metrics, everything)
        _compare_columns(file)
        progress(1)
        for degrees, scores in file.by_view_angle.items():
            place = f"by_view_angle.{degrees}"
            angles = file.items.get("view_angle_degrees")
            chosen = ~everything if angles is None else angles == int(degrees)
            if not chosen.any():
                found, expected = "scores", f"an image whose view angle is {int(degrees)} degrees"
                raise RecheckError(f"{file.place}: {place}", found, expected, SCORE_AGAIN)
            _compare(file, place, scores, chosen)
            progress(1)
    for grouping in GROUPINGS["iqtt"]:
        if getattr(file, grouping):
            _compare_questions(file, grouping, getattr(file, grouping))


def steps(file: ScoreFile) -> int:
    """Return how often `recheck` reports progress."""
    return 1 + len(file.by_view_angle)


def _compare(
    file: ScoreFile, place: str, scores: Mapping[str, Score], chosen: NDArray[np.bool_]
) -> None:
    """Recompute scores from these items."""
    names = list(scores)
    for name in names:
        if name not in file.items or np.isnan(file.items[name][chosen]).any():
            where = f"{file.place}: {place}.{name}"
            raise RecheckError(where, "a score", f"numbers in items.{name}", SCORE_AGAIN)
    if not names:
        return
    columns = np.stack([file.items[name][chosen] for name in names], axis=-1)
    try:
        means = cluster_means(columns, file.clusters[chosen])
        low, high = _intervals(file, means)
    except SceneGenError as error:
        raise RecheckError(f"{file.place}: {place}", error, "scores of finite items") from error
    for k, name in enumerate(names):
        mean = float(means[:, k].mean())
        _require(file, f"{place}.{name}", scores[name], mean, low[k], high[k], len(means))


def _intervals(
    file: ScoreFile, means: NDArray[np.float64]
) -> tuple[Sequence[float], Sequence[float]]:
    """Return the ends of the intervals of these means of clusters (S, K), (K,) each."""
    if file.task == "iqtt" and file.runs == 1:
        right = int(np.count_nonzero(means == 1.0))
        low, high = wilson_interval(right, len(means), file.meta.confidence)
        return [low], [high]
    lows, highs = bootstrap_interval(
        means, file.meta.seed, file.meta.resamples, file.meta.confidence
    )
    return lows.tolist(), highs.tolist()


def _compare_columns(file: ScoreFile) -> None:
    """Require what holds between the scores of each image; means over runs keep sums alone."""
    columns = file.items
    derived: dict[str, tuple[tuple[str, ...], Callable[..., NDArray[np.float64]]]] = {
        "chamfer": (("accuracy_distance", "completeness_distance"), np.add),
    }
    if file.runs == 1:
        derived |= {
            "hausdorff": (("hausdorff_forward", "hausdorff_reverse"), np.maximum),
            "rmse": (("mse_depth",), np.sqrt),
        }
    for name, (parts, function) in derived.items():
        if not {name, *parts} <= set(columns):
            continue
        expected = function(*(columns[part] for part in parts))
        scale = np.maximum(np.abs(expected), np.abs(columns[name]))
        wrong = ~(np.abs(columns[name] - expected) <= AGREEMENT * scale + AGREEMENT**2)
        if wrong.any():
            i = int(np.argmax(wrong))
            where = f"{file.place}: items.{name}[{i}]"
            told = f"{float(expected[i])!r}, as {' and '.join(parts)} say"
            raise RecheckError(where, repr(float(columns[name][i])), told, SCORE_AGAIN)


def _compare_questions(
    file: ScoreFile, grouping: str, groups: Mapping[str, Mapping[str, Score]]
) -> None:
    """Require that groups of questions add up to all of them."""
    asked = right = 0
    for key, scores in groups.items():
        place = f"{grouping}.{key}.{ACCURACY}"
        if ACCURACY not in scores:
            raise RecheckError(f"{file.place}: {place}", "no such key", "a score", SCORE_AGAIN)
        score = scores[ACCURACY]
        answers = score.n * file.runs
        whole = round(score.value * answers)
        low, high = score.low, score.high
        if file.runs == 1:
            low, high = wilson_interval(whole, score.n, file.meta.confidence)
        _require(file, place, score, whole / answers, low, high, score.n)
        asked, right = asked + score.n, right + whole
    total = round(float(file.items[ACCURACY].sum()) * file.runs)
    for what, found, expected in (
        ("questions", asked, len(file.ids)),
        ("right answers", right, total),
    ):
        if found != expected:
            told = f"{expected} {what}, as in items"
            raise RecheckError(f"{file.place}: {grouping}", f"{found} {what}", told, SCORE_AGAIN)


def _require(
    file: ScoreFile,
    place: str,
    score: Score,
    value: float,
    low: float | None,
    high: float | None,
    n: int,
) -> None:
    """Raise RecheckError unless a score is this one."""
    for part, found, expected in _parts(score, value, low, high, n):
        if not agree(found, expected, value):
            where = f"{file.place}: {place}.{part}"
            told = "null" if found is None else repr(found)
            recomputed = "null" if expected is None else repr(expected)
            raise RecheckError(where, told, f"{recomputed}, computed from items", SCORE_AGAIN)


def _parts(
    score: Score, value: float, low: float | None, high: float | None, n: int
) -> Iterator[Found]:
    ends = (None if end is None or np.isnan(end) else float(end) for end in (low, high))
    yield from zip(
        ("value", "low", "high", "n"),
        (score.value, score.low, score.high, score.n),
        (value, *ends, n),
        strict=True,
    )

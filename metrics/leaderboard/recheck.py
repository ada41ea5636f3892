"""Score files recomputed from their items: every number that follows from others is compared.

What a score file lacks cannot be recomputed: each training run by itself, on which `std` rests, the
noise floor, and which question is of which group. Groups of questions are held against each other.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import CANDIDATES
from metrics.measures.statistics import (
    bootstrap_interval,
    cluster_means,
    clustered_wilson_interval,
    linearised_means,
    wilson_interval,
)
from metrics.scoring.estimates import by_presence, object_labels, skills
from metrics.scoring.metric_names import OBJECT_SCORES, metric
from metrics.scoring.questions import question_skill
from metrics.scoring.records import GROUPINGS, Score, ScoreFile, Skill
from metrics.scoring.schema import AGREEMENT, SCORE_AGAIN, agree
from scenegen.common.errors import SceneGenError

Column = NDArray[Any]
Found = tuple[str, float | None, float | None]
ACCURACY = "iqtt_accuracy"


class RecheckError(SceneGenError):
    """A number of a score file that does not follow from its items."""


def recheck(file: ScoreFile, progress: Callable[[int], Any] = lambda done: None) -> None:
    """Recompute a score file, as `read_scores` returns it, from its items.

    All scores over images or questions, those by view angle and those of single objects by shape
    and size are recomputed with their intervals, and so are skills.
    Of questions by group, whole numbers of right answers have to add up, and the intervals of one
    run have to be Wilson's, or wider where items tell the shapes. Numbers agree within
    `schema.AGREEMENT`.

    Args:
        file: what to recompute.
        progress: called with 1 for each group of scores, `steps` in all.

    Raises RecheckError at the first number that differs.
    """
    everything = np.ones(len(file.ids), bool)
    with np.errstate(all="ignore"):
        _compare(file, "metrics", file.metrics, file.items, file.clusters)
        _compare_columns(file)
        _compare_skills(file)
        progress(1)
        for degrees, scores in file.by_view_angle.items():
            place = f"by_view_angle.{degrees}"
            angles = file.items.get("view_angle_degrees")
            chosen = ~everything if angles is None else angles == int(degrees)
            if not chosen.any():
                found, expected = "scores", f"an image whose view angle is {int(degrees)} degrees"
                raise RecheckError(f"{file.place}: {place}", found, expected, SCORE_AGAIN)
            some = {name: column[chosen] for name, column in file.items.items()}
            _compare(file, place, scores, some, file.clusters[chosen])
            progress(1)
        if file.objects:
            _compare_objects(file)
    for grouping in GROUPINGS["iqtt"]:
        if getattr(file, grouping):
            _compare_questions(file, grouping, getattr(file, grouping))


def steps(file: ScoreFile) -> int:
    """Return how often `recheck` reports progress."""
    return 1 + len(file.by_view_angle)


def _compare(
    file: ScoreFile,
    place: str,
    scores: Mapping[str, Score],
    columns: Mapping[str, Column],
    clusters: Column,
) -> None:
    """Recompute scores from columns (N,) of items or of single objects, and their scenes (N,)."""
    for name in scores:
        there = ~np.isnan(columns.get(name, np.array([np.nan])))
        if not (there.any() if metric(name).lacking else there.all()):
            where = f"{file.place}: {place}.{name}"
            raise RecheckError(where, "a score", f"numbers in items.{name}", SCORE_AGAIN)
    for names, there in by_presence({name: columns[name] for name in scores}):
        table = np.stack([columns[name][there] for name in names], axis=-1)
        try:
            means = cluster_means(table, clusters[there])
            low, high = _intervals(file, means)
        except SceneGenError as error:
            raise RecheckError(f"{file.place}: {place}", error, "scores of finite items") from error
        for k, name in enumerate(names):
            mean = float(means[:, k].mean())
            _require(file, f"{place}.{name}", scores[name], mean, low[k], high[k], len(means))


def _compare_skills(file: ScoreFile) -> None:
    """Recompute the skills, with their intervals, which are paired for rooms."""
    meta = file.meta
    if file.task == "rooms":
        expected = skills(file.items, file.clusters, meta.seed, meta.resamples, meta.confidence)
    else:
        expected = _question_skills(file) if file.skills else {}
    for name in expected:
        if name not in file.skills:
            told = "a skill, as items hold the floor"
            raise RecheckError(f"{file.place}: skills.{name}", "no such key", told, SCORE_AGAIN)
    for name, skill in file.skills.items():
        place = f"skills.{name}"
        if name not in expected:
            told = "none, as items hold no object"
            raise RecheckError(f"{file.place}: {place}", "a skill", told, SCORE_AGAIN)
        other = expected[name]
        for part in ("value", "low", "high", "floor"):
            ours, theirs, scale = getattr(skill, part), getattr(other, part), abs(other.value)
            _require_part(file, f"{place}.{part}", ours, theirs, max(1.0, scale))
        if skill.floor_name != other.floor_name:
            where = f"{file.place}: {place}.floor_name"
            raise RecheckError(where, repr(skill.floor_name), repr(other.floor_name), SCORE_AGAIN)


def _question_skills(file: ScoreFile) -> dict[str, Skill]:
    """Return the skill of the accuracy over the floors that this release knows."""
    answers = file.meta.counts.get("answers", 0)
    if answers not in CANDIDATES:
        where = f"{file.place}: meta.counts.answers"
        raise RecheckError(where, str(answers), " or ".join(map(str, CANDIDATES)), SCORE_AGAIN)
    asked = {kind: s[ACCURACY].n for kind, s in file.by_distractor.items() if ACCURACY in s}
    return {ACCURACY: question_skill(file.metrics[ACCURACY], asked, answers)}


def _compare_objects(file: ScoreFile) -> None:
    """Recompute the groups of single objects, and the scores of images that follow from them."""
    objects = file.objects
    order = np.argsort(file.ids)
    entry = order[np.searchsorted(file.ids, objects["row"], sorter=order)]
    counts = np.bincount(entry, minlength=len(file.ids))
    for name in OBJECT_SCORES if len(entry) else ():
        weights = np.ones(len(entry)) if "recall" in name else objects["pixels"].astype(np.float64)
        sums = np.bincount(entry, weights * objects[name], len(file.ids))
        expected = sums / np.bincount(entry, weights, len(file.ids))
        if name in file.items:
            _require_column(file, name, expected, counts > 0, "objects say")
    for grouping, labels in object_labels(objects, file.meta.counts.get("pixels", 1)).items():
        for key, scores in getattr(file, grouping).items():
            chosen = labels == key
            place = f"{grouping}.{key}"
            if not chosen.any():
                found, told = "scores", "objects of this group"
                raise RecheckError(f"{file.place}: {place}", found, told, SCORE_AGAIN)
            some = {name: objects[name][chosen] for name in OBJECT_SCORES}
            _compare(file, place, scores, some, file.clusters[entry[chosen]])


def _intervals(
    file: ScoreFile, means: NDArray[np.float64]
) -> tuple[Sequence[float], Sequence[float]]:
    """Return the ends of the intervals of these means of clusters (S, K), (K,) each."""
    if file.task == "iqtt":
        shapes = file.items.get("shape", file.ids)[np.argsort(file.ids)]
        if file.runs == 1:
            low, high = clustered_wilson_interval(means[:, 0], shapes, file.meta.confidence)
            return [low], [high]
        means = linearised_means(means[:, 0], shapes)
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
        everywhere = np.ones(len(expected), bool)
        _require_column(file, name, expected, everywhere, f"{' and '.join(parts)} say")


def _require_column(
    file: ScoreFile, name: str, expected: Column, there: NDArray[np.bool_], why: str
) -> None:
    """Raise RecheckError unless a column of items is this one, where it is there."""
    found = file.items[name]
    scale = np.maximum(np.abs(expected), np.abs(found))
    wrong = there & ~(np.abs(found - expected) <= AGREEMENT * scale + AGREEMENT**2)
    if wrong.any():
        i = int(np.argmax(wrong))
        where = f"{file.place}: items.{name}[{i}]"
        told = f"{float(expected[i])!r}, as {why}"
        raise RecheckError(where, repr(float(found[i])), told, SCORE_AGAIN)


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
            low, high = _possible_ends(file, score, whole)
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


def _possible_ends(file: ScoreFile, score: Score, right: int) -> tuple[float, float]:
    """Return the ends that the interval of a group may have, those of the score where it may.

    The questions of the group are between one and all of them independent ones: its shapes are not
    known, so that neither is the design effect. Where questions have no shapes, all are.
    """
    narrow = wilson_interval(right, score.n, file.meta.confidence)
    if "shape" not in file.items or score.low is None or score.high is None:
        return narrow
    wide = wilson_interval(right / score.n, 1.0, file.meta.confidence)
    low, high = min(max(score.low, wide[0]), narrow[0]), max(min(score.high, wide[1]), narrow[1])
    return low, high


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
        _require_part(file, f"{place}.{part}", found, expected, value)


def _require_part(
    file: ScoreFile, place: str, found: float | None, expected: float | None, scale: float
) -> None:
    """Raise RecheckError unless two numbers agree, rounding of sums of this scale left aside."""
    if not agree(found, expected, scale):
        told = "null" if found is None else repr(found)
        recomputed = "null" if expected is None else repr(expected)
        told_instead = f"{recomputed}, computed from items"
        raise RecheckError(f"{file.place}: {place}", told, told_instead, SCORE_AGAIN)


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

"""Submissions -> scores with intervals: the whole of `bench score` but for its printing."""

import hashlib
import itertools
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from metrics.answers import ABSTAINED, iqtt_accuracy
from metrics.item_scores import NonFinite
from metrics.matching import match_problems, size_problems
from metrics.metric_names import metric
from metrics.prediction_file import (
    QuestionPredictions,
    RoomPredictions,
    find_truth,
    open_predictions,
)
from metrics.problems import Problem
from metrics.room_scores import RoomScores, ScoringError, score_rows
from metrics.score_records import Groups, Meta, Score, ScoreFile, Submission
from metrics.statistics import RESAMPLES, bootstrap_interval, cluster_means
from scenegen.row_file import and_more, writer_name
from scenegen.scene_file import RoomsFile

Array = NDArray[Any]
Progress = Callable[[int], Any]
Kind = TypeVar("Kind", RoomPredictions, QuestionPredictions)
CONFIDENCE = 0.95
ANGLE_BINS = (0, 30, 60, 90, 120, 150, 180)  # degrees, of IQTT's rotations


@dataclass(frozen=True)
class Settings:
    """How to score.

    Attributes:
        seed, resamples: of the bootstrap.
        allow_partial: score the rows that are there; the result is not comparable.
        non_finite: "error", or "penalise" (see `item_scores.score_view`); if that was needed, the
            result is not comparable.
        processes: for rooms; None for as many as there are cores. Changes no number.
    """

    seed: int = 0
    resamples: int = RESAMPLES
    allow_partial: bool = False
    non_finite: NonFinite = "error"
    processes: int | None = None


def score(
    paths: Sequence[str | Path],
    truth: str | Path | None = None,
    settings: Settings | None = None,
    progress: Progress = lambda done: None,
) -> ScoreFile:
    """Score one submission, or several runs of one method, against the truth.

    Views are averaged within a scene, then scenes; several runs are averaged within each item, and
    `std` is the standard deviation over runs (with n - 1). Intervals resample whole scenes; those
    of IQTT accuracy are Wilson's for a single run, and resample questions for several.

    Args:
        paths: submissions of one method, task and alignment.
        truth: where the truth lies, unless the submissions say so.
        settings: None for the defaults.
        progress: is told how many more rows were scored.

    Raises:
        OSError: a file that is not there.
        FileFormatError: a file that is none of ours, or broken.
        ScoringError: the wrong truth, rows that are missing or unknown, values that are not finite.
    """
    settings = settings or Settings()
    with ExitStack() as stack:
        files = []
        for path in paths:
            files.append(open_predictions(path))
            stack.callback(files[-1].close)
        _check_alike(files)
        truth_path = find_truth(files[0], truth)
        rooms = [file for file in files if isinstance(file, RoomPredictions)]
        if rooms:
            return _score_rooms(rooms, truth_path, settings, progress)
        answers = [file for file in files if isinstance(file, QuestionPredictions)]
        return _score_questions(answers, truth_path, settings, progress)


def count_rows(path: str | Path) -> int:
    """Return how many rows a submission answers. Raises as `open_predictions`."""
    with open_predictions(path) as predictions:
        return len(predictions)


def _check_alike(files: Sequence[RoomPredictions | QuestionPredictions]) -> None:
    """Raise ScoringError unless the files are runs of one method on one task."""
    first = files[0]
    seen: dict[str, Path] = {}
    for file in files:
        for name in ("task", "method", "alignment"):
            ours, theirs = (getattr(one, name, None) for one in (first, file))
            if ours != theirs:
                raise ScoringError(
                    f"{file.path}: {name} {theirs!r}, but {first.path} has {ours!r}: only runs of"
                    f" one method are averaged; score others by themselves, then `bench compare`"
                )
        if file.sha256 in seen:
            raise ScoringError(f"{file.path}: the same bytes as {seen[file.sha256]}")
        seen[file.sha256] = file.path


def _matched_rows(
    files: Sequence[Kind], truth_path: Path, fingerprint: str | None, count: int, partial: bool
) -> tuple[Array, bool]:
    """Return the rows of the truth that all files answer, and whether those are all rows.

    Raises ScoringError for another truth, unknown rows, and missing ones unless `partial`.
    """
    rows = np.arange(count)
    for file in files:
        problems = match_problems(file, truth_path, fingerprint, count)
        advice = ""
        if partial:
            problems = [problem for problem in problems if problem.rule != "complete"]
        elif any(problem.rule == "complete" for problem in problems):
            advice = "; to score the rest, not comparably, say --allow-partial"
        _refuse(file.path, problems, advice)
        rows = np.intersect1d(rows, file.rows)
    if not rows.size:
        raise ScoringError(f"{files[0].path}: answers no row of {truth_path}")
    return rows, len(rows) == count


def _refuse(path: Path, problems: Sequence[Problem], advice: str = "") -> None:
    if problems:
        raise ScoringError(f"{path}: {and_more([str(one) for one in problems])}{advice}")


def _score_rooms(
    files: Sequence[RoomPredictions], truth_path: Path, settings: Settings, progress: Progress
) -> ScoreFile:
    with RoomsFile(truth_path) as truth:
        count, fingerprint = len(truth), truth.fingerprint
        for file in files:
            _refuse(file.path, size_problems(file, truth))
    rows, whole = _matched_rows(files, truth_path, fingerprint, count, settings.allow_partial)
    for file in files:
        if file.has_normals != files[0].has_normals:
            raise ScoringError(f"{file.path}: normal: some runs have normals, others have none")
    scored = score_rows(
        [file.path for file in files],
        truth_path,
        rows,
        files[0].alignment,
        non_finite=settings.non_finite,
        processes=settings.processes,
        progress=progress,
    )
    metrics = _estimates(scored, np.ones(len(rows), bool), settings)
    angles = np.unique(scored.view_angle_degrees).tolist()
    by_angle = {}
    if len(np.unique(scored.view_index)) > 1:
        for angle in [angle for angle in angles if angle >= 0]:
            some = scored.view_angle_degrees == angle
            by_angle[str(angle)] = _estimates(scored, some, settings)
    warnings = _warnings(whole, len(rows), count, scored.penalised)
    items = {"row": rows, "scene_index": scored.scene_index, "view_index": scored.view_index}
    items["view_angle_degrees"] = scored.view_angle_degrees
    items |= {name: runs.mean(axis=0) for name, runs in scored.scores.items()}
    counts = {
        "rows": len(rows),
        "rows_in_truth": count,
        "scenes": len(np.unique(scored.scene_index)),
        "runs": len(files),
        "rows_penalised": len(scored.penalised),
    }
    floor = scored.floor if np.isfinite(scored.floor) else None
    return ScoreFile(
        task="rooms",
        method=files[0].method,
        comparable=not warnings,
        alignment=files[0].alignment,
        metrics=metrics,
        by_view_angle=by_angle,
        items=items,
        meta=_meta(files, truth_path, fingerprint, settings, counts, warnings, floor),
    )


def _estimates(scored: RoomScores, some: Array, settings: Settings) -> dict[str, Score]:
    """Return every score of some items: views averaged within scenes, then scenes."""
    scene = scored.scene_index[some]
    names = list(scored.scores)
    runs = np.stack([scored.scores[name][:, some] for name in names], axis=-1)  # (R, M, K)
    means = cluster_means(runs.mean(axis=0), scene)
    low, high = bootstrap_interval(means, settings.seed, settings.resamples, CONFIDENCE)
    value = means.mean(axis=0)
    each = np.stack([cluster_means(run, scene).mean(axis=0) for run in runs])
    return {
        name: Score(
            float(value[k]),
            _known(low[k]),
            _known(high[k]),
            metric(name).unit,
            len(means),
            float(each[:, k].std(ddof=1)) if len(each) > 1 else None,
        )
        for k, name in enumerate(names)
    }


def _score_questions(
    files: Sequence[QuestionPredictions], truth_path: Path, settings: Settings, progress: Progress
) -> ScoreFile:
    from iqtt.question_file import open_answers

    with open_answers(truth_path) as truth:
        true = np.asarray(truth.read("answers", slice(None))).astype(np.int64)
        fingerprint = truth.fingerprint
        kinds, names, angles = None, truth.kind_names, None
        if truth.has_truth:
            kinds = truth.read("distractor_kind", slice(None))
            angles = truth.read("angle_degrees", slice(None))
    rows, whole = _matched_rows(files, truth_path, fingerprint, len(true), settings.allow_partial)
    answers = np.full((len(files), len(true)), ABSTAINED)
    for given, file in zip(answers, files, strict=True):
        given[file.rows] = file.answers
    right = (answers == true)[:, rows]
    progress(len(rows))

    def grouped(labels: Array) -> Groups:
        found = {}
        for label in np.unique(labels).tolist():
            found[str(label)] = {"iqtt_accuracy": _accuracy(right[:, labels == label], settings)}
        return found

    by_distractor: Groups = {}
    by_angle: Groups = {}
    if kinds is not None and angles is not None:
        by_distractor = grouped(np.array([_kinds(row, names) for row in kinds[rows]]))
        bins = np.clip(np.digitize(angles[rows], ANGLE_BINS) - 1, 0, len(ANGLE_BINS) - 2)
        spans = np.array([f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)])
        by_angle = grouped(spans[bins])
    warnings = _warnings(whole, len(rows), len(true), ())
    counts = {
        "questions": len(rows),
        "questions_in_truth": len(true),
        "abstained": int(np.count_nonzero(answers[:, rows] == ABSTAINED)),
        "runs": len(files),
    }
    return ScoreFile(
        task="iqtt",
        method=files[0].method,
        comparable=not warnings,
        alignment="none",
        metrics={"iqtt_accuracy": _accuracy(right, settings)},
        by_distractor=by_distractor,
        by_rotation_angle=by_angle,
        by_position=grouped(true[rows]),
        items={"question": rows, "iqtt_accuracy": right.mean(axis=0)},
        meta=_meta(
            files, truth_path, fingerprint or _digest(true), settings, counts, warnings, None
        ),
    )


def _accuracy(right: Array, settings: Settings) -> Score:
    """Return the accuracy of R runs on Q questions, from (R, Q) bool."""
    runs, questions = right.shape
    unit = metric("iqtt_accuracy").unit
    if runs == 1:
        found = iqtt_accuracy(np.where(right[0], 0, ABSTAINED), np.zeros(questions, np.int64))
        return Score(found.value, found.low, found.high, unit, questions)
    means = right.mean(axis=0)[:, None]
    low, high = bootstrap_interval(means, settings.seed, settings.resamples, CONFIDENCE)
    std = float(right.mean(axis=1).std(ddof=1))
    return Score(float(means.mean()), _known(low[0]), _known(high[0]), unit, questions, std)


def _kinds(row: Array, names: Sequence[str]) -> str:
    """Name the question's kind by its two wrong answers': mirror where one is a mirror image."""
    found = {names[kind] for kind in row.tolist() if kind >= 0}
    return "mirror" if "mirror" in found else "+".join(sorted(found))


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _warnings(whole: bool, scored: int, count: int, penalised: Sequence[int]) -> list[str]:
    found = []
    if not whole:
        found.append(f"not comparable: only {scored} of {count} rows were answered by all runs")
    if penalised:
        found.append(f"not comparable: {len(penalised)} rows with values that are not finite")
    return found


def _meta(
    files: Sequence[RoomPredictions | QuestionPredictions],
    truth_path: Path,
    fingerprint: str,
    settings: Settings,
    counts: dict[str, int],
    warnings: list[str],
    floor: float | None,
) -> Meta:
    resampled = files[0].task == "rooms" or len(files) > 1
    return Meta(
        truth_fingerprint=fingerprint,
        truth_path=str(truth_path),
        submissions=tuple(Submission(str(file.path), file.sha256, file.run) for file in files),
        writer=writer_name(),
        versions={"numpy": np.__version__},
        seed=settings.seed,
        resamples=settings.resamples if resampled else 0,
        confidence=CONFIDENCE,
        counts=counts,
        warnings=tuple(warnings),
        chamfer_floor=floor,
    )


def _digest(answers: Array) -> str:
    """Return what stands for a truth without fingerprint: SHA-256 of its answers."""
    return hashlib.sha256(answers.astype(np.uint8).tobytes()).hexdigest()

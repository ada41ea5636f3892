"""Scores of submissions that answer mental-rotation questions."""

import hashlib
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import ABSTAINED, iqtt_accuracy
from metrics.measures.statistics import bootstrap_interval
from metrics.scoring.metric_names import metric
from metrics.scoring.records import Groups, Score, ScoreFile
from metrics.scoring.runs import (
    CONFIDENCE,
    Progress,
    Settings,
    known,
    matched_rows,
    meta_of,
    warnings_of,
)
from metrics.submissions.reader import QuestionPredictions

Array = NDArray[Any]
ANGLE_BINS = (0, 30, 60, 90, 120, 150, 180)  # degrees, of IQTT's rotations


def score_questions(
    files: Sequence[QuestionPredictions], truth_path: Path, settings: Settings, progress: Progress
) -> ScoreFile:
    """Score runs of one method on a file of answers; raises as `evaluate.score`."""
    from iqtt.files.reader import AnswersFile

    with AnswersFile(truth_path) as truth:
        true = np.asarray(truth.read("answers", slice(None))).astype(np.int64)
        fingerprint = truth.fingerprint
        kinds, names, angles = None, truth.kind_names, None
        if truth.has_truth:
            kinds = truth.read("distractor_kind", slice(None))
            angles = truth.read("angle_degrees", slice(None))
    rows, whole = matched_rows(files, truth_path, fingerprint, len(true), settings.allow_partial)
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
    warnings = warnings_of(whole, len(rows), len(true), ())
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
        meta=meta_of(
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
    return Score(float(means.mean()), known(low[0]), known(high[0]), unit, questions, std)


def _kinds(row: Array, names: Sequence[str]) -> str:
    """Return the kind of a question: "mirror" where a wrong answer is a mirror image, else both."""
    found = {names[kind] for kind in row.tolist() if kind >= 0}
    return "mirror" if "mirror" in found else "+".join(sorted(found))


def _digest(answers: Array) -> str:
    """Return SHA-256 of the answers, the fingerprint of a truth that has none."""
    return hashlib.sha256(answers.astype(np.uint8).tobytes()).hexdigest()

"""Scores of submissions that answer mental-rotation questions."""

import hashlib
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import ABSTAINED
from metrics.measures.statistics import bootstrap_interval, wilson_interval
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
        return {
            str(label): {"iqtt_accuracy": _accuracy(right[:, labels == label], settings)}
            for label in np.unique(labels).tolist()
        }

    groups: dict[str, Any] = {"by_position": grouped(true[rows])}
    if kinds is not None and angles is not None:
        by_kind = np.array([_kinds(row, names) for row in kinds[rows]])
        bins = np.clip(np.digitize(angles[rows], ANGLE_BINS) - 1, 0, len(ANGLE_BINS) - 2)
        spans = np.array([f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)])
        groups |= {"by_distractor": grouped(by_kind), "by_rotation_angle": grouped(spans[bins])}
    if not fingerprint:  # that of a truth that has none is SHA-256 of its answers
        fingerprint = hashlib.sha256(true.astype(np.uint8).tobytes()).hexdigest()
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
        **groups,
        items={"question": rows, "iqtt_accuracy": right.mean(axis=0)},
        meta=meta_of(files, truth_path, fingerprint, settings, counts, warnings, None),
    )


def _accuracy(right: Array, settings: Settings) -> Score:
    """Return the accuracy of R runs on Q questions, from (R, Q) bool.

    Source: Pix2Shape, section "3D-IQTT" and Table 3: the percentage of questions answered
    correctly, here as a fraction. Intervals take questions as independent.
    """
    runs, questions = right.shape
    unit = metric("iqtt_accuracy").unit
    if runs == 1:
        count = int(np.count_nonzero(right))
        return Score(count / questions, *wilson_interval(count, questions), unit, questions, None)
    means = right.mean(axis=0)[:, None]
    low, high = bootstrap_interval(means, settings.seed, settings.resamples, CONFIDENCE)
    std = float(right.mean(axis=1).std(ddof=1))
    return Score(float(means.mean()), known(low[0]), known(high[0]), unit, questions, std)


def _kinds(row: Array, names: Sequence[str]) -> str:
    """Return the kind of a question: "mirror" where a wrong answer is a mirror image, else both."""
    found = {names[kind] for kind in row.tolist() if kind >= 0}
    return "mirror" if "mirror" in found else "+".join(sorted(found))

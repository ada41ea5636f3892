"""Scores of submissions that answer mental-rotation questions."""

import hashlib
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

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
    refuse_copies,
    warnings_of,
)
from metrics.scoring.truth_digests import answers_digest
from metrics.submissions.reader import QuestionPredictions
from metrics.submissions.truths import FoundTruth
from scenegen.common.errors import FileFormatError

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile

Array = NDArray[Any]
LABELS = ("distractor_kind", "angle_degrees")  # by which accuracy is told, where a file has them
ANGLE_BINS = (0, 30, 60, 90, 120, 150, 180)  # degrees, of IQTT's rotations


def score_questions(
    files: Sequence[QuestionPredictions], found: FoundTruth, settings: Settings, progress: Progress
) -> ScoreFile:
    """Score runs of one method on a file of answers; raises as `evaluate.score`."""
    from iqtt.files.reader import AnswersFile

    with AnswersFile(found.path) as truth:
        names = ("answers", *(LABELS if truth.has_truth else ()))
        columns = {name: np.asarray(truth.read(name, slice(None))) for name in names}
        fingerprint, kind_names = truth.fingerprint, truth.kind_names
        if truth.has_truth:
            _check_kinds(truth, columns["distractor_kind"], columns["answers"])
        digest = answers_digest(truth, columns)
    true = columns["answers"].astype(np.int64)
    rows, whole = matched_rows(files, found.path, fingerprint, len(true), settings.allow_partial)
    refuse_copies(files, lambda i, j: _same(files[i], files[j]))
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
    if len(columns) > 1:
        kinds, angles = (columns[name][rows] for name in LABELS)
        by_kind = np.array([_kinds(row, kind_names) for row in kinds])
        bins = np.clip(np.digitize(angles, ANGLE_BINS) - 1, 0, len(ANGLE_BINS) - 2)
        spans = np.array([f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)])
        groups |= {"by_distractor": grouped(by_kind), "by_rotation_angle": grouped(spans[bins])}
    if not fingerprint:  # that of a truth that has none is SHA-256 of its answers
        fingerprint = hashlib.sha256(true.astype(np.uint8).tobytes()).hexdigest()
    warnings = warnings_of(whole, len(rows), len(true), (), found, digest)
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
        meta=meta_of(files, found, fingerprint, digest, settings, counts, warnings),
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
    return Score(float(means.mean(axis=0)[0]), known(low[0]), known(high[0]), unit, questions, std)


def _same(one: QuestionPredictions, other: QuestionPredictions) -> bool:
    """Return whether two submissions answer alike, and give no scores that differ."""
    a, b = (np.argsort(file.rows) for file in (one, other))
    pairs: list[tuple[Array, Array]] = [
        (one.rows[a], other.rows[b]),
        (one.answers[a], other.answers[b]),
    ]
    if one.scores is not None and other.scores is not None:
        pairs.append((one.scores[a], other.scores[b]))
    return all(np.array_equal(x, y) for x, y in pairs)


def _check_kinds(truth: "AnswersFile", kinds: Array, answers: Array) -> None:
    """Raise FileFormatError unless the wrong answers, and only they, have a kind."""
    right = np.arange(kinds.shape[1]) == answers[:, None]
    for row in np.flatnonzero(((kinds < 0) != right).any(axis=1))[:1].tolist():
        where = truth.place("distractor_kind", row)
        expected = f"-1 for the right answer, {answers[row]}, and for no other"
        raise FileFormatError(where, kinds[row].tolist(), expected)


def _kinds(row: Array, names: Sequence[str]) -> str:
    """Return the kind of a question: "mirror" where a wrong answer is a mirror image, else both."""
    found = {names[kind] for kind in row.tolist() if kind >= 0}
    return "mirror" if "mirror" in found else "+".join(sorted(found))

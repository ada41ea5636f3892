"""Scores of submissions that answer mental-rotation questions."""

import hashlib
import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import ABSTAINED
from metrics.scoring.estimates import ACCURACY, Bootstrap, accuracy
from metrics.scoring.records import AnswerGroup, Meta, ScoreFile
from metrics.scoring.runs import (
    Progress,
    QuestionRuns,
    Settings,
    matched_rows,
    meta_of,
    refuse_copies,
)
from metrics.scoring.truth_digests import answers_digest
from metrics.submissions.reader import QuestionPredictions
from metrics.submissions.rules import NOT_ASKED, OUTCOMES
from scenegen.common.errors import FileFormatError

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile

Array = NDArray[Any]
ANGLE_BINS = (0, 30, 60, 90, 120, 150, 180)  # degrees, of rotations of shapes


def score_questions(
    runs: QuestionRuns,
    settings: Settings,
    progress: Progress,
) -> ScoreFile:
    """Score runs of one method on an open file of answers; raises as `evaluate.score`."""
    from iqtt.floors import floors_of
    from iqtt.perspective.specs import ANGLE_BINS as OF_ROOMS
    from iqtt.perspective.specs import PerspectiveSpec
    from iqtt.questions.kinds import question_kind

    files, truth = runs.files, runs.truth
    names = [name for name in truth.SCORED if name in truth.fields]
    columns = {name: np.asarray(truth.read(name, slice(None))) for name in names}
    if truth.has_truth:
        _check_kinds(truth, columns["distractor_kind"], columns["answers"])
    digest = answers_digest(truth, columns)
    rows = matched_rows(runs, settings.allow_partial)
    true = columns["answers"].astype(np.int64)
    if not settings.allow_partial:  # such scores are not ranked, and two people may answer alike
        refuse_copies(files, lambda i, j: _same(files[i], files[j]))
    answers = np.full((len(files), len(true)), ABSTAINED)
    for run, file in zip(answers, files, strict=True):
        run[file.rows] = file.answers
    right = (answers == true)[:, rows].astype(np.float64)
    progress(len(rows))
    fingerprint = truth.fingerprint
    if not fingerprint:  # that of a truth that has none is SHA-256 of its answers
        fingerprint = hashlib.sha256(true.astype(np.uint8).tobytes()).hexdigest()
    counts = {
        "questions_in_truth": len(true),
        "answers": truth.answers,
        "abstained": int(np.count_nonzero(answers[:, rows] == ABSTAINED)),
    }
    kinds: list[str] = []
    if truth.has_truth:
        kinds = [question_kind(row) for row in columns["distractor_kind"][rows].tolist()]
    known = floors_of(truth.spec, settings.floors)
    floors = [known[kind] for kind in sorted(set(kinds)) if kind in known]
    meta = meta_of(runs, fingerprint, digest, settings, counts, question_floors=floors)
    of_reference = _shapes(truth)
    shapes = rows if of_reference is None else of_reference[rows]

    def grouped(labels: Array) -> dict[str, AnswerGroup]:
        return _answer_groups(right, shapes, labels, Bootstrap(meta.seed, meta.resamples))

    groups = {"by_position": grouped(true[rows])}
    if len(files) == 1:  # runs may differ in these
        groups |= _groups_of_texts(files[0], answers[0, rows], true, rows, shapes, meta)
    if kinds:
        edges = OF_ROOMS if isinstance(truth.spec, PerspectiveSpec) else ANGLE_BINS
        bins = np.digitize(columns["angle_degrees"][rows], edges[1:-1])
        spans = np.array([f"{a}-{b}" for a, b in itertools.pairwise(edges)])
        groups["by_distractor"] = grouped(np.array(kinds))
        groups["by_rotation_angle"] = grouped(spans[bins])
    items = {"question": rows, ACCURACY: right}
    if of_reference is not None:
        items["shape"] = shapes
    return ScoreFile("iqtt", files[0].method, "none", items, meta, answer_groups=groups)


def _answer_groups(
    right: Array, shapes: Array, labels: Array, bootstrap: Bootstrap
) -> dict[str, AnswerGroup]:
    """Return how R runs answered each group of Q questions, from (R, Q) of 0 or 1.

    `shapes` are the shapes of the questions, (Q,), and `labels` their groups, (Q,).
    """
    groups = {}
    for label in np.unique(labels).tolist():
        here = labels == label
        score = accuracy(right[:, here], shapes[here], bootstrap)
        counts = np.count_nonzero(right[:, here], axis=1).tolist()
        groups[str(label)] = AnswerGroup(score.n, tuple(counts), score.low, score.high)
    return groups


def _groups_of_texts(
    file: QuestionPredictions, answers: Array, true: Array, rows: Array, shapes: Array, meta: Meta
) -> dict[str, dict[str, AnswerGroup]]:
    """Return groups by the answers (Q,) that a model gave, and by what its texts held."""
    bootstrap = Bootstrap(meta.seed, meta.resamples)
    right = (answers == true[rows])[None].astype(np.float64)
    letters = np.where(answers == ABSTAINED, "none", answers.astype(str))
    groups = {"by_answer": _answer_groups(right, shapes, letters, bootstrap)}
    place = np.argsort(file.rows)[np.searchsorted(np.sort(file.rows), rows)]
    outcome, rotated = file.told("outcome"), file.told("rotated")
    if outcome is not None:
        labels = np.array(OUTCOMES)[outcome[place]]
        groups["by_outcome"] = _answer_groups(right, shapes, labels, bootstrap)
    if rotated is not None:
        asked = (rotated[place] != NOT_ASKED).all(axis=1)
        every = (rotated[place] == true[rows, None]).all(axis=1)[None, asked].astype(np.float64)
        label = np.full(len(shapes), "every order")
        groups["by_circle"] = _answer_groups(every, shapes[asked], label[asked], bootstrap)
    return groups


def _shapes(truth: "AnswersFile") -> Array | None:
    """Return a number for the shape of each reference, (Q,), in order of first appearance.

    Shapes that are mirror images of each other have one number. None where the file, as those that
    were released, does not tell the shapes, or is about rooms, none of which comes twice.
    """
    if "class_id" not in truth.fields:
        return None
    references = np.asarray(truth.read("class_id", slice(None)))[:, 0]
    _, first, index = np.unique(references, axis=0, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[index.reshape(-1)])


def _same(first: QuestionPredictions, other: QuestionPredictions) -> bool:
    """Return whether two submissions answer alike, and give no scores that differ."""
    a, b = (np.argsort(file.rows) for file in (first, other))
    pairs: list[tuple[Array, Array]] = [
        (first.rows[a], other.rows[b]),
        (first.answers[a], other.answers[b]),
    ]
    if first.scores is not None and other.scores is not None:
        pairs.append((first.scores[a], other.scores[b]))
    return all(np.array_equal(x, y) for x, y in pairs)


def _check_kinds(truth: "AnswersFile", kinds: Array, answers: Array) -> None:
    """Raise FileFormatError unless the wrong answers, and only they, have a kind."""
    right = np.arange(kinds.shape[1]) == answers[:, None]
    for row in np.flatnonzero(((kinds < 0) != right).any(axis=1))[:1].tolist():
        where = truth.place("distractor_kind", row)
        expected = f"-1 for the correct option, {answers[row]} and no other option"
        raise FileFormatError(where, kinds[row].tolist(), expected)

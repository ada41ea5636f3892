"""Whether a submission answers its truth: the same fingerprint, sizes and every row."""

from pathlib import Path

import numpy as np

from metrics.submissions.layout import ID_NAMES
from metrics.submissions.problems import Problem, first_ids
from metrics.submissions.reader import Predictions, QuestionPredictions, RoomPredictions
from metrics.submissions.rules import answer_problems
from scenegen.rooms.reader import RoomsFile


def match_problems(
    predictions: Predictions, truth_path: str | Path, fingerprint: str | None, count: int
) -> list[Problem]:
    """Return why a submission does not answer a truth of `count` rows with this fingerprint.

    If the fingerprints differ, that is the only problem returned. For a submission without
    fingerprint (JSON, or one for the released 3D-IQTT) only the rows are compared.
    """
    told = predictions.truth_fingerprint
    if told is not None and told != fingerprint:
        found = f"predictions for the truth with fingerprint {told:.12}"
        expected = f"{(fingerprint or 'none'):.12}, that of {truth_path}"
        return [Problem("truth_fingerprint", "match", expected, found)]
    name = ID_NAMES[predictions.task]
    problems = []
    unknown = predictions.rows[predictions.rows >= count]
    if len(unknown):
        found = f"{len(unknown)} that the truth does not have"
        problems.append(Problem(name, "known", f"0 to {count - 1}", found, first_ids(unknown)))
    given = np.zeros(count, np.bool_)
    given[predictions.rows[(predictions.rows >= 0) & (predictions.rows < count)]] = True
    missing = np.flatnonzero(~given)
    if len(missing):
        found = f"{len(missing)} of {count} missing"
        problems.append(Problem(name, "complete", "every one", found, first_ids(missing)))
    return problems


def size_problems(predictions: RoomPredictions, truth: RoomsFile) -> list[Problem]:
    """Return whether predicted images have another size than the truth's."""
    expected = (truth.spec.height, truth.spec.width)
    if (predictions.height, predictions.width) == expected:
        return []
    found = f"images of {predictions.height}x{predictions.width}"
    return [Problem("depth", "shape", f"{expected[0]}x{expected[1]}, as the truth", found)]


def candidate_problems(predictions: QuestionPredictions, candidates: int) -> list[Problem]:
    """Return whether a submission chooses among another number of answers than is offered."""
    scored = predictions.candidates
    if scored not in (None, candidates):
        expected = f"(M, {candidates}), as each question offers {candidates} answers"
        return [Problem("scores", "shape", expected, f"shape (M, {scored})")]
    return answer_problems(predictions.answers, predictions.rows, candidates=candidates)

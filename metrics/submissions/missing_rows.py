"""Whether a submission answers the truth it is held against: fingerprint, size and rows."""

from pathlib import Path

import numpy as np

from metrics.submissions.layout import ID_NAMES
from metrics.submissions.problems import Problem, first_ids
from metrics.submissions.reader import Predictions, RoomPredictions
from scenegen.rooms.reader import RoomsFile


def match_problems(
    predictions: Predictions, truth_path: str | Path, fingerprint: str | None, count: int
) -> list[Problem]:
    """Say why a submission does not answer a truth of `count` rows with that fingerprint.

    Where the fingerprint is another one that is all that is told. A submission without fingerprint
    (JSON) or a truth without one (the released 3D-IQTT) is held to its rows alone.
    """
    told = predictions.truth_fingerprint
    if told is not None and told != fingerprint:
        got = f"predictions for the truth with fingerprint {told:.12}"
        expected = f"{(fingerprint or 'none'):.12}, that of {truth_path}"
        return [Problem("truth_fingerprint", "match", expected, got)]
    name = ID_NAMES[predictions.task]
    problems = []
    unknown = predictions.rows[predictions.rows >= count]
    if len(unknown):
        got = f"{len(unknown)} that the truth does not have"
        problems.append(Problem(name, "known", f"0 to {count - 1}", got, first_ids(unknown)))
    given = np.zeros(count, np.bool_)
    given[predictions.rows[(predictions.rows >= 0) & (predictions.rows < count)]] = True
    missing = np.flatnonzero(~given)
    if len(missing):
        got = f"{len(missing)} of {count} missing"
        problems.append(Problem(name, "complete", "every one", got, first_ids(missing)))
    return problems


def size_problems(predictions: RoomPredictions, truth: RoomsFile) -> list[Problem]:
    """Say whether predicted images have another size than the truth's."""
    expected = (truth.spec.height, truth.spec.width)
    if (predictions.height, predictions.width) == expected:
        return []
    got = f"images of {predictions.height}x{predictions.width}"
    return [Problem("depth", "shape", f"{expected[0]}x{expected[1]}, as the truth", got)]

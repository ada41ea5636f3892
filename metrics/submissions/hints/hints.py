"""Known mistakes, recognised by measurement against the truth: hints, not verdicts.

A hint is given only where undoing the mistake explains the predictions: in most of the sampled
images the error falls to half of what any simple remedy (a scale, a shift) leaves, and to half of
what a constant would score. Good, middling, constant and random predictions do not get there.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.statistics import wilson_interval
from metrics.submissions.hints.depth import depth_hints
from metrics.submissions.hints.normals import normal_hints
from metrics.submissions.hints.order import order_hints
from metrics.submissions.hints.samples import sample_rooms
from metrics.submissions.problems import HINT, Problem
from metrics.submissions.reader import QuestionPredictions, RoomPredictions
from scenegen.rooms.reader import RoomsFile


def room_hints(predictions: RoomPredictions, truth: RoomsFile) -> list[Problem]:
    """Hints on depth, normals and the order of rows, of a submission that fits its truth's size.

    Looks at 24 images, and at a few pixels of at most 4096 of the truth's. Values that are not
    finite are passed over. Raises FileFormatError where the truth is damaged.
    """
    samples = sample_rooms(predictions, truth)
    found = depth_hints(samples, predictions.alignment)
    if predictions.has_normals:
        found += normal_hints(samples)
    return found + order_hints(predictions, truth)


def answer_hints(predictions: QuestionPredictions, answers: NDArray[Any]) -> list[Problem]:
    """Say whether the lowest of three scores is right far more often than chance, 1/3.

    Then the scores are distances: the hint comes where the Wilson interval of the lowest score's
    accuracy lies above 1/2. `answers` (Q,) are the right ones.
    """
    usable = (predictions.rows >= 0) & (predictions.rows < len(answers))
    if predictions.scores is None or not usable.any():
        return []
    lowest = predictions.scores[usable].argmin(axis=1)
    right = int(np.count_nonzero(lowest == answers[predictions.rows[usable]]))
    low, _ = wilson_interval(right, len(lowest))
    if low <= 0.5:
        return []
    got = f"the lowest score is right in {right} of {len(lowest)} questions: scores look like"
    return [Problem("scores", HINT, "the highest score for the best", f"{got} distances")]

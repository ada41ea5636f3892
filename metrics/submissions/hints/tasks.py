"""All hints on a submission of images, and on answers to questions: scores that are distances."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.reader import Images, MeasuredFile
from metrics.measures.statistics import wilson_interval
from metrics.submissions.hints.depth import depth_hints, disparity_hints
from metrics.submissions.hints.normals import normal_hints
from metrics.submissions.hints.order import order_hints
from metrics.submissions.hints.points import point_hints
from metrics.submissions.hints.samples import sample_rooms
from metrics.submissions.hints.shifts import shift_hints
from metrics.submissions.problems import HINT, Problem
from metrics.submissions.reader import QuestionPredictions, RoomPredictions


def room_hints(predictions: RoomPredictions, truth: Images) -> list[Problem]:
    """Return hints on a submission whose images have the size of the truth's.

    They rest on 24 images for depth and normals, and on a few pixels of at most 4096 rows of the
    truth for the order of rows. Values that are not finite are ignored. Raises FileFormatError
    where the truth is damaged.
    """
    samples = sample_rooms(predictions, truth)
    if predictions.kind == "disparity":
        hints = disparity_hints(samples)
    else:
        hints = depth_hints(samples, predictions.alignment, predictions.kind)
    if isinstance(truth, MeasuredFile):
        return hints + shift_hints(predictions, truth)
    if predictions.kind == "points":
        hints += point_hints(samples, predictions.alignment)
    if predictions.has_normals:
        hints += normal_hints(samples)
    return hints + order_hints(predictions, truth)


def answer_hints(predictions: QuestionPredictions, answers: NDArray[Any]) -> list[Problem]:
    """Return a hint where the answers are right far more often after undoing a mistake.

    These are scores that are distances, of which the lowest is right, and answers that are counted
    from 1. The hint is given where the Wilson interval of the mended accuracy lies above 3/2 of
    chance: above 1/2 of three answers, 3/4 of two. `answers` (Q,) are the right ones.
    """
    usable = (predictions.rows >= 0) & (predictions.rows < len(answers))
    if not usable.any():
        return []
    right = answers[predictions.rows[usable]]
    given = predictions.answers[usable]
    offered = int(answers.max()) + 1
    hints = []
    if predictions.scores is not None:
        lowest = predictions.scores[usable].argmin(axis=1)
        if _clear(lowest == right, predictions.scores.shape[1]):
            found = f"the lowest score is correct in {np.count_nonzero(lowest == right)} of"
            found = f"{found} {len(right)} questions: scores look like distances"
            hints.append(Problem("scores", HINT, "the highest score for the best", found))
    elif (given > 0).all() and (_clear(given - 1 == right, offered) or given.max() == offered):
        found = "responses look counted from 1: none is 0, and response - 1 is correct more often"
        hints.append(Problem("answer", HINT, "responses counted from 0", found))
    return hints


def _clear(right: NDArray[np.bool_], offered: int) -> bool:
    low, _ = wilson_interval(int(np.count_nonzero(right)), len(right))
    return low > 1.5 / offered

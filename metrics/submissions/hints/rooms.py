"""Hints on a submission of images: depth, normals, shifts, and the order of rows."""

from metrics.measured.reader import Images, MeasuredFile
from metrics.submissions.hints.depth import depth_hints, disparity_hints
from metrics.submissions.hints.normals import normal_hints
from metrics.submissions.hints.order import order_hints
from metrics.submissions.hints.points import point_hints
from metrics.submissions.hints.samples import sample_rooms
from metrics.submissions.hints.shifts import shift_hints
from metrics.submissions.problems import Problem
from metrics.submissions.reader import RoomPredictions


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

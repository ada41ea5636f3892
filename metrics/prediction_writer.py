"""Write valid submissions: every row is checked when it is added.

    with RoomPredictionWriter("predictions.h5", "rooms.h5", method="mine", run="seed 0") as out:
        for row in range(len(rooms)):
            out.add(row, depth, normal)

`describe_format` describes the file format.
"""

from metrics.submissions.layout import describe_format
from metrics.submissions.problems import PredictionError
from metrics.submissions.writer import RoomPredictionWriter, write_answers

__all__ = ["PredictionError", "RoomPredictionWriter", "describe_format", "write_answers"]

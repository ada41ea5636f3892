"""Submit predictions for a file of rooms: python examples/submit.py rooms.h5 predictions.h5

What it predicts is a dummy, a wall that faces the camera; put your model in its place.
"""

import argparse

import numpy as np

import scenegen
from metrics.prediction_writer import RoomPredictionWriter


def predict(image):
    """Radiance (H, W, 3) to planar depth (H, W) and normals (H, W, 3): a dummy."""
    depth = np.full(image.shape[:2], 1.6)  # scene units: the room's edge is 1
    return depth, np.broadcast_to([0.0, 0.0, 1.0], image.shape)  # camera frame, facing the viewer


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("rooms")
parser.add_argument("predictions")
parser.add_argument("--overwrite", action="store_true", help="replace an existing file")
arguments = parser.parse_args()
truth, out = arguments.rooms, arguments.predictions
try:
    with (
        scenegen.open_rooms(truth) as rooms,
        RoomPredictionWriter(
            out, truth, method="dummy wall", run="seed 0", overwrite=arguments.overwrite
        ) as predictions,
    ):
        for room in rooms:
            predictions.add(room.index, *predict(room.radiance))
except OSError as error:
    parser.exit(2, f"Error: {error.filename}: {error.strerror}\n")
except scenegen.SceneGenError as error:
    parser.exit(2, f"Error: {error}\n")
print(f"now: bench score {out} --truth {truth}")

"""What relief networks predict of rooms. Only images and cameras are read."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.pix2shape.predict import enlarged_views
from baselines.relief.network import Card, Relief, predicted_depth
from baselines.training.baseline import Views
from baselines.training.images import Array, check_reducible
from baselines.training.rooms import camera_poses, input_views, room_images, room_sizes
from scenegen.rooms.reader import RoomsFile

FILES = Path(__file__).with_name("files")
TOLD = "told: the camera, and where the empty room's floor and walls are"
FROM = "each view is predicted from its own image"
FROM_FIRST = "each view is predicted from the image of the scene's first one"


def views_of(told_in_training: str, network: Relief, card: Card, rooms: RoomsFile) -> Views:
    """Return what a network predicts of every view of a file of rooms.

    It predicts each view from its own image, or each scene from one image alone, view 0 or the
    first that the file holds. The submission's notes say it, too.
    """
    size, from_first = card.settings.size, network.from_first_view
    check_reducible(rooms.path, rooms.spec.height, rooms.spec.width, size)
    poses = torch.from_numpy(camera_poses(rooms, closed=True).astype(np.float32))
    fov = rooms.read("camera/fov_y_degrees", slice(None))
    sizes = room_sizes(rooms) if rooms.spec.interior else None
    source = np.arange(len(rooms))
    if from_first:
        inputs, place = input_views(rooms)
        source = inputs[place]

    def depth(rows: Array) -> Tensor:
        image = room_images(rooms, source[rows], size)
        own = float(fov[rows[0]]), None if sizes is None else sizes[rows]
        cameras = target_cameras = Cameras(poses[source[rows]], *own)
        if from_first:
            target_cameras = Cameras(poses[rows], *own)
        return predicted_depth(network, image, cameras, target_cameras)

    notes = f"{FROM_FIRST if from_first else FROM}; {TOLD}{told_in_training}"
    shown = "first_view" if from_first else "scored_view"
    return Views(enlarged_views(rooms, depth), shown, card.method, notes)

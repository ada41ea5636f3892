"""Submissions of relief networks. Of the rooms only images and cameras are read."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.pix2shape.use.predict import Progress, write_depths
from baselines.relief.network import Card, predicted_depth, relief_network
from baselines.training.checkpoint import Method, load_weights
from baselines.training.images import Array, check_reducible
from baselines.training.rooms import camera_poses, input_views, room_images
from scenegen import open_rooms
from scenegen.files.new_file import check_writable

FILES = Path(__file__).with_name("files")
TOLD = "told: the camera, and where the empty room's floor and walls are"
FROM = {
    "unet": "each view is predicted from its own image",
    "sweep": "each view is predicted from the image of the scene's first one",
}


@torch.inference_mode()
def write_submission(
    name: str,
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write depth and normals of every view of a file of rooms, as `baselines.training` says.

    A network "unet" predicts each view from its own image; one of "sweep" each scene from one image
    alone, view 0 or the first that the file holds, under the name "NAME-sweep". The submission's
    notes say it, too.

    Args:
        name: of the method.
    """
    check_writable(Path(out), overwrite)
    method = Method(name, Card, relief_network)
    network, card = load_weights(weights or FILES / f"{name}.safetensors", method)
    kind, size = card.settings.network, card.settings.size
    with open_rooms(data) as rooms:
        check_reducible(data, rooms.spec.height, rooms.spec.width, size)
        poses = torch.from_numpy(camera_poses(rooms).astype(np.float32))
        fov, source = rooms.spec.fov_y_degrees, np.arange(len(rooms))
        if kind == "sweep":
            inputs, place = input_views(rooms)
            source = inputs[place]

        def depth(rows: Array) -> Tensor:
            image = room_images(rooms, source[rows], size)
            cameras = target_cameras = Cameras(poses[source[rows]], fov)
            if kind == "sweep":
                target_cameras = Cameras(poses[rows], fov)
            return predicted_depth(network, image, cameras, target_cameras)

        full_name = name if kind == "unet" else f"{name}-{kind}"
        how = {"method": full_name, "notes": f"{FROM[kind]}; {TOLD}", "overwrite": overwrite}
        shown = "scored_view" if kind == "unet" else "first_view"
        write_depths(rooms, out, data, depth, progress, shown=shown, **how)

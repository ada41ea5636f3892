"""Submissions of relief networks. Of the rooms only images and cameras are read."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from baselines.checkpoints import load_weights
from baselines.depth_supervised.card import recipe
from baselines.depth_supervised.network import predicted_depth
from baselines.pix2shape.data.rooms import (
    camera_poses,
    check_reducible,
    room_images,
    row_batches,
)
from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.pix2shape.use.predict import enlarged, input_views
from metrics.prediction_writer import RoomPredictionWriter
from scenegen.files.new_file import check_writable
from scenegen.rooms.reader import RoomsFile

METHOD = "depth-supervised"
TOLD = "told: the camera, and where the empty room's floor and walls are"
FROM = {
    "unet": "each view is predicted from its own image",
    "code": "each view is predicted from the image of the scene's first one",
}
BATCH = 64  # images at a time
WEIGHTS = Path(__file__).with_name("files") / "unet.safetensors"
Progress = Callable[[int, int], Any]  # rows done, rows in all


def submit(
    method: str,
    bundled: Path,
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write depth and normals of every view of a file of rooms.

    A network of kind "unet" predicts each view from its own image; of kind "code" each scene from
    one image alone, view 0 or the first that the file holds, under the name "METHOD-code". The
    submission's notes say it, too.

    Args:
        method: one of `card.METHODS`.
        bundled: the method's weights that come with the package.
        weights: as `bench train METHOD` writes them; None for those of the package.
        progress: called with the number of rows done and of all, a batch at a time.

    Raises OSError, FileFormatError for either file, also where a camera is not known; SpecError
    where images cannot be reduced to the network's size.
    """
    check_writable(Path(out), overwrite)
    state = load_weights(bundled if weights is None else weights, recipe(method))
    network, card = state.network, state.card
    kind, size = card.network.kind, card.network.size
    with RoomsFile(data) as rooms:
        check_reducible(data, rooms.spec.height, rooms.spec.width, size)
        poses = torch.from_numpy(camera_poses(rooms).astype(np.float32))
        fov = rooms.spec.fov_y_degrees
        rows = np.arange(len(rooms))
        source = rows
        if kind == "code":
            inputs, place = input_views(rooms)
            source = inputs[place]
        name = method if kind == "unet" else f"{method}-{kind}"
        notes = f"{FROM[kind]}; {TOLD}"
        with RoomPredictionWriter(
            out, data, method=name, notes=notes, overwrite=overwrite
        ) as submission:
            for some in row_batches(len(rooms), BATCH):
                image = room_images(rooms, source[some], size)
                own = asked = Cameras(poses[source[some]], fov)
                if kind == "code":
                    asked = Cameras(poses[some], fov)
                depth, normal = predicted(network, image, own, asked, rooms.spec.height)
                for row, z, n in zip(rows[some], depth, normal, strict=True):
                    submission.add(int(row), z, n)
                progress(len(some), len(rooms))


@torch.inference_mode()
def predicted(
    network: nn.Module, image: Tensor, own: Cameras, asked: Cameras, size: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return planar depth, (B, S, S), and its normals, (B, S, S, 3), camera frame, S = `size`."""
    depth = predicted_depth(network, image, own, asked)
    depth, normal = enlarged(depth, own.fov_y_degrees, size)
    return depth.numpy(), np.moveaxis(normal.numpy(), 1, -1)


write_submission = partial(submit, METHOD, WEIGHTS)

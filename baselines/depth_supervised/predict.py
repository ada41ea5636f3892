"""Submissions of relief networks. Of the rooms only images and cameras are read."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from baselines.depth_supervised.network import Cameras, predicted_depth
from baselines.depth_supervised.rooms import camera_poses
from baselines.depth_supervised.storage import load_weights
from baselines.pix2shape.data.rooms import channels_first, check_reducible
from baselines.pix2shape.use.predict import enlarged, input_views
from metrics.prediction_writer import RoomPredictionWriter
from scenegen.common.new_file import check_writable
from scenegen.rendering.ground_truth import decode_image
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


def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path = WEIGHTS,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write depth and normals of every view of a file of rooms; as `submit`.

    Args:
        weights: as `bench train depth-supervised` writes them; by default those of the package.
    """
    submit(METHOD, data, out, weights, overwrite, progress)


def submit(
    method: str,
    data: str | Path,
    out: str | Path,
    weights: str | Path,
    overwrite: bool,
    progress: Progress,
) -> None:
    """Write a submission of a method's weights.

    A network of kind "unet" predicts each view from its own image; of kind "code" each scene from
    one image alone, view 0 or the first that the file holds, under the name "METHOD-code". The
    submission's notes say it, too.

    Args:
        progress: called with the number of rows done and of all, a batch at a time.

    Raises OSError, FileFormatError for either file, also where a camera is not known; SpecError
    where images cannot be reduced to the network's size.
    """
    check_writable(Path(out), overwrite)
    network, card = load_weights(weights, method)
    kind, size = card.network.kind, card.network.size
    with RoomsFile(data) as rooms:
        check_reducible(data, rooms.spec.height, rooms.spec.width, size)
        poses, fov = camera_poses(rooms), rooms.spec.fov_y_degrees
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
            for some in batches(len(rooms)):
                image = stacked(rooms, source[some], size)
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


def stacked(rooms: RoomsFile, rows: NDArray[np.int64], size: int) -> Tensor:
    """Return the images of rows as networks take them, (B, 3, S, S), linear radiance."""
    images = [decode_image(rooms.read("image", int(row))) for row in rows]
    return torch.from_numpy(np.stack([channels_first(image, size) for image in images]))


def batches(count: int) -> Iterator[NDArray[np.int64]]:
    """Yield the rows of batch after batch."""
    return (np.arange(first, min(first + BATCH, count)) for first in range(0, count, BATCH))

"""Submissions of a trained model. Of the truth only the cameras of rooms are read."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.data.rooms import (
    camera_poses,
    check_reducible,
    is_question_file,
    room_images,
    row_batches,
)
from baselines.pix2shape.network.config import TAUGHT_DEPTH
from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.network.surfels import extrapolated, normals_from_depth
from baselines.pix2shape.use.answers import answer_file
from baselines.pix2shape.weights.bundled import open_weights
from metrics.prediction_writer import RoomPredictionWriter
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.files.new_file import check_writable
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
BATCH = 64  # images at a time
TOLD = "told: one image of each scene, the cameras, and where the empty room's floor and walls are"
DEPTH = "told: in training, true depth maps"
Progress = Callable[[int, int], Any]  # rows done, rows in all


def predict_file(
    weights: str | Path,
    data: str | Path,
    out: str | Path,
    *,
    device: str = "auto",
    run: str = "",
    method: str | None = None,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write a submission for rooms or questions.

    Args:
        weights: a path, or the name of bundled weights.
        device: "auto", "cpu" or "cuda".
        run: name of this run among several of the method.
        method: the name that the submission must have; None for whatever the weights' is.

    Raises as `open_weights`, `predict_rooms` and `answer_file`, and SpecError for weights of
    another method.
    """
    model, card = open_weights(weights)
    own = card.method
    if method not in (None, own):
        hint = "names tell what a model was told and taught; `pix2shape predict` takes any weights"
        raise SpecError("weights", f"{weights}, whose method is {own}", method, hint)
    model.to(chosen_device(device))
    check_writable(Path(out), overwrite)
    how: dict[str, Any] = {"run": run, "overwrite": overwrite, "progress": progress}
    if is_question_file(data):
        answer_file(model, data, out, labels=card.labels + card.earlier_labels, **how)
    else:
        predict_rooms(model, data, out, earlier_depth=card.earlier_depth, **how)


def chosen_device(name: str, count: int = 1) -> torch.device:
    """Return a device by name; "auto" is a GPU if there is one. Raises SpecError."""
    if name == "cuda" and not torch.cuda.is_available():
        raise SpecError("device", "no GPU that this torch can use", hint="say --device cpu")
    if name == "cpu" or not torch.cuda.is_available():
        return torch.device("cpu")
    check(count <= torch.cuda.device_count(), "devices", count, str(torch.cuda.device_count()))
    return torch.device("cuda")


@torch.inference_mode()
def predict_rooms(
    model: Pix2Shape,
    data: str | Path,
    out: str | Path,
    *,
    earlier_depth: bool = False,
    run: str = "",
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write depth and normals of every view of a rooms file, each scene from one image alone.

    That image is the scene's view 0, or the first of its views that the file holds, which is
    warned about. The encoder sees it once; the decoder is asked for each view of the scene.

    Args:
        earlier_depth: whether true depth maps taught weights from which the model's training
            began; the submission's name and notes tell this.

    Raises SpecError where the model does not suit rooms; FileFormatError where a camera is not
    known or the file is damaged; OSError.
    """
    spec = model.config.networks
    if not spec.camera or spec.classes:
        what = "is told classes, which are part of the truth" if spec.classes else "is not told it"
        raise SpecError("weights", f"a model that {what}", "one that is told the camera alone")
    device = next(model.parameters()).device
    with RoomsFile(data) as rooms:
        size = rooms.spec.height
        check_reducible(data, size, rooms.spec.width, spec.size)
        poses = torch.from_numpy(camera_poses(rooms).astype(np.float32)).to(device)
        condition, fov = poses[:, :3, 3], rooms.spec.fov_y_degrees
        inputs, own = input_views(rooms)
        found = []
        for chosen in row_batches(len(inputs), BATCH):
            images = room_images(rooms, inputs[chosen], spec.size).to(device)
            told = condition[inputs[chosen]], Cameras(poses[inputs[chosen]], fov)
            found.append(model.codes(images, *told))
        codes = torch.cat(found)
        method = TAUGHT_DEPTH if earlier_depth else model.config.method
        how: dict[str, Any] = {"method": method, "run": run, "overwrite": overwrite}
        how["notes"] = "; ".join([TOLD] * spec.rays + [DEPTH] * (method == TAUGHT_DEPTH))
        with RoomPredictionWriter(out, data, **how) as file:
            for rows in row_batches(len(rooms), BATCH):
                asked = condition[rows], Cameras(poses[rows], fov)
                depth = model.surfels(codes[own[rows]], *asked).depth
                depth, normal = enlarged(depth, fov, size)
                for row, z, n in zip(rows, depth.cpu(), normal.cpu(), strict=True):
                    file.add(int(row), z.numpy(), np.moveaxis(n.numpy(), 0, -1))
                progress(len(rows), len(rooms))


def enlarged(depth: Tensor, fov_y_degrees: float, size: int) -> tuple[Tensor, Tensor]:
    """Return depth, (B, size, size), and normals, (B, 3, size, size), of smaller depth maps.

    Inverse depth is interpolated, as it is affine on planes: planes stay planes.
    """
    normals = normals_from_depth(depth, fov_y_degrees)
    factor = size // depth.shape[1]
    if factor == 1:
        return depth, normals
    # The outer pixels' centres lie within the image: extrapolate beyond its border, then crop.
    wide = functional.interpolate(
        extrapolated(1 / depth)[:, None], scale_factor=factor, mode="bilinear"
    )
    inverse = wide[:, 0, factor:-factor, factor:-factor]
    least = 0.5 / depth.amax(dim=(1, 2), keepdim=True)  # keeps extrapolated depth finite
    normals = functional.interpolate(normals, scale_factor=factor, mode="bilinear")
    return 1 / torch.maximum(inverse, least), functional.normalize(normals, dim=1)


def input_views(rooms: RoomsFile) -> tuple[Array, Array]:
    """Return each scene's input row, (S,), and for each row its scene's place in there, (N,)."""
    scene, view = (rooms.read(name, slice(None)) for name in ("scene_index", "view_index"))
    first: dict[int, int] = {}
    for row in np.argsort(view, kind="stable"):
        first.setdefault(int(scene[row]), int(row))
    inputs = np.array(sorted(first.values()))
    if late := np.count_nonzero(view[inputs]):
        warnings.warn(
            f"{rooms.path}: {late} of {len(inputs)} scenes have no view 0; the model's input is the"
            " first of their other views",
            stacklevel=3,
        )
    return inputs, np.searchsorted(inputs, [first[int(number)] for number in scene])

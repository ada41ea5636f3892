"""Submissions of a trained model: depth and normals of rooms, or answers to questions.

Of the truth only the cameras of rooms are read.
"""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.images import check_background
from baselines.pix2shape.network.config import TAUGHT_DEPTH
from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.network.surfels import extrapolated, normals_from_depth
from baselines.pix2shape.training.losses import squared_distances
from baselines.pix2shape.weights import open_weights
from baselines.training.baseline import Answers, RowsDone, Views, submit
from baselines.training.images import Array, check_reducible, row_batches
from baselines.training.machine import chosen_device
from baselines.training.questions import is_question_file
from baselines.training.rooms import camera_poses, input_views, room_images
from iqtt import QuestionsFile
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile

BATCH = 64  # images at a time
TOLD = (
    "given as input: one image of each scene, the cameras, and ground and walls of the empty room"
)
DEPTH = "given in training: ground-truth depth maps"
TAUGHT = "given in training: the lights of its images and the labels of {} questions"


def predict_file(
    weights: str | Path,
    data: str | Path,
    out: str | Path,
    *,
    device: str = "auto",
    run: str = "",
    method: str | None = None,
    overwrite: bool = False,
    progress: RowsDone = lambda done, total: None,
) -> None:
    """Write a submission for rooms or questions.

    Args:
        weights: a path, or the name of bundled weights.
        device: "auto", "cpu" or "cuda".
        run: name of this run among several of the method.
        method: the name that the submission must have; None for whatever the weights' is.

    Raises as `open_weights`, `views_of` and `answers_of`, and SpecError for weights of another
    method.
    """
    model, card = open_weights(weights)
    if method not in (None, card.submission):
        hint = "the name states inputs and supervision; `pix2shape predict` takes any weights"
        raise SpecError("weights", f"{weights}, whose method is {card.submission}", method, hint)
    model.to(chosen_device(device))
    predict = (
        partial(answers_of, model, card.labels + card.earlier_labels, run)
        if is_question_file(data)
        else partial(views_of, model, card.earlier_depth, run)
    )
    how: dict[str, Any] = {"overwrite": overwrite, "progress": progress}
    submit(data, out, model.config.method, model.config.networks.size, predict, **how)


def views_of(model: Pix2Shape, earlier_depth: bool, run: str, rooms: RoomsFile) -> Views:
    """Return depth and normals of every view of a rooms file, each scene from one image alone.

    That image is the scene's view 0, or the first of its views that the file holds, which is
    warned about. The encoder sees it once; the decoder is asked for each view of the scene.

    Args:
        earlier_depth: whether true depth maps taught weights from which the model's training
            began; the submission's name and notes tell this.

    Raises SpecError where the model does not suit rooms; FileFormatError where a camera is not
    known or the file is damaged.
    """
    spec = model.config.networks
    if not spec.camera or spec.classes:
        what = (
            "takes categories as input, which are part of the ground truth"
            if spec.classes
            else "does not take it as input"
        )
        raise SpecError("weights", f"a model that {what}", "one that takes the camera only")
    device = next(model.parameters()).device
    method = TAUGHT_DEPTH if earlier_depth else model.config.method
    notes = "; ".join([TOLD] * spec.rays + [DEPTH] * (method == TAUGHT_DEPTH))
    check_reducible(rooms.path, rooms.spec.height, rooms.spec.width, spec.size)
    poses = torch.from_numpy(camera_poses(rooms).astype(np.float32)).to(device)
    condition, fov = poses[:, :3, 3], rooms.spec.fov_y_degrees
    inputs, scene_of = input_views(rooms)
    codes = []
    for places in row_batches(len(inputs), BATCH):
        rows = inputs[places]
        images = room_images(rooms, rows, spec.size).to(device)
        codes.append(model.codes(images, condition[rows], Cameras(poses[rows], fov)))
    code = torch.cat(codes)

    def depth(rows: Array) -> Tensor:
        views = condition[rows], Cameras(poses[rows], fov)
        return model.surfels(code[scene_of[rows]], *views).depth

    return Views(enlarged_views(rooms, depth), "first_view", method, notes, run)


def answers_of(model: Pix2Shape, labels: int, run: str, questions: QuestionsFile) -> Answers:
    """Return how a model answers questions, from images alone.

    An answer's score is minus the distance of its z_scene from the reference's, as in the paper.

    Args:
        labels: answers that training was given; the submission's notes tell this.

    Raises SpecError where the model does not suit questions.
    """
    spec, device = model.config.networks, next(model.parameters()).device
    if spec.condition:
        raise SpecError("weights", "a model that takes the camera as input", "one for questions")
    check_background(questions, model.config)

    def scores(images: Tensor) -> Tensor:
        flat = images.flatten(0, 1).to(device)
        codes = model.codes(flat, flat.new_empty(len(flat), 0))[:, : spec.z_scene]
        return -squared_distances(codes.view(*images.shape[:2], -1)).sqrt()

    return Answers(scores, BATCH // (1 + questions.answers), TAUGHT.format(labels), run)


def enlarged_views(
    rooms: RoomsFile, depth_of: Callable[[Array], Tensor]
) -> Iterator[tuple[Array, dict[str, Array]]]:
    """Yield rows, with their depth and the normals that follow from it, at the size of the images.

    Args:
        depth_of: returns planar depth, (B, S, S), of some rows, which have one field of view.
    """
    size, fov = rooms.spec.height, rooms.read("camera/fov_y_degrees", slice(None))
    runs = np.split(np.arange(len(fov)), np.flatnonzero(np.diff(fov)) + 1)
    for rows in (run[places] for run in runs for places in row_batches(len(run), BATCH)):
        depth, normal = enlarged(depth_of(rows), float(fov[rows[0]]), size)
        normals = np.moveaxis(normal.cpu().numpy(), 1, -1)
        yield rows, {"depth": depth.cpu().numpy(), "normal": normals}


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

"""Batches of polycubes: silhouettes are those of the file's own images, and of turned shapes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from ptn_models import cubes_volume, tiny

from baselines.ptn.projection import silhouettes
from baselines.ptn.questions import TrainingShapes, meets_cubes
from iqtt.files.make import make_split
from iqtt.files.reader import open_questions
from iqtt.questions.specs import SplitSpec
from scenegen.camera import pixel_directions


@pytest.fixture(scope="module")
def split(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("ptn") / "split"
    size: dict[str, Any] = {"height": 48, "width": 48, "min_cube_pixels": 1}
    make_split(folder, SplitSpec(train=3, labeled=2, val=0, test=2, **size))
    return folder


def test_silhouettes_of_cubes_are_where_images_are_not_background(split):
    with open_questions(split / "iqtt-train.h5", "unlabeled") as questions:
        spec = questions.spec
        question = questions[0]
        pose = question.truth.camera.world_from_camera
        rays = pixel_directions(48, 48, spec.fov_y_degrees).reshape(-1, 3) @ pose[:3, :3].T
        for image, cubes, turn in zip(
            question.radiance, question.truth.cubes, question.truth.world_from_shape, strict=True
        ):
            origin = np.broadcast_to(pose[:3, 3] @ turn, rays.shape)
            found = meets_cubes(cubes, origin, rays @ turn).reshape(48, 48)
            shown = (np.abs(image - spec.background) > 0.01).any(axis=-1)
            assert 0.03 < shown.mean() < 0.9
            assert (found != shown).mean() < 0.005


def test_volumes_of_the_truth_have_the_batchs_silhouettes(split):
    path = split / "iqtt-train.h5"
    model = tiny("questions", batch=3, rays=200, views=3, size=48)
    with open_questions(path, "unlabeled") as questions:
        batch = TrainingShapes(questions, model.settings).batch(np.random.default_rng(0))
    assert batch.camera.shape == (3, 0)
    with open_questions(path, "unlabeled") as questions:
        (question,) = questions
        distance = question.truth.camera.position[2]
        radius = distance / questions.spec.framing_distance(1.0)
    for item in range(3):
        same = [np.moveaxis(one, -1, 0) == batch.image[item].numpy() for one in question.radiance]
        which = int(np.argmax([one.mean() for one in same]))
        cubes, turn = question.truth.cubes[which], question.truth.world_from_shape[which]
        rays = batch.origin[item][None], batch.direction[item][None]
        toward = torch.nn.functional.normalize(batch.direction[item], dim=1)
        miss = torch.linalg.cross(batch.origin[item], toward).norm(dim=1)
        assert miss.max() < 1.02 * 2**0.5  # rays of a camera that frames the ball of radius 1
        assert len(batch.origin[item].unique(dim=0)) == 3  # cameras
        found = silhouettes(cubes_volume(model, cubes, turn, radius), model.box, *rays, 96)[0] > 0.5
        assert (found != (batch.silhouette[item] > 0)).float().mean() < 0.03

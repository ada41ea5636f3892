"""Questions as batches: images with their own lights, answers where they may be known."""

import math
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch
from h5_edits import put
from pix2shape_models import edited, question_source, released, suited, tiny
from refusals import refused
from torch.utils.data import default_collate

from baselines.pix2shape.network.surfels import render
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from scenegen.common.errors import FileFormatError, SpecError

SPEC = SplitSpec(
    seed=5, train=7, labeled=4, val=2, test=1, cubes=(5, 7), lights=(1, 3), height=64, width=64,
    min_cube_pixels=2, with_depth=True, image_dtype="float32", background=(0.9, 1.0, 0.8),
)  # fmt: skip
TINY = tiny(camera=False)
TRUTH = {
    "cube_count", "cubes", "shape_id", "class_id", "world_from_shape", "distractor_kind",
    "angle_degrees", "visible_pixels", "depth",
}  # fmt: skip


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a split of 3 + 4, 2 and 1 questions, 64x64."""
    folder = tmp_path_factory.mktemp("questions") / "split"
    make_split(folder, SPEC, command="tests")
    return folder


@pytest.fixture(scope="session")
def train_path(folder: Path) -> Path:
    return folder / "iqtt-train.h5"


def batch_of(source: Any) -> Any:
    return source.as_batch(default_collate([source[row] for row in range(len(source))]))


def scales(file: h5py.File) -> np.ndarray:
    """How many times larger each question is shown than it is stored, (Q,)."""
    distance = 64 / 62 * SPEC.max_radius / math.sin(math.radians(SPEC.fov_degrees) / 2)
    return distance / file["truth/unlabeled/camera_distance"][:]


def test_the_truth_shaded_with_what_is_told_is_the_image(train_path):
    """Where the neighbours lie in one plane, so that normals of the depth map are exact."""
    source = question_source(train_path, "unlabeled", TINY)
    batch = batch_of(source)
    with h5py.File(train_path) as file:
        depth = file["truth/unlabeled/depth"][:].astype(np.float64)
        depth = (depth * scales(file)[:, None, None, None]).reshape(12, 64, 64)
        expected = file["unlabeled/questions"][:].reshape(12, 64, 64, 3)
    behind = np.isnan(depth)
    colors = np.broadcast_to(batch.views.background[:, None, None].numpy(), expected.shape)
    np.testing.assert_allclose(expected[behind], colors[behind], rtol=1e-6)
    image = render(torch.tensor(np.where(behind, 15, depth)).float(), batch.views.scene)
    inverse = np.pad(1 / depth, ((0, 0), (1, 1), (1, 1)), constant_values=np.nan)
    flat = np.ones_like(behind)
    for i, j in ((0, 1), (1, 0), (1, 1), (1, -1)):
        ahead, back = np.roll(inverse, (i, j), (1, 2)), np.roll(inverse, (-i, -j), (1, 2))
        flat &= (np.abs(ahead + back - 2 * inverse) < 3e-8)[:, 1:-1, 1:-1]
    assert flat.sum() > 0.3 * (~behind).sum()
    difference = np.abs(np.moveaxis(image.numpy(), 1, -1) - expected)[flat]
    assert difference.max() < 2e-3
    assert np.ptp(expected[flat], axis=0).min() > 0.1, "not the ambient light alone"


def test_shapes_and_rotations_are_never_read(train_path, tmp_path):
    shutil.copy(train_path, tmp_path / "blank.h5")
    with h5py.File(tmp_path / "blank.h5", "r+") as file:
        truth = file["truth/labeled"]
        assert set(truth) - TRUTH == {
            "light_count",
            "light_position",
            "light_color",
            "camera_distance",
        }
        for name in TRUTH | {"light_count"}:
            truth[name][...] = 0
    blank = question_source(tmp_path / "blank.h5", "labeled", TINY)
    told = question_source(train_path, "labeled", TINY)
    for row in range(4):
        assert blank[row].keys() == told[row].keys()
        assert all(np.array_equal(blank[row][name], told[row][name]) for name in told[row])


def test_files_without_lights_are_refused(folder, tmp_path):
    test, plain = folder / "iqtt-test.h5", released(tmp_path / "released.h5", [0, 1, 2], size=64)
    for path in (test, plain):
        for call in (question_source, lambda path, part, config: suited(config, path, part)):
            with refused(SpecError, str(path), "questions without"):
                call(path, None, TINY)
    with refused(SpecError, "networks"):
        question_source(folder / "iqtt-val.h5", None, tiny())


def test_damaged_lights_are_refused(folder, tmp_path):
    path = edited(
        folder / "iqtt-val.h5", tmp_path / "bad.h5", put("truth/light_color", (1, 2), np.nan)
    )
    with refused(FileFormatError, f"{path}: row 1", "light_color"):
        question_source(path, None, TINY)


def test_the_polar_encoder_needs_a_white_background(train_path):
    """By which it tells shape from background; otherwise all pixels would count as shape."""
    with refused(SpecError, str(train_path)):
        suited(tiny(camera=False, encoder="polar"), train_path)

"""A small split of questions, and pictures of one object."""

from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="session")
def split(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a split of 4 + 5, 3 and 2 questions, 64x64."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec

    spec = SplitSpec(
        seed=5, train=9, labeled=4, val=3, test=2, cubes=(5, 7), lights=(1, 2), height=64,
        width=64, min_cube_pixels=2, with_depth=True,
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("questions") / "split"
    make_split(folder, spec, command="tests")
    return folder


@pytest.fixture(scope="session")
def one_box():
    """Return eight equal pictures of one box of the rasteriser, and its silhouette, (16, 16)."""
    from baselines.rezende.network import icosphere
    from baselines.rezende.rasteriser import Views, rasterise
    from baselines.rezende.training import Pictures
    from baselines.training.rotations import rotation_grid

    lights = np.tile([[[1.0, 2.0, 3.0]]], (8, 1, 1)), np.full((8, 1, 3), 2.5)
    views = Views(
        16, 28.0, 4.2, np.full(3, 0.75), np.full(3, 0.25), np.zeros(3), (0.0, 1.0), *lights
    )
    corners, faces = icosphere()
    box = 0.55 * corners / np.abs(corners).max(axis=1, keepdims=True)
    turned = np.tile(box @ rotation_grid(512)[100].T, (8, 1, 1))
    image, depth = rasterise(turned, faces, views)
    pictures = Pictures(np.moveaxis(image, 3, 1).copy(), 0.5, views, "box")
    return pictures, np.isfinite(depth[0])

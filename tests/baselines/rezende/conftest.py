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
    """Return eight equal pictures of one box, which scenegen rendered."""
    from baselines.rezende.images import Pictures
    from baselines.rezende.primitives import SIMPLE, render_primitives

    some = render_primitives("centred", 12, 16, seed=2)
    full = np.isfinite(some.depth).sum(axis=(1, 2))
    row = np.repeat(int(np.abs(full - np.median(full)).argmin()), 8)
    assert SIMPLE[0] == "box"
    return Pictures(some.image[row], some.radius, some.views_of(row), "box", some.depth[row])

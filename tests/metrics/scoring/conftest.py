"""Questions and answers to them, which several files of tests score."""

import pytest

from baselines.trivial import write_chance
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec


@pytest.fixture(scope="session")
def questions(tmp_path_factory):
    """A tiny split, and two runs of answers by chance."""
    made = tmp_path_factory.mktemp("questions")
    spec = SplitSpec(train=6, labeled=3, val=3, test=30, height=32, width=32, min_cube_pixels=1)
    make_split(made / "split", spec)
    for seed in range(2):
        write_chance(made / "split/iqtt-test.h5", made / f"chance-{seed}.h5", seed)
    return made

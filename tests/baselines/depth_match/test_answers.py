"""True depth answers hard questions, and the network's half of them; axes are scenegen's."""

from collections.abc import Iterable, Iterator

import numpy as np
import pytest
import torch

from baselines.depth_match.network import denials, least_denials, surface_points
from baselines.depth_match.training import read_pictures
from iqtt import QuestionsFile, SplitSpec, make_split, open_questions

KINDS = ("mirror-pair", pytest.param("matched", marks=pytest.mark.slow))
SIZE = 64


@pytest.fixture(scope="module", params=KINDS)
def questions(request, tmp_path_factory) -> Iterator[QuestionsFile]:
    folder = tmp_path_factory.mktemp("split")
    spec = SplitSpec(
        seed=3, train=8, labeled=8, val=0, test=0, distractors=request.param, height=SIZE,
        width=SIZE, min_cube_pixels=8, with_depth=True,
    )  # fmt: skip
    make_split(folder, spec)
    with open_questions(folder / "iqtt-train.h5", "labeled") as file:
        yield file


def true_depth(questions: QuestionsFile) -> torch.Tensor:
    """Return the depth of all pictures in camera distances, (Q, 1 + K, S, S)."""
    height = read_pictures([questions], SIZE).height.float()
    depth = torch.where(height.isfinite(), 1 - height, torch.inf)
    return depth.view(len(questions), -1, SIZE, SIZE)


def test_true_depth_answers_hard_questions(questions):
    assert right(true_depth(questions), questions) >= 7


def right(depth: Iterable[torch.Tensor], questions: QuestionsFile) -> int:
    """Return how many of the questions these surfaces answer right."""
    chosen = [int(least_denials(maps, 28.0).argmin()) for maps in depth]
    return int((np.array(chosen) == questions.read("answers", slice(None))).sum())


def test_surfaces_lie_where_the_camera_sees_them(questions):
    """The true rotation of a picture takes its points onto faces of cubes, in cube edges."""
    half = float(np.tan(np.radians(14.0)))
    for row, depth in enumerate(true_depth(questions)[:3]):
        distance = float(questions.read("camera_distance", row))
        count = int(questions.read("cube_count", row))
        points = surface_points(depth[0], half).numpy() * distance
        cubes = questions.read("cubes", row)[0, :count]
        middle = (cubes.min(axis=0) + cubes.max(axis=0) + 1) / 2
        own = points @ questions.read("world_from_shape", row)[0] + middle
        off = np.abs(own - np.round(own)).min(axis=1)
        assert np.median(off) < 0.01
        assert (off < 0.1).mean() > 0.9
        assert denials(torch.from_numpy(points).float() / distance, torch.eye(3)[None],
                       depth[0], half) < 2e-3  # fmt: skip

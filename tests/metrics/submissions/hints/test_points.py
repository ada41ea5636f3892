"""Hints on points: for axes, frames and fields of view that are wrong, and for nothing else."""

import numpy as np
import pytest

from metrics.prediction_writer import RoomPredictionWriter
from metrics.submissions.validation import validate
from scenegen.camera import back_project
from scenegen.rooms.reader import RoomsFile


def told(truth, path, made, alignment="none", noise=0.01):
    """What is said of points made of the true ones (H, W, 3), the pose and a generator."""
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="m", alignment=alignment) as out,
    ):
        for row, room in enumerate(rooms):
            rng = np.random.default_rng(row)
            points = np.nan_to_num(back_project(room.depth, room.fov_y_degrees))
            points = points * (1.0 + noise * rng.standard_normal((*points.shape[:2], 1)))
            out.add(row, points=made(points, room.world_from_camera, rng))
    return [p.found for p in validate(path, truth) if p.is_hint and p.dataset == "points"]


def in_world(points, pose):
    return points @ pose[:3, :3].T + pose[:3, 3]


MISTAKES = {
    "mirrored": (lambda p, *_: p * [-1, 1, 1], "x axis flipped"),
    "swapped": (lambda p, *_: p[..., [1, 0, 2]], "y, x, z"),
    "doubled": (lambda p, *_: p * [2, 2, 1], "another field of view"),
    "narrow": (lambda p, *_: p * [0.8, 0.8, 1], "another field of view"),
    "world of OpenCV": (lambda p, pose, _: in_world(p, pose) * [1, -1, -1], "world frame"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes(rooms_path, tmp_path, name):
    made, words = MISTAKES[name]
    off, looks = told(rooms_path, tmp_path / "p.h5", made)
    assert "pixels" in off
    assert words in looks


@pytest.mark.parametrize("alignment", ["none", "scale", "scale_shift"])
def test_points_on_their_rays_get_no_hint(rooms_path, tmp_path, alignment):
    factor = 1.0 if alignment == "none" else 3.0
    shift = np.array([0.5, -0.2, -1.0]) * (alignment == "scale_shift")
    assert told(rooms_path, tmp_path / "p.h5", lambda p, *_: factor * p + shift, alignment) == []


def test_points_that_nothing_explains_are_only_off_their_rays(rooms_path, tmp_path):
    def on_the_axis(p, *_):
        return p * [0, 0, 1]

    for made in (on_the_axis, lambda p, _, rng: rng.normal(size=p.shape) - [0, 0, 5]):
        (off,) = told(rooms_path, tmp_path / f"{made.__name__}.h5", made)
        assert "pixels" in off

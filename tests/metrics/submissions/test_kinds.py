"""Kinds of geometry in submissions: written, read, held against the rules, and scored."""

import h5py
import numpy as np
import pytest
import torch
from h5_edits import attribute
from refusals import refused

from metrics.prediction_writer import PredictionError, RoomPredictionWriter
from metrics.scoring.evaluate import score
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile

# From the true depth and points (camera frame) to what a method of that kind gives.
GEOMETRY = {
    "depth": lambda depth, points: depth,
    "disparity": lambda depth, points: 3.0 / depth - 0.5,
    "points": lambda depth, points: 2.5 * points - [0.3, 0.1, 0.7],
}
ALIGNMENTS = {"depth": "none", "disparity": "scale_shift", "points": "scale_shift"}


def written(kind, truth, path, make=None, **settings):
    make = make or GEOMETRY[kind]
    settings = {"method": "m", "alignment": ALIGNMENTS[kind], **settings}
    with RoomsFile(truth) as rooms, RoomPredictionWriter(path, truth, **settings) as out:
        for room in rooms:
            out.add(room.index, **{kind: make(room.depth, room.points)}, fov_y_degrees=40.0)
    return path


@pytest.mark.parametrize("kind", GEOMETRY)
def test_a_kind_comes_back_and_is_scored_as_what_it_is(kind, truths, tmp_path):
    """The truth under the transformation that its kind leaves open scores as the truth."""
    path = written(kind, truths.rooms, tmp_path / "p.h5")
    with open_predictions(path) as found, RoomsFile(truths.rooms) as rooms:
        assert (found.kind, found.alignment, found.height) == (kind, ALIGNMENTS[kind], 32)
        view = found.view(3)
        expected = GEOMETRY[kind](rooms[3].depth, rooms[3].points)
        assert np.array_equal(view.geometry, expected.astype("f4"))
        assert (view.kind, view.normal, view.fov_y_degrees) == (kind, None, 40.0)
        if kind == "points":
            assert np.array_equal(found.depth(3), -view.geometry[..., 2])
    assert validate(path, truths.rooms) == []
    scores = score([path], truths.rooms).metrics
    assert scores["chamfer"].value < 1e-5
    assert scores["relief_iou"].value > 0.999


POINTS = np.dstack([np.zeros((32, 32)), np.zeros((32, 32)), np.full((32, 32), -2.0)])
DEPTH = np.full((32, 32), 2.0)


@pytest.mark.parametrize(
    ("alignment", "rows", "where"),
    [
        ("none", [{}], "row 0: geometry"),
        ("none", [{"depth": DEPTH, "points": POINTS}], "row 0: geometry"),
        ("none", [{"depth": DEPTH}, {"points": POINTS}], "row 1: depth"),
        ("scale", [{"disparity": DEPTH}], "row 0: alignment"),
        ("median_scale", [{"points": POINTS}], "row 0: alignment"),
        ("none", [{"points": -POINTS}], "row 0: points"),
        (None, [{"disparity": np.where(np.eye(32), np.nan, DEPTH)}], "row 0: disparity"),
        ("none", [{"depth": DEPTH, "fov_y_degrees": 180.0}], "row 0: fov_y_degrees"),
        ("none", [{"depth": DEPTH, "fov_y_degrees": 4.0}, {"depth": DEPTH}], "1: fov_y_degrees"),
    ],
)
def test_the_writer_refuses(alignment, rows, where, truths, tmp_path):
    with (
        refused(PredictionError, where),
        RoomPredictionWriter(tmp_path / "p.h5", truths.rooms, method="m", alignment=alignment) as o,
    ):
        for row, values in enumerate(rows):
            o.add(row, **values)
    assert list(tmp_path.iterdir()) == []


def beside(file):
    file["disparity"] = file["depth"][()]


def far_view(file):
    file["fov_y_degrees"][2] = 200.0


@pytest.mark.parametrize(
    ("kind", "edit", "dataset", "rule"),
    [
        ("depth", beside, "disparity", "unique"),
        ("depth", far_view, "fov_y_degrees", "range"),
        ("disparity", attribute("alignment", "scale"), "alignment", "value"),
    ],
)
def test_the_reader_refuses(kind, edit, dataset, rule, truths, tmp_path):
    path = written(kind, truths.rooms, tmp_path / "p.h5")
    with h5py.File(path, "r+") as file:
        edit(file)
    problem = validate(path, truths.rooms)[0]
    assert (problem.dataset, problem.rule) == (dataset, rule)
    with refused(FileFormatError, dataset):
        open_predictions(path)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16, torch.float16])
def test_tensors_are_arrays(dtype, truths, tmp_path):
    """On the graph of a gradient, too, and in a type that NumPy lacks."""
    make = lambda depth, _: torch.full(depth.shape, 1.5, dtype=dtype, requires_grad=True)  # noqa: E731
    path = written("depth", truths.rooms, tmp_path / "p.h5", make)
    with open_predictions(path) as found:
        assert (found.depth(0) == 1.5).all()

"""Scores in memory are those of the command, to the last bit."""

import numpy as np
import pytest
import torch
from refusals import refused

import metrics
from metrics.prediction_writer import PredictionError, RoomPredictionWriter
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from scenegen.common.errors import SceneGenError
from scenegen.rooms.reader import RoomsFile

OPENCV = np.array([1.0, -1.0, -1.0])
KINDS = {
    "depth": ("none", lambda room: 1.1 * room.depth + 0.07),
    "disparity": ("scale_shift", lambda room: 2 / room.depth - 0.1),
    "points": ("scale", lambda room: 3 * room.points + [0.1, 0.0, -0.2]),
}


@pytest.fixture
def rooms(truths):
    with RoomsFile(truths.rooms) as file:
        yield file


@pytest.mark.parametrize(
    ("kind", "form"),
    [
        *(("depth", form) for form in ("arrays", "tensors", "dicts")),
        *(("disparity", "dicts"), ("points", "arrays"), ("points", "dicts")),
    ],
)
def test_exactly_equal_to_the_command(kind, form, rooms, tmp_path):
    alignment, make = KINDS[kind]
    noise = np.random.default_rng(0)
    made = [make(room) * (1 + 0.01 * noise.random((32, 32, *[1] * (kind == "points"))))
            for room in rooms]  # fmt: skip
    normals = [room.normal + 0.1 for room in rooms]
    with RoomPredictionWriter(
        tmp_path / "p.h5", rooms.path, method="in memory", alignment=alignment
    ) as out:
        for row, values in enumerate(made):
            out.add(row, normal=normals[row], **{kind: values})
    expected = score([tmp_path / "p.h5"], rooms.path)
    how = {"kind": kind, "alignment": alignment, "frame": "opengl"}
    given = made
    if form == "tensors":
        given = [torch.tensor(values, requires_grad=True) for values in made]
        normals = torch.tensor(np.stack(normals))
    if form == "dicts":
        key = {"disparity": "disparity_affine_invariant", "points": "points_scale_invariant"}
        given = [
            {key.get(kind, "depth_metric"): values * (OPENCV if kind == "points" else 1),
             "normal": normal * OPENCV}
            for values, normal in zip(made, normals, strict=True)
        ]  # fmt: skip
        how = {}
    beside = {} if form == "dicts" else {"normals": normals}
    got = metrics.evaluate(iter(given), rooms, **how, **beside)
    assert got.metrics == expected.metrics
    assert got.skills == expected.skills
    assert (got.alignment, got.comparable) == (expected.alignment, True)
    for name, column in expected.columns.items():
        assert np.array_equal(got.columns[name], column, equal_nan=True), name
    for row in (0, 5):
        one = {} if form == "dicts" else {"normal": normals[row]}
        alone = metrics.evaluate_room(given[row], rooms[row], **how, **one)
        names = {n for n, c in expected.items.items() if c.dtype == float} - {"view_angle_degrees"}
        assert set(alone) == {name for name in names if not name.startswith("other_scene_")}
        for name, value in alone.items():
            assert np.array_equal(value, expected.items[name][row], equal_nan=True), name


def test_some_rows(rooms):
    scores = metrics.evaluate([rooms[5].depth, rooms[2].depth], rooms, items=[5, 2])
    assert scores.ids.tolist() == [2, 5]
    assert scores.metrics["mse_depth"].value == 0.0
    assert not scores.comparable


def test_values_that_are_not_finite(rooms):
    bad = np.where(np.eye(32), np.nan, rooms[0].depth)
    for values in (bad, -rooms[0].depth):
        with pytest.raises(PredictionError):
            metrics.evaluate_room(values, rooms[0])
    penalised = metrics.evaluate_room(bad, rooms[0], non_finite="penalise")
    assert penalised["relief_iou"] == 0.0
    depth = [bad, *(room.depth for room in rooms[1:])]
    with refused(SceneGenError, found="NaN"):
        metrics.evaluate(depth, rooms)
    assert not metrics.evaluate(depth, rooms, settings=Settings(non_finite="penalise")).comparable


@pytest.mark.parametrize(
    ("predictions", "how", "where"),
    [
        ([], {}, "predictions"),
        (np.ones((7, 32, 32)), {}, "predictions"),
        (np.ones((9, 32, 32)), {}, "predictions"),
        (np.ones((2, 32, 32)), {"items": [0, 0]}, "items"),
        (np.ones((1, 32, 32)), {"items": [8]}, "items"),
        ([None] * 8, {}, "row 0: depth"),
        (-np.ones((8, 32, 32)), {}, "row 0: depth"),
        (np.ones((8, 32, 32, 3)), {"kind": "points", "frame": "opengl"}, "row 0: points"),
        (["far"] * 8, {}, "row 0: depth"),
        ([{}] * 8, {}, "row 0: returned"),
        (np.ones((8, 32, 32, 3)), {}, "row 0: depth"),
        (np.ones((8, 32, 32)), {"kind": "distance"}, "kind"),
        (np.ones((8, 32, 32)), {"kind": "disparity", "alignment": "none"}, "alignment"),
        ([np.ones((32, 32)), *[{"depth_scale_invariant": np.ones((32, 32))}] * 7], {}, "row 1"),
        (np.ones((8, 32, 32)), {"normals": np.ones((7, 32, 32, 3))}, "predictions"),
    ],
)
def test_what_cannot_be_scored(predictions, how, where, rooms):
    with refused(SceneGenError, where):
        metrics.evaluate(predictions, rooms, **how)

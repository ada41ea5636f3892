"""Numbers that stand for "no value" are told, wherever a submission is read."""

import numpy as np
import pytest

from metrics.prediction_writer import RoomPredictionWriter
from metrics.submissions.hints.no_value import no_value_mark
from metrics.submissions.validation import validate
from scenegen.rooms.reader import RoomsFile


def marks(path):
    """What hints say of marks in a submission."""
    return [p for p in validate(path, None) if p.is_hint and "--invalid" in p.found]


def submission(truth, path, holes, value, kind="depth", alignment="none"):
    """The truth, with a value at some pixels of every row."""
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="m", alignment=alignment) as out,
    ):
        for row, room in enumerate(rooms):
            image = room.points if kind == "points" else room.depth.astype(float)
            image = 1 / image if kind == "disparity" else image
            image.reshape(image.shape[0] * image.shape[1], -1)[holes] = value
            out.add(row, **{kind: image})
    return path


SOME, ONE = slice(40, 80), slice(7, 8)


@pytest.mark.parametrize(
    ("value", "holes", "kind", "alignment"),
    [
        (1e10, SOME, "depth", "none"),
        (1e10, ONE, "depth", "none"),
        (65504.0, SOME, "depth", "scale"),
        (65.535, SOME, "depth", "none"),
        (3.4e38, ONE, "depth", "scale_shift"),
        (1e10, slice(0, 1000), "depth", "none"),  # nearly all
        (0.0, ONE, "depth", "median_scale"),
        (-1.0, SOME, "depth", "none"),
        (1e10, SOME, "disparity", "scale_shift"),
        ((0.0, 0.0, -1e10), SOME, "points", "none"),
        (0.0, SOME, "points", "scale"),
    ],
)
def test_a_mark_is_told(value, holes, kind, alignment, truths, tmp_path):
    path = submission(truths.rooms, tmp_path / "p.h5", holes, value, kind, alignment)
    (hint,) = marks(path)
    assert hint.dataset == kind
    assert len(hint.ids) == 5


def test_where_the_truth_has_no_surface_anything_may_stand(make_rooms, tmp_path):
    truth = make_rooms(tmp_path / "x.h5", 4, fov_degrees=60.0)
    with RoomsFile(truth) as rooms:
        depth = rooms.read("depth", slice(None))
    assert np.isnan(depth).any()
    for value, told in ((1e10, 0), (np.inf, 0)):
        with RoomPredictionWriter(tmp_path / f"{value}.h5", truth, method="m") as out:
            for row, image in enumerate(depth):
                out.add(row, depth=np.where(np.isnan(image), value, image))
        assert len(marks(tmp_path / f"{value}.h5")) == told


def test_no_mark_in_what_methods_predict(room_arrays):
    depth, *_ = room_arrays
    rng = np.random.default_rng(0)
    made = [
        depth, 65504 * depth, 1e-3 * depth, depth + rng.normal(size=depth.shape),
        np.maximum(depth, 1.5), np.minimum(depth, 1.5), np.exp(3 * rng.normal(size=depth.shape)),
        np.full(depth.shape, 80.0), np.where(depth > 1.6, 2.0, 1.2), rng.random(depth.shape),
    ]  # fmt: skip
    for images in made:
        assert [no_value_mark(image[~np.isnan(image)], True) for image in images] == [None] * 16
    shifted = [depth - 1.5, -1 / depth, np.maximum(depth - 1.5, 0)]
    for images in shifted:
        assert [no_value_mark(image[~np.isnan(image)], False) for image in images] == [None] * 16

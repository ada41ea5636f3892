"""Objects, relief and skill: independent computations, guesses that must not win, empty rooms."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from h5_edits import replaced
from made_scores import rooms_scores

from baselines.trivial import write_room_baseline
from metrics.measures.relief import empty_room
from metrics.prediction_writer import RoomPredictionWriter
from metrics.score_file import read_scores, write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.images.geometry import depth_as_scored
from metrics.scoring.images.image_scores import (
    FirstView,
    _guesses,
    reference_of,
    score_prediction,
    true_relief,
)
from metrics.scoring.images.rows import other_scenes
from metrics.scoring.metric_names import CUT_OUT, EMPTY_ROOM, LEANING, SKILLED, metric
from metrics.scoring.runs import Settings
from metrics.submissions.reader import PredictedView
from metrics.submissions.truths import TrueView
from scenegen.camera import back_project
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile


@pytest.fixture(scope="module")
def folder(tmp_path_factory, rooms_path):
    """Rooms (8 of them), and submissions for them."""
    made = tmp_path_factory.mktemp("images")
    rng = np.random.default_rng(0)
    (made / "rooms.h5").symlink_to(rooms_path)
    write_room_baseline("empty-room", rooms_path, made / "empty-room.h5")
    with (
        RoomsFile(rooms_path) as rooms,
        RoomPredictionWriter(made / "noisy-0.h5", rooms_path, method="noisy") as out,
    ):
        for row in rng.permutation(len(rooms)).tolist():
            out.add(row, rooms[row].depth * rng.uniform(0.9, 1.1, rooms[row].depth.shape))
    return made


def test_the_empty_room_has_no_relief_and_no_skill(folder):
    """Nor one that was rounded to half precision, or moved away."""
    found = score([folder / "empty-room.h5"], folder / "rooms.h5")
    assert found.metrics["relief_iou"].value == 0.0
    assert abs(found.metrics["relief_correlation"].value) < 1e-5
    alone = [name for name, begins in SKILLED.items() if begins == (EMPTY_ROOM,)]
    for name in found.skills.keys() & {*alone, "relief_iou", "relief_correlation"}:
        skill = found.skills[name]
        assert (skill.value, skill.low, skill.high) == (pytest.approx(0.0, abs=1e-5),) * 3, name


def guess(path, truth, depth_of):
    """A submission whose depth is made of that of the empty room; nobody looked at any image."""
    with RoomsFile(truth) as rooms, RoomPredictionWriter(path, truth, method="guess") as out:
        size = rooms.spec.height, rooms.spec.width
        for row, room in enumerate(rooms):
            depth, _ = empty_room(room.world_from_camera, room.fov_y_degrees, *size)
            out.add(row, depth_of(depth))
    return score([path], truth)


@pytest.mark.parametrize(
    "depth_of",
    [
        lambda depth: depth + np.random.default_rng(0).normal(0.0, 1e-6, depth.shape),
        lambda depth: depth - 0.1,
        lambda depth: depth - np.linspace(0.0, 0.3, len(depth))[:, None],
    ],
    ids=["noise", "lifted", "ramp"],
)
def test_guesses_without_a_look_at_the_picture_do_not_win(folder, tmp_path, depth_of):
    found = guess(tmp_path / "g.h5", folder / "rooms.h5", depth_of)
    for name in ("relief_correlation", "relief_iou"):
        assert found.metrics[name].value < 0.45
        assert found.skills[name].value < 0.1


def test_one_relief_for_all_pictures_has_no_skill_at_all(folder, tmp_path):
    """The mean relief of this very test set, which wins error of depth and raw scores of relief.

    Going against it scores below 0 with every scene, and a floor below 0 must not lift that.
    """
    with RoomsFile(folder / "rooms.h5") as rooms:
        reliefs = [true_relief(r.depth, r.world_from_camera, r.fov_y_degrees) for r in rooms]
    mean = np.nan_to_num(reliefs).mean(axis=0)
    found = guess(tmp_path / "g.h5", folder / "rooms.h5", lambda depth: depth - mean)
    assert found.skills["mse_depth"].value > 0.05
    assert found.metrics["relief_correlation"].value > 0.3
    for name in ("relief_correlation", "relief_iou"):
        assert found.skills[name].value == pytest.approx(0.0, abs=0.02)
    against = guess(tmp_path / "a.h5", folder / "rooms.h5", lambda depth: depth + mean)
    write_scores(against, tmp_path / "s")
    found = read_scores(tmp_path / "s")
    skill, value = found.skills["relief_correlation"], found.metrics["relief_correlation"].value
    assert found.items["other_scene_relief_correlation"].mean() < -0.2
    assert (skill.floor, skill.value) == (0.0, value)
    assert value < -0.2


def test_true_outlines_without_any_shape_win_relief_but_find_no_object(make_rooms, tmp_path):
    """What relief cannot tell, as docs/scores.md says: flat outlines from shapes."""
    path, truth = tmp_path / "flat.h5", make_rooms(tmp_path / "r.h5", 8, height=64, width=64)
    with RoomsFile(truth) as rooms, RoomPredictionWriter(path, truth, method="flat") as out:
        for row, room in enumerate(rooms):
            size = room.depth.shape
            depth, _ = empty_room(room.world_from_camera, room.fov_y_degrees, *size)
            out.add(row, depth - 0.2 * (room.object_id > 0))
    found = score([path], truth)
    assert found.skills["relief_iou"].value > 0.5
    assert found.metrics["object_recall_0.02"].value < 0.2
    assert found.metrics["derived_object_normal_mean_degrees"].value > 40.0


def scored(baseline, truth, folder):
    """Return the scores of a baseline as they are read back from their file."""
    write_room_baseline(baseline, truth, folder / "p.h5")
    write_scores(score([folder / "p.h5"], truth), folder / "s.json")
    return read_scores(folder / "s.json")


def test_rooms_without_objects_have_no_such_scores(make_rooms, tmp_path):
    truth = make_rooms(tmp_path / "bare.h5", 3, objects=(0, 0))
    found = scored("empty-room", truth, tmp_path)
    assert {metric(name).lacking for name in found.metrics} <= {"", "boundary", "planes", "order"}
    assert found.metrics["chamfer"].value < 1e-5
    assert (dict(found.skills), dict(found.by_object_shape)) == ({}, {})
    assert len(found.objects["row"]) == 0
    assert np.isnan(found.items["relief_iou"]).all()


def test_rows_without_objects_are_left_out_and_counted(folder, make_rooms, tmp_path):
    truth = make_rooms(tmp_path / "some.h5", 8, objects=(0, 1), seed=5)
    found = scored("oracle", truth, tmp_path)
    bare = 8 - len(np.unique(found.objects["row"]))
    assert 0 < bare < 8
    assert np.isnan(found.items["object_recall_0.02"]).sum() == bare
    for name in ("object_recall_0.02", "relief_iou", "relief_correlation"):
        assert (found.metrics[name].value, found.metrics[name].n) == (1.0, 8 - bare)
    assert found.metrics["chamfer"].n == 8


def test_an_image_with_a_value_that_is_not_finite_has_the_worst_scores(folder, tmp_path):
    """At the camera it would stand far before the empty room, or near what it should be."""
    path = tmp_path / "holes.h5"
    with RoomsFile(folder / "rooms.h5") as rooms, h5py.File(folder / "empty-room.h5") as file:
        ids = np.stack([room.object_id for room in rooms])[file["row"][:]]
        path.write_bytes((folder / "empty-room.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        replaced("depth", lambda depth: np.where(ids > 0, np.nan, depth))(file)
    found = score([path], folder / "rooms.h5", Settings(non_finite="penalise"))
    holes = found.items["relief_iou"] == 0.0
    assert holes.any()
    for name in found.metrics:
        values = found.items[name][holes]
        assert (values[np.isfinite(values)] == metric(name).worst()).all(), name
    assert set(
        found.objects["object_depth_error"][np.isin(found.objects["row"], np.flatnonzero(holes))]
    ) == {4.0}
    assert found.skills["object_depth_error"].value < 0.0
    assert not found.comparable


def test_every_row_serves_once_as_that_of_another_scene():
    scene = np.array([4, 4, 4, 9, 9, 9, 2, 2, 2])
    view = np.array([0, 1, 2] * 3)
    found = other_scenes(scene, view)
    assert sorted(found) == list(range(9))
    assert (scene[found] != scene).all()
    assert (view[found] == view).all()
    assert scene[found].tolist() == [9, 9, 9, 2, 2, 2, 4, 4, 4]
    lonely = other_scenes(np.array([4, 4, 9, 9, 2]), np.array([0, 1, 0, 3, 0]))
    assert lonely.tolist() == [2, 3, 4, 1, 0]
    assert other_scenes(np.zeros(3, int), np.arange(3)).tolist() == [0, 1, 2]
    alone = other_scenes(np.array([4, 4, 9, 9, 4]), np.array([0, 1, 0, 1, 7]))
    assert alone.tolist() == [2, 3, 0, 1, 4], "a row without a partner takes none from the others"
    uneven = np.array([4, 4, 9, 9])
    assert (uneven[other_scenes(uneven, np.arange(4))] != uneven).all()


def test_an_image_without_a_plane_has_no_score_of_derived_normals(folder):
    with RoomsFile(folder / "rooms.h5") as rooms:
        room = rooms[0]
    row = np.zeros(room.depth.shape, bool)
    row[len(row) // 2] = True  # rounding alone would choose a side of its planes
    camera = room.lens, room.world_from_camera
    depth = np.where(row, room.depth, np.nan)
    view = TrueView(depth, room.normal, np.where(row, room.object_id, -1), *camera)
    same = PredictedView("depth", "none", np.nan_to_num(depth, nan=1.0).astype(float), None)
    found = score_prediction(same, view, reference_of(view)).scores
    derived = [value for name, value in found.items() if name.startswith("derived_normal")]
    assert derived
    assert np.isnan(derived).all()
    assert found["rmse"] == 0.0


def test_a_row_without_a_partner_is_left_out_of_the_skill_of_relief(tmp_path):
    other = [0.1, 0.1, 0.1, np.nan]
    columns = {"relief_iou": [0.5] * 4, "other_scene_relief_iou": other}
    columns |= {"object_depth_error": [0.1] * 4, "empty_room_object_depth_error": [0.2] * 4}
    file = rooms_scores("m", columns, range(4))
    write_scores(file, tmp_path / "m.json")
    found = read_scores(tmp_path / "m.json")
    assert found.skills["relief_iou"].value == pytest.approx(0.4 / 0.9)


def test_the_scores_of_one_scene_have_no_skill_of_relief(make_rooms, tmp_path):
    truth = make_rooms(tmp_path / "one.h5", 1, views=(0.0, 35.0))
    found = scored("empty-room", truth, tmp_path)
    assert "relief_iou" not in found.skills
    assert found.skills["chamfer"].low is None


@pytest.mark.parametrize("value", [-1, 99])
def test_a_truth_whose_objects_have_no_shape_is_refused(folder, tmp_path, value):
    truth = tmp_path / "rooms.h5"
    truth.write_bytes((folder / "rooms.h5").read_bytes())
    with h5py.File(truth, "r+") as file:
        file["object/shape"][3] = value
    with pytest.raises(FileFormatError) as caught:
        score([folder / "noisy-0.h5"], truth)
    assert caught.value.where == f"{truth}: object/shape, row 3"
    assert "no shape" in caught.value.found


@pytest.fixture(scope="module")
def closed(interior_path):
    """The view of a closed room, and the depth of its walls."""
    with RoomsFile(interior_path) as rooms:
        room, size = rooms[0], np.asarray(rooms.room_size(0), float)
    names = ("depth", "normal", "object_id", "lens", "world_from_camera")
    view = TrueView(*(getattr(room, name) for name in names), size)
    empty, _ = empty_room(view.world_from_camera, view.lens, *view.depth.shape, size)
    return view, empty


def test_leaning_cut_outs_lean_half_as_much_as_the_walls(closed):
    view, empty = closed
    first = FirstView(view.depth, view.object_id, view.world_from_camera)
    guesses = _guesses(view, empty, view.object_id > 0, first)
    lean = guesses[LEANING] - guesses[CUT_OUT]
    for number in np.unique(view.object_id[view.object_id > 0]):
        own = view.object_id == number
        assert lean[own] == pytest.approx((empty[own] - np.median(empty[own])) / 2.0)
    assert np.ptp(lean) > 0.1


def test_true_points_of_a_closed_room_are_perfect_and_the_worst_are_as_far_as_it(closed):
    view, _ = closed
    points = back_project(np.nan_to_num(view.depth, nan=1.0), view.lens)
    pose = view.world_from_camera.copy()
    pose[:3, 3] *= 10.0
    far = replace(
        view, depth=10.0 * view.depth, world_from_camera=pose, room_size=10.0 * view.room_size
    )
    for name, truth, value, expected in (
        ("relief_correlation", view, points, 1.0),
        ("chamfer", view, points, 0.0),
        ("chamfer", far, np.full_like(points, np.nan), np.nanmax(far.depth)),
    ):
        predicted = PredictedView("points", "none", value, None, None)
        scores = score_prediction(predicted, truth, reference_of(truth), None, "penalise").scores
        assert scores[name] == pytest.approx(expected, abs=1e-6), name


def test_where_nothing_stands_out_in_another_scene_nothing_of_it_is_found(closed):
    view, _ = closed
    depth = PredictedView("depth", "none", np.nan_to_num(view.depth, nan=1.0), None)
    scores = score_prediction(depth, view, reference_of(view), np.zeros_like(view.depth)).scores
    assert scores["relief_iou"] == 1.0
    assert scores["other_scene_relief_iou"] == scores["other_scene_relief_correlation"] == 0.0


TRUE = np.random.default_rng(0).uniform(1, 2, (6, 7))
POINTS = back_project(TRUE, 40.0)


@pytest.mark.parametrize(
    ("kind", "alignment", "geometry"),
    [
        ("depth", "none", TRUE),
        ("depth", "scale", 3 * TRUE),
        ("depth", "scale_shift", 3 * TRUE - 1),
        ("points", "scale_shift", 3 * POINTS - 1),
        ("disparity", "scale_shift", 5 / TRUE - 2),
    ],
)
def test_depth_is_fitted_where_both_are_known(kind, alignment, geometry):
    hole = np.array(geometry)
    hole[2, 3] = np.nan
    true = np.where(np.eye(6, 7), np.nan, TRUE)
    seen = depth_as_scored(PredictedView(kind, alignment, hole, None), true, 40.0)
    known = np.isfinite(true)
    known[2, 3] = False
    np.testing.assert_allclose(seen[known], TRUE[known], rtol=1e-9)
    assert np.isnan(seen[2, 3])


def test_nothing_to_fit():
    nothing = np.full((2, 2), np.nan)
    view = PredictedView("depth", "scale", nothing, None)
    assert np.isnan(depth_as_scored(view, np.ones((2, 2)), 40.0)).all()

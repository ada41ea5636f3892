"""Predictions in recordings: which scenes, in which orders, where, and in which colours."""

from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from submissions import good_answers, good_rooms

pytest.importorskip("rerun")

from recordings import pixels_of, points_of, recorded

from metrics.prediction_writer import RoomPredictionWriter
from metrics.score_file import write_scores
from metrics.scoring.evaluate import open_runs, score, score_runs
from metrics.scoring.runs import ScoringError, Settings
from metrics.submissions.reader import open_predictions
from metrics.viewing import predicted_scenes, require_rooms, scores_of, worst_first
from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.viewing import error_colors, write_recording

NAN = float("nan")
PARTIAL = Settings(allow_partial=True, non_finite="penalise", resamples=100)
WORST = 5
FACTORS = {3: 1.001, WORST: 1.1, 6: 1.02}  # of the true depth, by row; WORST is written second


def test_the_worst_come_first():
    items = {"chamfer": np.array([0.1, 0.5, 0.4, 0.4, 0.2, 0.2]),
             "relief_iou": np.array([0.1, 0.5, 0.4, 0.4, NAN, 0.2])}  # fmt: skip
    scores, scenes = SimpleNamespace(ids=np.arange(6), items=items), [(0, 1), (2, 3), (4,), (5,)]
    in_order = worst_first(scores, "chamfer", scenes)
    assert in_order == [(2, 3), (0, 1), (4,), (5,)], "by means; equals in their order"
    assert worst_first(scores, "relief_iou", scenes) == [(5,), (0, 1), (2, 3), (4,)]


@pytest.fixture(params=["depth", "points"])
def predicted(request, truths, tmp_path):
    """A submission of three rows, whose worst has three pixels without a depth."""
    path, kind = tmp_path / "p.h5", request.param
    with open_rooms(truths.rooms) as rooms:
        with RoomPredictionWriter(path, truths.rooms, method="m", allow_partial=True) as out:
            for row, factor in sorted(FACTORS.items(), reverse=True):
                room = rooms[row]
                out.add(row, normal=2 * room.normal, **{kind: getattr(room, kind) * factor})
        with h5py.File(path, "r+") as file:
            file[kind][1, 0, :3] = np.nan
        yield rooms, path


def test_predictions_are_recorded_beside_the_truth(predicted, truths, tmp_path):
    rooms, path = predicted
    with open_runs([path], truths.rooms) as runs:
        scores = score_runs(runs, PARTIAL, lambda done: None)
        scenes = predicted_scenes(runs.files[0], rooms, scores)
        assert write_recording(tmp_path / "x.rrd", "x", scenes) == len(FACTORS)
    by_score, by_scene = (recorded(tmp_path / "x.rrd", t) for t in ("worst AbsRel first", "scene"))
    index = {row: rooms[row].scene.index for row in FACTORS}
    assert sorted(by_scene["/about"]) == sorted(index.values())
    order = sorted(FACTORS, key=FACTORS.get, reverse=True)
    for place, row in enumerate(order):
        room, step = rooms[row], index[row]
        view, shape = f"view_{room.view_index}", room.depth.shape
        there = {name: values[step] for name, values in by_scene.items() if step in values}
        assert by_score["/about"][place] == there["/about"]
        absent = 3 if row == WORST else 0
        points, colors = points_of(there[f"/world/prediction/{view}"])
        eye = room.world_from_camera[:3, 3]
        expected = eye + FACTORS[row] * (room.points_world.reshape(-1, 3) - eye)
        np.testing.assert_allclose(points, expected[absent:], atol=1e-5)
        error = (FACTORS[row] - 1) * room.depth
        off = colors[:, :3].astype(int) - error_colors(error.reshape(-1)[absent:])
        assert np.abs(off).max() <= 2
        pixels = there[f"/pixels/{view}/prediction_depth"]
        depth = pixels_of(pixels, "DepthImage", np.float32, shape).ravel()
        np.testing.assert_allclose(depth[absent:], (room.depth + error).ravel()[absent:], rtol=1e-5)
        assert np.isnan(depth[:absent]).all()
        text = there["/about"]["TextDocument:text"][0]
        assert f"| pixels without a point | {absent} |" in text
        truth, _ = points_of(there[f"/world/truth/{view}"])
        moved = np.array(there["/world/prediction"]["Transform3D:translation"][0])
        right = room.world_from_camera[:3, 0]
        assert np.linalg.norm(np.cross(moved, right)) < 1e-6
        assert moved @ right == pytest.approx(1.1 * np.ptp(truth @ right), rel=1e-4)
        normals = [there[f"/pixels/{view}/{side}_normal"] for side in ("truth", "prediction")]
        first, second = (pixels_of(n, "Image", np.uint8, (*shape, 3)).astype(int) for n in normals)
        assert np.abs(first - second).max() <= 1, "predicted ones are made unit"


def test_only_rows_and_scores_of_the_submission_are_shown(predicted, truths, tmp_path):
    rooms, path = predicted
    write_scores(score([path], truths.rooms, PARTIAL), tmp_path / "s.json")
    other = good_rooms(tmp_path, truths.rooms, "other.h5")
    with open_runs([path], truths.rooms) as runs:
        scores = scores_of(tmp_path / "s.json", runs.files[0], rooms)
        shown = [view.row for scene in predicted_scenes(runs.files[0], rooms, scores, [6, 3])
                 for view in scene.views]  # fmt: skip
        assert shown == [6, 3]
        with pytest.raises(SpecError) as error:
            next(predicted_scenes(runs.files[0], rooms, scores, [3, 4]))
        assert (error.value.where, error.value.found) == ("items", "row 4")
    with open_runs([other], truths.rooms) as runs, pytest.raises(ScoringError) as error:
        scores_of(tmp_path / "s.json", runs.files[0], rooms)
    assert error.value.where == str(tmp_path / "s.json")
    path = good_answers(tmp_path, truths.iqtt)
    with open_predictions(path) as answers, pytest.raises(ScoringError):
        require_rooms(answers)

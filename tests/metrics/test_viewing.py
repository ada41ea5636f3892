"""Predictions on the 3D page: which rows, in which order, where, and what a click tells."""

import re
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from submissions import good_answers, good_rooms

from metrics.score_file import write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.runs import ScoringError, Settings
from metrics.submissions.reader import open_predictions
from metrics.viewing import (
    RowScores,
    predicted_rooms,
    require_rooms,
    shown_scores,
    worst_first,
)
from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.common.web_hosts import Hosts
from scenegen.viewing.geometry import RIGHT, TOO_FAR, aside, shapes_of

NAN = float("nan")
SCENES = [(0, 1), (2, 3), (4,), (5,)]
VALUES = {
    "chamfer": np.array([0.1, 0.5, 0.4, 0.4, 0.2, 0.2]),
    "relief_iou": np.array([0.1, 0.5, 0.4, 0.4, NAN, 0.2]),
    "empty_room_chamfer": np.ones(6),
    "rmse": np.full(6, NAN),
}


def test_the_worst_come_first():
    scores = RowScores(np.arange(6), VALUES)
    lower_is_better = worst_first(scores, "chamfer", SCENES)
    assert lower_is_better == [(2, 3), (1, 0), (4,), (5,)], "by means; equals in their order"
    assert worst_first(scores, "relief_iou", SCENES) == [(5,), (0, 1), (2, 3), (4,)]


@pytest.fixture
def noisy(truths, tmp_path):
    """Rows 6 to 1 of the truth, in that order; the higher the row, the worse, and one is broken."""
    from metrics.prediction_writer import RoomPredictionWriter

    with open_rooms(truths.rooms) as rooms:
        path = tmp_path / "predictions.h5"
        with RoomPredictionWriter(path, truths.rooms, method="noise", allow_partial=True) as out:
            for row in range(6, 0, -1):
                out.add(row, rooms[row].depth * (1 + 0.01 * row))
        yield rooms, path


def test_rows_that_are_predicted_are_scored(noisy, tmp_path):
    rooms, path = noisy
    with open_predictions(path) as predictions:
        scores = shown_scores(predictions, rooms)
        assert scores.rows.tolist() == [1, 2, 3, 4, 5, 6]
        assert worst_first(scores, "abs_rel", [(row,) for row in range(1, 7)])[0] == (6,)
        assert scores.values["abs_rel"][2] == pytest.approx(0.03, rel=1e-3)
        assert shown_scores(predictions, rooms, [5, 2]).rows.tolist() == [2, 5]
        with pytest.raises(SpecError) as error:
            shown_scores(predictions, rooms, [2, 7])
        assert (error.value.where, error.value.found) == ("items", "row 7")
        stored = score([path], rooms.path, Settings(allow_partial=True, resamples=100))
        write_scores(stored, tmp_path / "s.json")
        same = shown_scores(predictions, rooms, [4], tmp_path / "s.json")
        assert same.values["chamfer"].tolist() == scores.values["chamfer"][3:4].tolist()


def test_scores_of_others_are_refused(noisy, truths, tmp_path):
    rooms, path = noisy
    other = good_rooms(tmp_path, truths.rooms, "other.h5")
    write_scores(score([other], rooms.path, Settings(resamples=100)), tmp_path / "s.json")
    with open_predictions(path) as predictions, pytest.raises(ScoringError) as error:
        shown_scores(predictions, rooms, None, tmp_path / "s.json")
    assert (error.value.where, "other.h5" in error.value.found) == (str(tmp_path / "s.json"), True)


def test_answers_are_refused(truths, tmp_path):
    path = good_answers(tmp_path, truths.iqtt)
    with open_predictions(path) as answers, pytest.raises(ScoringError):
        require_rooms(answers)


SIZE = 32  # of the truths' images
WORST = 5
FACTORS = {3: 1.001, WORST: 1.1, 6: 1.02}  # of the true depth, by row


@pytest.fixture
def served(truths, tmp_path):
    """A page of three rows, of one of which the left half is too near and three pixels are none."""
    pytest.importorskip("viser")
    from metrics.prediction_writer import RoomPredictionWriter
    from scenegen.viewing.page import RoomsPage
    from scenegen.viewing.server import started

    path = tmp_path / "predictions.h5"
    with open_rooms(truths.rooms) as rooms:
        with RoomPredictionWriter(path, truths.rooms, method="m", allow_partial=True) as out:
            for row, factor in FACTORS.items():
                depth = rooms[row].depth * factor
                if row == WORST:
                    depth[:, : SIZE // 2] *= 0.8
                out.add(row, depth, rooms[row].normal)
        with h5py.File(path, "r+") as file:
            file["depth"][1, 0, :3] = np.nan, np.inf, -1
        with open_predictions(path) as found, started("test", Hosts(), 0) as server:
            shown = predicted_rooms(found, rooms, shown_scores(found, rooms))
            yield rooms, RoomsPage(server, rooms, shapes_of(rooms.spec), *shown), server


def clouds(page):
    return {(cloud.kind, cloud.room.index): cloud for cloud in page.clouds}


def test_surfels_are_beside_the_truth(served):
    from views_in_3d import switch

    rooms, page, server = served
    switch(page, sort="AbsRel")
    assert f"row {WORST}" in page.text
    assert "3 pixels" in page.text
    made, room = clouds(page), rooms[WORST]
    truth, predicted = made["/truth", WORST], made["/prediction", WORST]
    assert len(predicted.surfels.points) == SIZE**2 - 3
    right, eye = room.world_from_camera[:3, 0], room.world_from_camera[:3, 3]
    gap = (predicted.surfels.points @ right).min() - (truth.surfels.points @ right).max()
    assert gap > -0.1, "hardly any overlap"
    colors = predicted.colors[predicted.surfels.pixels[:, 1] >= SIZE // 2]
    assert {tuple(color) for color in colors.tolist()} == {TOO_FAR}
    for i, marks in ((0, 1), (40, 2)):  # the first pixels have no prediction
        way = truth.surfels.points[i] - eye
        client = SimpleNamespace(camera=SimpleNamespace(fov=1.0, image_height=10_000))
        ray = {"ray_origin": eye, "ray_direction": way / np.linalg.norm(way)}
        page._click(SimpleNamespace(client=client, **ray))
        depth = float(room.depth.ravel()[i])
        assert f"<td>{depth:.5f}</td>" in page.clicked
        names = [f"/mark/{k}" for k in range(3)]
        handles = [server.scene.get_handle_by_name(name) for name in names]
        assert sum(handle is not None for handle in handles) == marks
        assert np.allclose(handles[0].position, truth.surfels.points[i])
    told = re.search("predicted depth</th><td>([0-9.]+)<", page.clicked)
    assert float(told[1]) == pytest.approx(depth * 1.1 * 0.8, abs=1e-4), "the left half"
    switch(page, beside=False)
    moved = predicted.surfels.points - clouds(page)["/prediction", WORST].surfels.points
    np.testing.assert_allclose(moved, np.broadcast_to(aside(room), moved.shape), atol=1e-5)
    switch(page, truth=False, beside=True)
    assert list(clouds(page)) == [("/prediction", WORST)]
    switch(page, scene=2)
    assert "row 3" in page.text
    assert np.abs(clouds(page)["/prediction", 3].colors - np.array(RIGHT, float)).max() < 12
    switch(page, sort="delta 1")
    assert page.controls["scene"].value == 0

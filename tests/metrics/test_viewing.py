"""Which rows are shown, and in which order."""

import numpy as np
import pytest
from submissions import good_answers, good_rooms

from metrics.score_file import write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.runs import ScoringError, Settings
from metrics.submissions.reader import open_predictions
from metrics.viewing.order import RowScores, require_rooms, shown_scores, sortable, worst_first
from scenegen import open_rooms
from scenegen.common.errors import SpecError

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
    assert list(sortable(scores).values()) == ["chamfer", "relief_iou"]


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
        assert scores.of(3)["abs_rel"] == pytest.approx(0.03, rel=1e-3)
        assert shown_scores(predictions, rooms, [5, 2]).rows.tolist() == [2, 5]
        with pytest.raises(SpecError) as error:
            shown_scores(predictions, rooms, [2, 7])
        assert (error.value.where, error.value.found) == ("items", "row 7")
        stored = score([path], rooms.path, Settings(allow_partial=True, resamples=100))
        write_scores(stored, tmp_path / "s.json")
        same = shown_scores(predictions, rooms, [4], tmp_path / "s.json")
        assert same.of(4)["chamfer"] == scores.of(4)["chamfer"]


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

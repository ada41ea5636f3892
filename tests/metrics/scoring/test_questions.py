"""Answers to questions against true ones: accuracy, its groups, its interval, skill."""

import h5py
import numpy as np
import pytest

from metrics.prediction_writer import write_answers
from metrics.scoring.evaluate import score


def test_answers_are_scored_by_kind_angle_and_place(questions):
    found = score([questions / "chance-0.h5"])
    with h5py.File(questions / "split/iqtt-test-answers.h5") as file:
        true, angles = file["answers"][:], file["truth/angle_degrees"][:]
    with h5py.File(questions / "chance-0.h5") as file:
        right = file["answer"][:] == true
    total = found.metrics["iqtt_accuracy"]
    assert total.value == right.mean()
    assert total.n == 30
    for place in range(3):
        assert found.by_position[str(place)]["iqtt_accuracy"].value == right[true == place].mean()
    assert sum(g["iqtt_accuracy"].n for g in found.by_distractor.values()) == 30
    assert set(found.by_distractor) <= {"other", "near", "mirror"}
    for key, group in found.by_rotation_angle.items():
        low, high = map(float, key.split("-"))
        inside = (angles >= low) & ((angles < high) | (high == 180))
        assert group["iqtt_accuracy"].value == right[inside].mean()


def test_true_answers_are_all_right_and_abstentions_wrong(questions, tmp_path):
    with h5py.File(questions / "split/iqtt-test-answers.h5") as file:
        true = file["answers"][:].astype(np.int64)
    test = questions / "split/iqtt-test.h5"
    write_answers(tmp_path / "all.h5", test, method="all", answer=true)
    assert score([tmp_path / "all.h5"]).metrics["iqtt_accuracy"].value == 1.0
    write_answers(tmp_path / "some.h5", test, method="some", answer=np.where(true == 0, -1, true))
    found = score([tmp_path / "some.h5"])
    assert found.metrics["iqtt_accuracy"].value == np.mean(true != 0)
    assert found.meta.counts["abstained"] == np.count_nonzero(true == 0)
    scores = np.eye(3)[true]
    scores[:4] = 1.0
    write_answers(tmp_path / "tied.h5", test, method="tied", scores=scores)
    assert score([tmp_path / "tied.h5"]).metrics["iqtt_accuracy"].value == 26 / 30


def test_answers_may_come_as_json_and_several_runs_are_averaged(questions, tmp_path):
    answers = questions / "split/iqtt-test-answers.h5"
    (tmp_path / "list.json").write_text(str([0] * 30))
    found = score([tmp_path / "list.json"], answers)
    assert found.metrics["iqtt_accuracy"].value == pytest.approx(1 / 3)
    runs = score([questions / f"chance-{seed}.h5" for seed in range(2)])
    each = [
        score([questions / f"chance-{seed}.h5"]).metrics["iqtt_accuracy"].value for seed in range(2)
    ]
    assert runs.metrics["iqtt_accuracy"].value == pytest.approx(np.mean(each))
    assert runs.metrics["iqtt_accuracy"].std == pytest.approx(np.std(each, ddof=1))


def test_every_score_has_its_column_and_lies_in_its_interval(questions, tmp_path):
    """As the reader of score files asks; runs that nearly agree are where rounding would show."""
    rng = np.random.default_rng(4)
    answers = questions / "split/iqtt-test-answers.h5"
    for runs in (2, 3, 7):
        paths = [tmp_path / f"{runs}-{run}.h5" for run in range(runs)]
        given = np.full((runs, 30), rng.integers(3, size=30))
        given[np.arange(runs), np.arange(runs)] = -1
        for path, answer in zip(paths, given, strict=True):
            write_answers(path, answers, method="m", answer=answer)
        found = score(paths, answers)
        groups = [found.metrics, *found.by_position.values(), *found.by_distractor.values()]
        for one in (group["iqtt_accuracy"] for group in groups):
            assert one.low is None or one.low <= one.value <= one.high
        assert set(found.metrics) <= set(found.items)

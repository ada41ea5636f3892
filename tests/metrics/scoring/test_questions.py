"""Answers to questions against true ones: accuracy, its groups, its interval, skill."""

import json
import shutil
from collections import Counter
from dataclasses import replace

import h5py
import numpy as np
import pytest
from refusals import refused

from baselines.trivial import write_chance
from iqtt import floors
from iqtt.files.make import make_split
from iqtt.floors import Floor, floor_of_questions
from iqtt.questions.specs import QUESTION_KINDS, SplitSpec, question_kind
from metrics.measures.statistics import design_effect, wilson_interval
from metrics.prediction_writer import PredictionError, write_answers
from metrics.scoring.evaluate import score
from metrics.scoring.runs import ScoringError


def test_answers_are_scored_by_kind_angle_and_place(questions):
    found = score([questions / "chance-0.h5"])
    with h5py.File(questions / "split/iqtt-test-answers.h5") as file:
        true, angles = file["answers"][:], file["truth/angle_degrees"][:]
        kinds = Counter(map(question_kind, file["truth/distractor_kind"][:].tolist()))
    with h5py.File(questions / "chance-0.h5") as file:
        right = file["answer"][:] == true
    total = found.metrics["iqtt_accuracy"]
    assert total.value == right.mean()
    assert total.n == 30
    for place in range(3):
        assert found.by_position[str(place)]["iqtt_accuracy"].value == right[true == place].mean()
    assert sum(g["iqtt_accuracy"].n for g in found.by_distractor.values()) == 30
    assert {key: group["iqtt_accuracy"].n for key, group in found.by_distractor.items()} == kinds
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


def test_intervals_take_shapes_as_independent(questions, tmp_path):
    """Of the reference's class; for files that tell no shapes, of each question by itself."""
    answers = questions / "split/iqtt-test-answers.h5"
    truth, bare = tmp_path / "iqtt-test-answers.h5", tmp_path / "bare.h5"
    with h5py.File(answers) as file, h5py.File(bare, "w") as released:
        true = released["answers"] = file["answers"][:]
    right = np.arange(30) < 15
    given = np.where(right, true.astype(int), -1)
    shutil.copy(answers, truth)
    with h5py.File(truth, "r+") as file:
        classes = file["truth/class_id"][:]
        classes[:, 0] = classes[np.arange(30) // 5 * 5, 0]  # 5 questions about each of 6 shapes
        file["truth/class_id"][...] = classes
    (tmp_path / "a.json").write_text(json.dumps({"answers": given.tolist(), "method": "m"}))
    found, plain = (score([tmp_path / "a.json"], path) for path in (truth, bare))
    shapes = found.items["shape"]
    assert shapes.tolist() == (np.arange(30) // 5).tolist()
    effect = design_effect(right.astype(float), shapes)
    assert effect > 5
    one, other = (each.metrics["iqtt_accuracy"] for each in (found, plain))
    assert (one.low, one.high) == pytest.approx(wilson_interval(15 / effect, 30 / effect))
    assert (other.low, other.high) == pytest.approx(wilson_interval(15, 30))
    assert "shape" not in plain.items
    assert "shape" not in plain.items
    assert (plain.by_distractor, plain.skills["iqtt_accuracy"].floor) == ({}, 1 / 3)
    given[0] = -1
    (tmp_path / "b.json").write_text(json.dumps({"answers": given.tolist(), "method": "m"}))
    paths = [tmp_path / f"{name}.json" for name in "ab"]
    several, each = (score(paths, path).metrics["iqtt_accuracy"] for path in (truth, bare))
    assert several.value == each.value == pytest.approx(29 / 60)
    assert several.low < each.low < each.value < each.high < several.high


def test_two_answers_are_scored_against_a_half(tmp_path):
    spec = SplitSpec(
        train=0, labeled=0, val=0, test=8, height=32, width=32, min_cube_pixels=1,
        distractors="mirror-pair", answers=2,
    )  # fmt: skip
    make_split(tmp_path / "split", spec)
    test = tmp_path / "split/iqtt-test.h5"
    write_chance(test, tmp_path / "chance.h5")
    found = score([tmp_path / "chance.h5"])
    assert set(found.by_distractor) == {"mirror-pair-2"}
    assert set(found.by_position) <= {"0", "1"}
    assert found.meta.counts["answers"] == 2
    assert found.skills["iqtt_accuracy"].floor == 0.5
    (tmp_path / "a.json").write_text(str([0, 1, 2, 0, 1, -1, 0, 1]))
    with refused(ScoringError, "a.json: answer", found="such as 2", expected="an answer"):
        score([tmp_path / "a.json"], test)
    with refused(PredictionError, "scores", found="(8, 3)", expected="(8, 2)"):
        write_answers(tmp_path / "b.h5", test, method="m", scores=np.zeros((8, 3)))


MEASURED = (
    Floor("near", "outline", 0, 0.5, 0.45, 0.55),
    Floor("near", "outline-trees", 1000, 0.6, 0.55, 0.65),
    Floor("mirror", "outline-trees", 1000, 0.36, 0.31, 0.41),
    Floor("near-2", "outline", 0, 0.55, 0.49, 0.61),
)


@pytest.mark.parametrize(
    ("counts", "answers", "floor", "name"),
    [
        ({"near": 7}, 3, 0.6, "outline-trees, 1,000 labels"),
        ({"mirror": 7}, 3, 1 / 3, floors.CHANCE_BEST),
        ({"near-2": 7}, 2, 0.5, floors.CHANCE_BEST),
        ({"unheard": 7}, 3, 1 / 3, floors.CHANCE_ONLY),
        ({}, 3, 1 / 3, floors.CHANCE_ONLY),
        ({"near": 3, "mirror": 1}, 3, (3 * 0.6 + 1 / 3) / 4, "1,000 labels (near)"),
    ],
)
def test_the_floor_is_the_best_probe_that_beats_chance(monkeypatch, counts, answers, floor, name):
    monkeypatch.setattr(floors, "FLOORS", MEASURED)
    found = floor_of_questions(counts, answers)
    assert found[0] == pytest.approx(floor)
    assert name in found[1]


def test_skill_is_the_share_of_the_way_from_the_floor_to_all_right(questions, monkeypatch):
    kinds = score([questions / "chance-0.h5"]).by_distractor
    table = tuple(replace(MEASURED[1], kind=kind) for kind in kinds)
    monkeypatch.setattr(floors, "FLOORS", table)
    for paths in ([0], [0, 1]):
        found = score([questions / f"chance-{i}.h5" for i in paths])
        told, accuracy = found.skills["iqtt_accuracy"], found.metrics["iqtt_accuracy"]
        assert (told.floor, told.floor_name) == (pytest.approx(0.6), "outline-trees, 1,000 labels")
        for end in ("value", "low", "high"):
            assert getattr(told, end) == pytest.approx((getattr(accuracy, end) - 0.6) / 0.4)


def test_the_table_of_floors_is_sound():
    """Known kinds, each probe once for a number of labels, accuracies within their intervals."""
    kinds = {f"{kind}{end}" for kind in QUESTION_KINDS for end in ("", "-2")}
    assert {floor.kind for floor in floors.FLOORS} <= kinds
    keys = [(floor.kind, floor.probe, floor.labels) for floor in floors.FLOORS]
    assert len(set(keys)) == len(keys)
    assert all(0 < floor.low < floor.accuracy < floor.high < 1 for floor in floors.FLOORS)

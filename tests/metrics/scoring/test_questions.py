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
from iqtt.files.make import make_split
from iqtt.files.reader import open_questions
from iqtt.floors import CHANCE, Floor, Measured, floor_of_questions, floors_of, settings_of, to_json
from iqtt.perspective.specs import perspective_spec
from iqtt.questions.kinds import ROOM_KINDS, question_kind
from iqtt.questions.specs import PRESETS, SUITE, SplitSpec, preset_spec
from metrics.measures.statistics import design_effect, wilson_interval
from metrics.prediction_writer import PredictionError, write_answers
from metrics.score_file import read_scores, write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.runs import ScoringError, Settings
from scenegen.common.errors import SpecError


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
    assert (plain.by_distractor, plain.skills) == ({}, {})
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
    (tmp_path / "a.json").write_text(str([0, 1, 2, 0, 1, -1, 0, 1]))
    with refused(ScoringError, "a.json: answer", found="such as 2", expected="an option"):
        score([tmp_path / "a.json"], test)
    with refused(PredictionError, "scores", found="(8, 3)", expected="(8, 2)"):
        write_answers(tmp_path / "b.h5", test, method="m", scores=np.zeros((8, 3)))


NEAR = Floor("near", "silhouettes, by trees", 0.6, 6000)
MIRROR = Floor("mirror", CHANCE, 1 / 3, 6000)


@pytest.mark.parametrize(
    ("counts", "floor", "name"),
    [
        ({"near": 7}, 0.6, NEAR.probe),
        ({"mirror": 7}, 1 / 3, CHANCE),
        ({"near": 3, "mirror": 1}, (3 * 0.6 + 1 / 3) / 4, f"{NEAR.probe} (near)"),
    ],
)
def test_the_floor_of_questions_is_the_mean_of_those_of_their_kinds(counts, floor, name):
    found = floor_of_questions(counts, {"near": NEAR, "mirror": MIRROR})
    assert found is not None
    assert found[0] == pytest.approx(floor)
    assert name in found[1]


def test_no_floor_where_one_kind_has_none():
    for counts in ({}, {"near": 3, "other": 1}):
        assert floor_of_questions(counts, {"near": NEAR}) is None


def floors_file(path, spec, kinds):
    floors = tuple(replace(NEAR, kind=kind) for kind in kinds)
    path.write_text(to_json([Measured(settings_of(spec), floors)]))
    return path


def test_skill_is_the_share_of_the_way_from_the_floor_to_all_right(questions, tmp_path):
    with open_questions(questions / "split/iqtt-val.h5") as file:
        spec = file.spec
    found = score([questions / "chance-0.h5"])
    assert found.skills == {}
    kinds = found.by_distractor
    path = floors_file(tmp_path / "floors.json", replace(spec, test=3, seed=1), kinds)
    for paths in ([0], [0, 1]):
        runs = [questions / f"chance-{i}.h5" for i in paths]
        found = score(runs, settings=Settings(floors=path))
        told, accuracy = found.skills["iqtt_accuracy"], found.metrics["iqtt_accuracy"]
        assert (told.floor, told.floor_name) == (pytest.approx(0.6), NEAR.probe)
        for end in ("value", "low", "high"):
            assert getattr(told, end) == pytest.approx((getattr(accuracy, end) - 0.6) / 0.4)
        write_scores(found, tmp_path / "s.json", overwrite=True)
        assert read_scores(tmp_path / "s.json").skills == found.skills
    for other in (replace(spec, min_angle_degrees=1), replace(spec, background=(0, 0, 0))):
        floors_file(path, other, kinds)
        assert score([questions / "chance-0.h5"], settings=Settings(floors=path)).skills == {}


def test_what_is_no_file_of_floors_is_refused(tmp_path, questions):
    path = floors_file(tmp_path / "floors.json", SplitSpec(), ["near"])
    good = path.read_text()
    for old, new in (("0.6", "1.0"), ("floors", "scores"), ("near", 'near", 1, '), ("{", "[")):
        path.write_text(good.replace(old, new, 1))
        with pytest.raises(SpecError):
            score([questions / "chance-0.h5"], settings=Settings(floors=path))


def test_the_package_has_the_floors_of_every_preset():
    for preset in PRESETS:
        spec = preset_spec(preset)
        assert floors_of(spec).keys() >= {*spec.kinds}
        assert all(floor.questions >= 2000 for floor in floors_of(spec).values())
    assert floors_of(preset_spec("suite")).keys() >= SUITE.keys()
    assert floors_of(preset_spec("small", min_angle_degrees=0.0)) == {}
    for angle in ((20, 120), (60, 120)):
        for split in ("all", "test"):
            rooms = perspective_spec("perspective", angle=angle, object_split=split, spp=16)
            assert floors_of(rooms).keys() == {*ROOM_KINDS}
            assert 0.4 < floors_of(rooms)["moved"].accuracy < 0.6
    assert floors_of(perspective_spec("perspective", angle=(30, 60))) == {}

"""Every number of a score file that follows from its items, and forgeries of each."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from made_scores import iqtt_scores, rooms_scores
from refusals import refused

import cli
from baselines.trivial import write_chance, write_room_baseline
from metrics.leaderboard.recheck import RecheckError, recheck, steps
from metrics.measures.statistics import (
    bootstrap_interval,
    cluster_means,
    clustered_wilson_interval,
    linearised_means,
    wilson_interval,
)
from metrics.prediction_writer import RoomPredictionWriter
from metrics.score_file import Score, read_scores, write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.metric_names import OBJECT_SCORES, metric
from metrics.scoring.questions import question_skill
from scenegen.rooms.reader import RoomsFile

SCENES = np.repeat(np.arange(9), 2)
ANGLES = np.tile([0, 35], 9)
RNG = np.random.default_rng(5)
COLUMNS = {"chamfer": RNG.random(18), "normal_mean_degrees": 90 * RNG.random(18) ** 4}


def scored(columns, clusters):
    """Scores as `bench score` has them, one after the other."""
    found = {}
    for name, column in columns.items():
        means = cluster_means(column, clusters)
        ends = bootstrap_interval(means[:, None], 0)
        low, high = (float(end[0]) for end in ends)
        found[name] = Score(float(means.mean()), low, high, metric(name).unit, len(means), None)
    return found


def by_angle(angle):
    chosen = angle == ANGLES
    return scored({name: c[chosen] for name, c in COLUMNS.items()}, SCENES[chosen])


def fraction(right, n):
    return {"iqtt_accuracy": Score(right / n, *wilson_interval(right, n), "fraction", n, None)}


def made_rooms():
    file = rooms_scores("m", COLUMNS, SCENES.tolist(), path=Path("m.json"))
    items = {**file.items, "view_angle_degrees": ANGLES}
    groups = {"0": by_angle(0), "35": by_angle(35)}
    return replace(file, items=items, metrics=scored(COLUMNS, SCENES), by_view_angle=groups)


def made_questions(runs=1):
    right = np.array([1, 0, 1, 1, 0, 1], float) if runs == 1 else np.array([1, 0.5, 1, 1, 0, 0.5])
    file = iqtt_scores("q", right, runs)
    file = replace(file, path=Path("q.json"), by_distractor={})
    if runs == 1:
        groups = {"0": fraction(1, 2), "2": fraction(3, 4)}
        return replace(file, metrics=fraction(4, 6), by_position=groups)
    groups = {"0": {"iqtt_accuracy": Score(0.75, 0.5, 1.0, "fraction", 2, 0.1)}}
    groups["1"] = {"iqtt_accuracy": Score(0.625, 0.25, 1.0, "fraction", 4, 0.1)}
    everything = {"iqtt_accuracy": right}
    return replace(file, metrics=scored(everything, np.arange(6)), by_position=groups)


def forged(file, place, **parts):
    """The file with other numbers at a place such as metrics/chamfer or by_position/0."""
    grouping, *way = place.split("/")
    holder = dict(getattr(file, grouping))
    if grouping == "metrics":
        holder[way[0]] = replace(holder[way[0]], **parts)
    else:
        inner = dict(holder[way[0]])
        name = way[1] if way[1:] else "iqtt_accuracy"
        inner[name] = replace(inner[name], **parts)
        holder[way[0]] = inner
    return replace(file, **{grouping: holder})


@pytest.mark.parametrize("file", [made_rooms(), made_questions(), made_questions(2)])
def test_honest_files_pass_when_read_in_any_order(file, tmp_path):
    write_scores(replace(file, items={n: c[::-1] for n, c in file.items.items()}), tmp_path / "s")
    done = []
    recheck(read_scores(tmp_path / "s"), done.append)
    assert sum(done) == steps(file)


def test_what_scoring_writes_passes(truths, tmp_path):
    """The scores come from the program here, not from the formulas of this file."""
    rooms, answers = tmp_path / "rooms.h5", [tmp_path / f"{i}.h5" for i in range(2)]
    write_room_baseline("empty-room", truths.rooms, rooms)
    for seed, path in enumerate(answers):
        write_chance(truths.iqtt, path, seed)
    for files, truth in (
        ([rooms], truths.rooms),
        (answers[:1], truths.iqtt),
        (answers, truths.iqtt),
    ):
        write_scores(score(files, truth), tmp_path / "s.json", overwrite=True)
        recheck(read_scores(tmp_path / "s.json"))


NUMBERS = [
    (made_rooms(), f"{place}/{name}", part)
    for place, name, part in itertools.product(
        ("metrics", "by_view_angle/35"), COLUMNS, ("value", "low", "high", "n")
    )
]
NUMBERS += [(made_questions(), "metrics/iqtt_accuracy", part) for part in ("value", "low", "high")]
NUMBERS += [(made_questions(), "by_position/2", part) for part in ("value", "low", "high")]
NUMBERS += [(made_questions(2), "metrics/iqtt_accuracy", part) for part in ("value", "low", "high")]
NUMBERS += [(made_questions(2), "by_position/0", "value")]


@pytest.mark.parametrize(("file", "place", "part"), NUMBERS)
def test_each_number_is_held_against_the_items(file, place, part):
    grouping, *way = place.split("/")
    scores = getattr(file, grouping)[way[0]]
    score = scores if grouping == "metrics" else scores[[*way, "iqtt_accuracy"][1]]
    number = getattr(score, part)
    where = place.replace("/", ".") + ("" if "metrics" in place or way[1:] else ".iqtt_accuracy")
    for other in (number + 1,) if part == "n" else (number * (1 + 1e-6),):
        with refused(RecheckError, f": {where}.{part}", repr(other), repr(number)[:8], "again"):
            recheck(forged(file, place, **{part: other}))
    if part != "n":
        recheck(forged(file, place, **{part: number * (1 + 1e-12)}))


@pytest.mark.parametrize("name", ["chamfer", "hausdorff", "rmse"])
def test_scores_of_one_image_agree_with_each_other(truths, tmp_path, name):
    """A column that is best everywhere, with a mean and an interval to go with it."""
    write_room_baseline("empty-room", truths.rooms, tmp_path / "rooms.h5")
    file = score([tmp_path / "rooms.h5"], truths.rooms)
    best = replace(file.metrics[name], value=0.0, low=0.0, high=0.0)
    items = {**file.items, name: np.zeros(len(file.ids))}
    forged = replace(file, items=items, metrics={**file.metrics, name: best}, by_view_angle={})
    with refused(RecheckError, f"items.{name}[0]", found="0.0"):
        recheck(forged)


@pytest.fixture(scope="module")
def scored_rooms(truths, tmp_path_factory):
    """What the program says of objects moved back and walls moved forth; few scores are 0 or 1."""
    path = tmp_path_factory.mktemp("recheck") / "p.h5"
    with (
        RoomsFile(truths.rooms) as rooms,
        RoomPredictionWriter(path, truths.rooms, method="m") as p,
    ):
        for row, room in enumerate(rooms):
            p.add(row, np.where(room.object_id > 0, 1.04, 0.98) * np.nan_to_num(room.depth, nan=3))
    return replace(score([path], truths.rooms), path=Path("m.json"))


@pytest.mark.parametrize("part", ["value", "low", "high", "floor"])
@pytest.mark.parametrize("name", ["chamfer", "object_completeness", "relief_iou"])
def test_skills_follow_from_the_items(scored_rooms, name, part):
    recheck(scored_rooms)
    found = scored_rooms.skills[name]
    other = replace(found, **{part: getattr(found, part) + 1e-6})
    with refused(RecheckError, f"m.json: skills.{name}.{part}"):
        recheck(replace(scored_rooms, skills={**scored_rooms.skills, name: other}))


def test_a_bad_skill_cannot_be_left_out(scored_rooms):
    kept = {name: one for name, one in scored_rooms.skills.items() if name != "chamfer"}
    with refused(RecheckError, "m.json: skills.chamfer", "no such key", "a skill"):
        recheck(replace(scored_rooms, skills=kept))


@pytest.mark.parametrize("grouping", ["by_object_shape", "by_object_size"])
def test_groups_of_objects_follow_from_the_objects(scored_rooms, grouping):
    groups = getattr(scored_rooms, grouping)
    key = next(iter(groups))
    for part in ("value", "low", "n"):
        score = groups[key]["object_completeness"]
        changed = (getattr(score, part) or 0) + (1 if part == "n" else 1e-6)
        scores = {**groups[key], "object_completeness": replace(score, **{part: changed})}
        with refused(RecheckError, f"{grouping}.{key}.object_completeness.{part}"):
            recheck(replace(scored_rooms, **{grouping: {**groups, key: scores}}))
    unknown = {**groups, "99-100": groups[key]}
    with refused(RecheckError, f"{grouping}.99-100", expected="objects of this group"):
        recheck(replace(scored_rooms, **{grouping: unknown}))


@pytest.mark.parametrize("name", OBJECT_SCORES)
def test_scores_of_images_follow_from_their_objects(scored_rooms, name):
    """A table of objects that says better than the column does."""
    better = 0.5 * scored_rooms.objects[name] + 0.25 * ("recall" in name)
    objects = {**scored_rooms.objects, name: better}
    with refused(RecheckError, f"items.{name}[0]", expected="as objects say"):
        recheck(replace(scored_rooms, objects=objects))


def test_without_objects_no_skill_follows(scored_rooms):
    gone = np.full(len(scored_rooms.ids), np.nan)
    names = {name for name in scored_rooms.items if "object_" in name}
    items = {**scored_rooms.items, **dict.fromkeys(names, gone)}
    less = {name: s for name, s in scored_rooms.metrics.items() if name not in names}
    bare = replace(
        scored_rooms, items=items, metrics=less, objects={}, by_view_angle={},
        by_object_shape={}, by_object_size={},
    )  # fmt: skip
    with refused(RecheckError, "skills.chamfer", "a skill", "none"):
        recheck(replace(bare, skills={"chamfer": scored_rooms.skills["chamfer"]}))
    recheck(replace(bare, skills={}))


def test_intervals_cannot_be_left_out():
    with refused(RecheckError, "metrics.chamfer.low", "null", "0."):
        recheck(forged(made_rooms(), "metrics/chamfer", low=None, high=None))


def test_another_bootstrap_gives_other_intervals():
    file = made_rooms()
    for other in ({"seed": 1}, {"resamples": 2001}, {"confidence": 0.9}):
        with refused(RecheckError, "metrics.chamfer.low"):
            recheck(replace(file, meta=replace(file.meta, **other)))


def test_groups_rest_on_items():
    file = made_rooms()
    unknown = replace(file, by_view_angle={"80": by_angle(0)})
    with refused(RecheckError, "m.json: by_view_angle.80", expected="80 degrees"):
        recheck(unknown)
    bare = {name: c for name, c in file.items.items() if name != "view_angle_degrees"}
    with refused(RecheckError, "by_view_angle.0"):
        recheck(replace(file, items=bare))
    lost = {name: c for name, c in file.items.items() if name != "chamfer"}
    less = {name: s for name, s in file.metrics.items() if name != "chamfer"}
    with refused(RecheckError, "by_view_angle.0.chamfer", "a score", "items.chamfer"):
        recheck(replace(file, items=lost, metrics=less))
    huge = {**file.items, "chamfer": np.full(18, 1e300)}
    with refused(RecheckError, "m.json: metrics"):
        recheck(replace(file, items=huge))


@pytest.mark.parametrize(
    ("groups", "found", "expected"),
    [
        ({"0": fraction(1, 2)}, "2 questions", "6 questions"),
        ({"0": fraction(1, 2), "1": fraction(4, 4)}, "5 right answers", "4 right answers"),
    ],
)
def test_groups_of_questions_add_up(groups, found, expected):
    with refused(RecheckError, "q.json: by_position", found, expected):
        recheck(replace(made_questions(), by_position=groups))
    with refused(RecheckError, "by_position.0.iqtt_accuracy", "no such key"):
        recheck(replace(made_questions(), by_position={"0": {}}))


def shaped(runs=1):
    """Six questions about three shapes, with the skill over chance."""
    file = made_questions(runs)
    shapes, right = np.array([0, 0, 1, 1, 2, 2]), file.items["iqtt_accuracy"]
    if runs == 1:
        low, high = clustered_wilson_interval(right, shapes)
    else:
        low, high = (end[0] for end in bootstrap_interval(linearised_means(right, shapes), 0))
    accuracy = replace(file.metrics["iqtt_accuracy"], low=float(low), high=float(high))
    known = {"iqtt_accuracy": question_skill(accuracy, {}, 3)}
    items = {**file.items, "shape": shapes}
    return replace(file, items=items, metrics={"iqtt_accuracy": accuracy}, skills=known)


@pytest.mark.parametrize("runs", [1, 2])
def test_intervals_of_questions_rest_on_their_shapes(runs, tmp_path):
    file = shaped(runs)
    write_scores(replace(file, items={n: c[::-1] for n, c in file.items.items()}), tmp_path / "s")
    recheck(read_scores(tmp_path / "s"))
    others = {**file.items, "shape": np.array([0, 1, 0, 0, 0, 0])}
    with refused(RecheckError, "metrics.iqtt_accuracy.low"):
        recheck(replace(file, items=others))


def test_skills_of_questions_are_recomputed():
    file = shaped()
    for part, value in (("value", 0.9), ("low", 0.0), ("floor", 0.2), ("floor_name", "best")):
        forged = {"iqtt_accuracy": replace(file.skills["iqtt_accuracy"], **{part: value})}
        with refused(RecheckError, f"q.json: skills.iqtt_accuracy.{part}"):
            recheck(replace(file, skills=forged))
    counts = {name: number for name, number in file.meta.counts.items() if name != "answers"}
    with refused(RecheckError, "meta.counts.answers"):
        recheck(replace(file, meta=replace(file.meta, counts=counts)))


def test_intervals_of_groups_are_those_of_one_to_all_questions():
    file = shaped()
    low, high = wilson_interval(3, 4)
    wider = {"low": low - 0.05, "high": high + 0.005}
    recheck(forged(file, "by_position/2", **wider))
    for part, value in (("low", low + 0.01), ("high", high - 0.01), ("low", 0.0)):
        with refused(RecheckError, f"by_position.2.iqtt_accuracy.{part}"):
            recheck(forged(file, "by_position/2", **{part: value}))


def test_the_leaderboard_refuses_what_does_not_follow(tmp_path, check_refusal):
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    write_scores(made_rooms(), good)
    write_scores(forged(made_rooms(), "metrics/chamfer", high=0.9), bad)

    def run(*arguments):
        return CliRunner().invoke(cli.bench, ["leaderboard", *map(str, arguments)])

    assert run(good, "--recheck").stdout == run(good).stdout
    assert run(bad).exit_code == 0
    told = run(good, bad, "--recheck")
    words = ("bad.json: metrics.chamfer.high", "0.9")
    check_refusal(told.exit_code, told.stdout, told.stderr, words)

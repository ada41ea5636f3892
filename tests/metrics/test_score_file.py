"""Score files: the same bits when read, nothing half written, and broken ones refused in a line."""

import copy
import json
import math
import os
from dataclasses import replace

import made_scores
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from json_edits import GONE, changed, every_place
from refusals import refused

from baselines.trivial import write_chance
from metrics.measures.statistics import bootstrap_interval, clustered_wilson_interval
from metrics.score_file import JsonError, read_scores, to_json, write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.known_tests import KNOWN_TESTS
from metrics.scoring.records import GROUPINGS
from metrics.submissions.strict_json import LONGEST_SHOWN, refusal

ROOMS = json.loads(to_json(made_scores.simple_rooms()))
RUNS = json.loads(to_json(made_scores.simple_rooms(runs=2)))
OBJECTS = json.loads(to_json(made_scores.rooms_with_objects()))
IQTT = json.loads(to_json(made_scores.iqtt_scores("m", [1, 0, 1, 1])))


def read_again(scores, folder):
    write_scores(scores, folder / "s.json", overwrite=True)
    return read_scores(folder / "s.json")


@pytest.mark.parametrize("runs", [1, 3])
def test_what_is_written_reads_back_to_the_same_bits(runs, tmp_path):
    scores = made_scores.rooms_with_objects(runs=runs)
    other = read_again(scores, tmp_path)
    assert other.path == tmp_path / "s.json"
    for name in ("task", "method", "alignment", "shown", "meta"):
        assert getattr(other, name) == getattr(scores, name), name
    for kind in ("columns", "object_columns"):
        ours, theirs = getattr(scores, kind), getattr(other, kind)
        assert theirs.keys() == ours.keys()
        for name, column in ours.items():
            np.testing.assert_array_equal(theirs[name], column)
    for name in ("metrics", "skills", *GROUPINGS["rooms"]):
        assert getattr(other, name) == getattr(scores, name), name
    assert to_json(other) == other.path.read_text()


def test_format_1_0_has_angles_without_sign_and_a_number_for_the_unknown(tmp_path):
    older = copy.deepcopy(ROOMS)
    older["format_version"] = "1.0"
    older["items"]["view_angle_degrees"] = [0, 35, -1, 35]
    (tmp_path / "s.json").write_text(json.dumps(older))
    angles = read_scores(tmp_path / "s.json").columns["view_angle_degrees"]
    assert angles[[0, 1, 3]].tolist() == [0, 35, 35]
    assert np.isnan(angles[2])


@given(st.lists(st.floats(0.0, 1e300), min_size=1, max_size=6))
def test_every_double_survives(values):
    scores = made_scores.rooms_scores("m", {"rmse": [0.5] * len(values)}, range(len(values)))
    columns = {**scores.columns, "chamfer": np.array([values])}
    scores = made_scores.stated(replace(scores, columns=columns), metrics={}, skills={})
    assert json.loads(to_json(scores))["items"]["chamfer"] == values


def test_numbers_follow_from_the_items(tmp_path):
    """Whatever the summary claims; means are over scenes, not images."""
    columns = {"chamfer": [[0.1, 0.1, 0.1, 0.5], [0.3, 0.3, 0.3, 0.5]]}
    scores = made_scores.rooms_scores("m", columns, [2, 2, 2, 7], runs=2)
    write_scores(scores, tmp_path / "s.json")
    content = json.loads((tmp_path / "s.json").read_text())
    assert content["summary"]["metrics"]["chamfer"]["value"] == pytest.approx(0.35)
    for summary in ({"metrics": {"chamfer": {"value": 0.0}}}, [], None):
        (tmp_path / "s.json").write_text(json.dumps({**content, "summary": summary}))
        chamfer = read_scores(tmp_path / "s.json").metrics["chamfer"]
        (low,), (high,) = bootstrap_interval(np.array([[0.2], [0.5]]), 0)
        assert (chamfer.value, chamfer.low, chamfer.high) == pytest.approx((0.35, low, high))
        assert chamfer.std == pytest.approx(np.std([0.3, 0.4], ddof=1))


def test_what_the_scorer_found_is_read_back(truths, tmp_path):
    paths = [tmp_path / f"{seed}.h5" for seed in range(2)]
    for seed, path in enumerate(paths):
        write_chance(truths.iqtt, path, seed)
    for submissions in (paths, paths[:1]):
        scores = score(submissions, truths.iqtt)
        other = read_again(scores, tmp_path)
        for name in ("metrics", "skills", *GROUPINGS["iqtt"]):
            assert getattr(other, name) == getattr(scores, name), name
    right, shapes = other.items["iqtt_accuracy"], other.items["shape"]
    ends = clustered_wilson_interval(right, shapes)
    assert (other.metrics["iqtt_accuracy"].low, other.metrics["iqtt_accuracy"].high) == ends


def test_numbers_that_are_not_finite_become_null(tmp_path):
    scores = made_scores.rooms_with_objects()
    column = [[0.1, math.nan, math.inf, 0.2]]
    odd = made_scores.stated(scores, metrics={}, skills={}, by_object_shape={}, by_object_size={})
    vars(odd)["columns"] = {**scores.columns, "relief_iou": np.array(column)}
    text = to_json(odd)
    assert json.loads(text)["items"]["relief_iou"] == [0.1, None, None, 0.2]
    assert "NaN" not in text
    assert "Infinity" not in text
    relief = read_again(scores, tmp_path).items["relief_iou"]
    assert np.isnan(relief).tolist() == [0, 0, 0, 1]


def test_what_the_reader_would_refuse_is_not_written(tmp_path, monkeypatch):
    scores = made_scores.simple_rooms()
    path = tmp_path / "s.json"
    path.write_text("before")
    ids = {"row": scores.columns["row"]}
    for broken in (
        replace(scores, columns={**scores.columns, "note": np.zeros((1, 4))}),
        replace(scores, columns={**scores.columns, **{"row": np.zeros(4, np.int64)}}),
        made_scores.stated(replace(scores, columns={**scores.columns, **ids}, method="\ud800")),
        replace(scores, alignment="affine"),
    ):
        with pytest.raises(JsonError) as caught:
            write_scores(made_scores.stated(broken, metrics={}, skills={}), path, overwrite=True)
        assert caught.value.where.startswith(f"{path}")
        assert path.read_text() == "before"
        assert os.listdir(tmp_path) == ["s.json"]
    monkeypatch.setattr("metrics.score_file.MOST_BYTES", 100)
    with refused(JsonError, "other.json", "bytes", hint="--csv"):
        write_scores(scores, tmp_path / "other.json")
    assert os.listdir(tmp_path) == ["s.json"]


def test_files_are_replaced_only_when_asked(tmp_path):
    scores, path = made_scores.simple_rooms(), tmp_path / "s.json"
    write_scores(scores, path)
    with pytest.raises(FileExistsError, match="--overwrite"):
        write_scores(made_scores.simple_rooms("other"), path)
    assert read_scores(path).method == "mine"
    assert read_again(made_scores.simple_rooms("other"), tmp_path).method == "other"
    with pytest.raises(FileNotFoundError):
        read_scores(tmp_path / "none.json")
    with pytest.raises(IsADirectoryError):
        read_scores(tmp_path)


def refusal_of(path, text):
    """The place, what was found and what was expected, as a reader says about this text."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    with pytest.raises(JsonError) as caught:
        read_scores(path)
    error = caught.value
    assert error.where.startswith(f"{path}")
    assert str(error).isprintable()
    assert len(str(error)) < 450 + len(str(path))
    return error.where.removeprefix(f"{path}").removeprefix(": "), error.found, error.expected


@pytest.mark.parametrize("document", [RUNS, IQTT, OBJECTS], ids=["runs", "iqtt", "objects"])
def test_any_value_anywhere_is_refused_in_one_line_or_can_be_written_again(document, tmp_path):
    """Every place of a file, with every kind of wrong value in it."""
    path, lines, places = tmp_path / "s.json", [], []
    for place in every_place({k: v for k, v in document.items() if k != "summary"}):
        for value in (None, True, -1, 1e300, "x", [], {}, [[]], GONE):
            if value is GONE and place.rpartition("/")[2].isdecimal():
                continue
            path.write_text(json.dumps(changed(document, place, value)))
            try:
                scores = read_scores(path)
            except JsonError as error:
                lines.append(str(error))
            else:
                places.append(place)
                write_scores(scores, tmp_path / "again.json", overwrite=True)
                assert to_json(read_scores(tmp_path / "again.json")) == to_json(scores)
    assert all(line.isprintable() and line.startswith(f"{path}: ") for line in lines)
    assert len(lines) > 4 * len(places)


SHA = ROOMS["meta"]["submissions"][0]
GROUP = {"n": 4, "right": [3], "low": None, "high": None}
# What is put where, then where the reader finds fault (if not there), and what it expected.
WRONG_ROOMS = [
    ("format", GONE, "", "to be there"),
    ("format", "pix2shape-bench/rooms", "", "'pix2shape-bench/scores'"),
    ("format_version", "3.0", "", "'2.0'"),
    ("task", "room", "", "'rooms', 'iqtt' or 'measured'"),
    ("method", 3, "", "text"),
    ("method", "m" * 201, "", "at most 200"),
    ("method", "\ud800", "", "unicode"),
    ("alignment", "affine", "", "'scale_shift'"),
    ("shown", "both", "", "'first_view'"),
    ("comparable", True, "", "no key of this name"),
    ("path", "s.json", "", "no key of this name"),
    ("\x1b[31m\n", 1, r"\x1b[31m", "no key of this name"),
    ("answer_groups", {"by_view_angle": {"0": GROUP}}, "answer_groups.by_view_angle", "no key"),
    ("items", {}, "items.row", "to be there"),
    ("items/row", GONE, "", "to be there"),
    ("items/row", [], "items.scene_index", "0, as in row"),
    ("items/row", [0, 1, 2], "items.scene_index", "3, as in row"),
    ("items/row", [0, 1, 2, 2], "", "ascend"),
    ("items/row", [0, 2, 1, 3], "", "ascend"),
    ("items/row", [0, 1, 2, -3], "items.row[3]", ""),
    ("items/row", [0, 1, 2, 3.0], "items.row[3]", ""),
    ("items/row", [0, 1, 2, None], "items.row[3]", ""),
    ("items/row", [0, 1, 2, 10**30], "items.row[3]", ""),
    ("items/view_angle_degrees", [0, 35, -180, None], "items.view_angle_degrees[2]", "-179 to 180"),
    ("items/chamfer", [0.1, 0.2], "", "4, as in row"),
    ("items/chamfer", [0.1, 0.3, 0.2, "1"], "items.chamfer[3]", "number"),
    ("items/chamfer", [0.1, 0.3, 0.2, True], "items.chamfer[3]", "number"),
    ("items/chamfer", [0.1, 0.3, 0.2, [1]], "items.chamfer[3]", "number"),
    ("items/chamfer", [0.1, 10**400], "items.chamfer[1]", "number"),
    ("items/chamfer", [0.1, -0.3, 0.2, 0.2], "items.chamfer[1]", "number from 0"),
    ("items/chamfer", [0.1, 1e101, 0.2, 0.2], "items.chamfer[1]", "number from 0"),
    ("items/chamfer", [0.1, 0.3, 0.2, None], "", "a number in each entry"),
    ("items/chamfer", 0.1, "", "a list"),
    ("items/f_score_0.05", [0.5, 0.25, 1, 1.5], "items.f_score_0.05[3]", "from 0 to 1"),
    ("items/note", [0] * 4, "", "docs/data/metrics.csv"),
    ("items/iqtt_accuracy", [0] * 4, "", "docs/data/metrics.csv"),
    ("meta/truth_fingerprint", " ", "", "not blank"),
    ("meta/truth_digest", "AB", "", "64 hexadecimal"),
    ("meta/truth_given", 1, "", "boolean"),
    ("meta/seed", 1.5, "", "integer"),
    ("meta/seed", True, "", "integer"),
    ("meta/seed", 2**60, "", "9007199254740992"),
    ("meta/resamples", 99, "", "100 to 100000"),
    ("meta/resamples", 2**40, "", "100 to 100000"),
    ("meta/submissions", [], "", "at least one"),
    ("meta/submissions/0/sha256", "AB", "meta.submissions[0].sha256", "64 hexadecimal"),
    ("meta/submissions/0", 1, "meta.submissions[0]", "an object"),
    ("meta/submissions", [SHA] * 2, "items.chamfer", "each of the 2 runs"),
    ("meta/counts", {}, "", "rows_in_truth, rows_penalised, pixels"),
    ("meta/counts/rows_in_truth", "4", "", "integer"),
    ("meta/counts/rows_in_truth", 3, "", "more than 3"),
    ("meta/counts/rows_penalised", 5, "", "at most 4"),
    ("meta/truth_digest", KNOWN_TESTS[0].digest, "meta.counts.rows_in_truth", "8, as"),
]
WRONG_RUNS = [
    ("meta/submissions/1", RUNS["meta"]["submissions"][0], "meta.submissions", "once"),
    ("items/chamfer", [[0.1] * 4, [0.1] * 3], "", "as many entries in each run"),
    ("items/chamfer", [0.1] * 4, "", "each of the 2 runs"),
    ("items/chamfer/1", [0.1, 0.1, -1, 0.1], "items.chamfer[1][2]", "number from 0"),
]
WRONG_OBJECTS = [
    ("items/relief_iou", [0.1, 0.2, None, None], "items.relief_iou[2]", "other scores of relief"),
    ("items/relief_correlation", [-2, 0, 0, None], "items.relief_correlation[0]", "-1 to 1"),
    ("objects/row", [0, 0, 1], "objects.object", "3, as in row"),
    ("objects/row", [0, 0, 1, 9], "", "rows of items"),
    ("objects/row", GONE, "", "to be there"),
    ("objects/object", [1, 1, 1, 3], "", "each once"),
    ("objects/object", [1, 2, 1, 0], "objects.object[3]", "from 1 to 127"),
    ("objects/pixels", [20, 60, 15, 30], "objects.pixels[2]", "from 16"),
    ("objects/pixels", [20, 6000, 16, 30], "meta.counts.pixels", "at least 6000"),
    ("objects/shape", ["box", "cone", " x", "y"], "objects.shape[2]", "60 characters"),
    ("objects/shape", ["box", "cone", 3, "y"], "objects.shape[2]", "text"),
    ("objects/shape", "box", "", "a list"),
    ("objects/shape", ["box"] * 3, "", "4, as in row"),
    ("objects/object_completeness", [0, 0, 0, None], "", "numbers"),
    ("objects/object_recall_0.05", [0, 0, 0, 2], "objects.object_recall_0.05[3]", "0 to 1"),
    ("objects/chamfer", [0] * 4, "", "no key of this name"),
]
WRONG_QUESTIONS = [
    ("meta/resamples", 2000, "", "Wilson"),
    ("meta/counts/answers", 0, "", "2 or 3"),
    ("meta/counts/answers", GONE, "meta.counts", "answers"),
    ("meta/truth_digest", KNOWN_TESTS[0].digest, "", "ground truth of task 'iqtt'"),
    ("items/iqtt_accuracy", GONE, "", "to be there"),
    ("items/iqtt_accuracy", [1, 0, 1, 0.5], "", "0 or 1"),
    ("items/iqtt_accuracy", [1, 0, 1, 0], "answer_groups.by_distractor", "as in items"),
    ("alignment", "scale", "", "'none'"),
    ("objects", {"row": []}, "", "questions"),
    ("answer_groups/by_mood", {"good": GROUP}, "", "no key of this name"),
    ("answer_groups/by_distractor", {}, "", "at least one"),
    ("answer_groups/by_distractor/ x", GROUP, "answer_groups.by_distractor. x", "60 characters"),
    ("answer_groups/by_distractor/mirror/n", 5, "answer_groups.by_distractor", "as in items"),
    ("answer_groups/by_distractor/mirror/right", [5], "", "up to n"),
    ("answer_groups/by_distractor/mirror/right", [], "", "runs"),
    (
        "answer_groups/by_distractor/mirror/low",
        0.1,
        "answer_groups.by_distractor.mirror",
        "contains",
    ),
]
TABLES = (ROOMS, WRONG_ROOMS), (RUNS, WRONG_RUNS), (OBJECTS, WRONG_OBJECTS), (IQTT, WRONG_QUESTIONS)


@pytest.mark.parametrize(
    ("document", "place", "value", "where", "expected"),
    [(document, *wrong) for document, table in TABLES for wrong in table],
)
def test_each_fault_is_told_by_its_place(document, place, value, where, expected, tmp_path):
    error = refusal_of(tmp_path / "s.json", json.dumps(changed(document, place, value)))
    assert error[0] == (where or place.replace("/", "."))
    assert expected in error[2]


def meta_with(seed):
    return json.dumps(ROOMS).replace('"seed": 0', f'"seed": {seed}')


TEXTS = {
    "empty": (b"", "no JSON"),
    "a list": (b"[]", "a list of 0"),
    "cut": (json.dumps(ROOMS)[:500], "no JSON"),
    "more after it": (json.dumps(ROOMS) + "{}", "no JSON (Extra data"),
    "NaN": (meta_with("NaN"), "NaN"),
    "infinity": (meta_with("-Infinity"), "-Infinity"),
    "1e999": (json.dumps(ROOMS).replace('"chamfer": [0.1,', '"chamfer": [1e999,'), "inf"),
    "a key twice": ('{"task": 1, "task": 1}', "the key 'task' twice"),
    "too many keys": (json.dumps(dict.fromkeys(map(str, range(10_001)))), "an object of 10001"),
    "not UTF-8": (b'{"format": "\xff"}', "bytes that are not UTF-8"),
    "UTF-16": (json.dumps(ROOMS).encode("utf-16"), "bytes that are not UTF-8"),
    "deep": (b"[" * 100_000, "JSON that is nested too deeply"),
    "deep objects": (b'{"a":' * 100_000, "JSON that is nested too deeply"),
    "many digits": (b'{"format": ' + b"9" * 10_000 + b"}", "no JSON (Exceeds the limit"),
    "many lists": (b"[" + b"[]," * 8_000_000 + b"[]]", "JSON that may take"),
    "HDF5": (b"\x89HDF\r\n\x1a\n" + bytes(100), "an HDF5 file"),
}


@pytest.mark.parametrize(("text", "found"), TEXTS.values(), ids=TEXTS)
def test_text_that_is_no_score_file(text, found, tmp_path):
    assert refusal_of(tmp_path / "s.json", text)[1].startswith(found)


def test_what_is_not_comparable_says_why():
    whole = made_scores.simple_rooms()
    assert (whole.comparable, whole.warnings) == (True, ())
    counts = whole.meta.counts
    for meta, word in (
        ({"truth_given": False}, "--truth"),
        ({"counts": {**counts, "rows_in_truth": 5}}, "4 of 5"),
        ({"counts": {**counts, "rows_penalised": 1}}, "not finite"),
    ):
        other = replace(whole, meta=replace(whole.meta, **meta))
        assert not other.comparable
        assert word in other.warnings[0]


def test_what_a_file_says_is_cut_short_in_errors():
    error = refusal("k" * 10**6, "f" * 10**4, "e" * 10**4)
    assert max(map(len, (error.where, error.found, error.expected))) == LONGEST_SHOWN


def test_names_beyond_ascii_are_escaped(tmp_path):
    """One wide character would make the whole text take four times its memory when it is read."""
    other = read_again(made_scores.simple_rooms("Größe \U0001f600"), tmp_path)
    assert other.path.read_bytes().isascii()
    assert other.method == "Größe \U0001f600"

"""Score files that are broken in one way at a time: one clear line each, never a traceback."""

import copy
import json

import made_scores
import pytest
from refusals import refused

from metrics.score_file import JsonError, read_scores, to_json, write_scores
from metrics.scoring.known_tests import KNOWN_TESTS
from metrics.submissions.strict_json import LONGEST_SHOWN, refusal

ROOMS = json.loads(to_json(made_scores.simple_rooms(runs=2, noise_floors={"chamfer": 0.01})))
OBJECTS = json.loads(to_json(made_scores.rooms_with_objects()))
IQTT = json.loads(to_json(made_scores.iqtt_scores("m", [1, 0, 1, 1])))
GONE = object()


def changed(document, place, value):
    """The document with a value put at a place such as meta/seed, or taken away there."""
    found = copy.deepcopy(document)
    *way, last = place.split("/")
    holder = found
    for key in way:
        holder = holder[int(key) if isinstance(holder, list) else key]
    if value is GONE:
        del holder[last]
    else:
        holder[int(last) if isinstance(holder, list) else last] = value
    return found


def told(path, text):
    """The place, what was found and what was expected, as a reader says about this text."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    with pytest.raises(JsonError) as caught:
        read_scores(path)
    error = caught.value
    assert error.where.startswith(f"{path}")
    assert str(error).isprintable()
    assert len(str(error)) < 400 + len(str(path))
    return error.where.removeprefix(f"{path}").removeprefix(": "), error.found, error.expected


def every_place(document):
    """The place of each key and each member of a list, outside long columns."""
    for key, value in document.items() if isinstance(document, dict) else enumerate(document):
        yield str(key)
        if isinstance(value, (dict, list)):
            yield from (f"{key}/{rest}" for rest in every_place(value))


@pytest.mark.parametrize("document", [ROOMS, IQTT, OBJECTS], ids=["rooms", "iqtt", "objects"])
def test_any_value_anywhere_is_refused_in_one_line_or_can_be_written_again(document, tmp_path):
    """Every place of a file, with every kind of wrong value in it."""
    path, refused, taken = tmp_path / "s.json", [], []
    for place in every_place(document):
        for value in (None, True, -1, 1e300, "x", [], {}, [[]], GONE):
            if value is GONE and place.rpartition("/")[2].isdecimal():
                continue
            path.write_text(json.dumps(changed(document, place, value)))
            try:
                found = read_scores(path)
            except JsonError as error:
                refused.append(str(error))
            else:
                taken.append(place)
                write_scores(found, tmp_path / "again.json", overwrite=True)
                assert to_json(read_scores(tmp_path / "again.json")) == to_json(found)
    assert all(line.isprintable() and line.startswith(f"{path}: ") for line in refused)
    assert len(refused) > 4 * len(taken)


ROW = "items/row"
LOW, HIGH = (ROOMS["metrics"]["chamfer"][end] for end in ("low", "high"))
# What is put where, then where the reader finds fault (if not there), what it found and expected.
WRONG = [
    ("format", GONE, "", "no such key", "to be there"),
    ("format", "pix2shape-bench/rooms", "", "'pix2shape-bench/rooms'", "'pix2shape-bench/scores'"),
    ("format_version", "1.0", "", "'1.0'", "3.x"),
    ("format_version", "4.0", "", "'4.0'", "3.x"),
    ("task", "room", "", "'room'", "'rooms' or 'iqtt'"),
    ("task", ["rooms"], "", "a list of 1", "'rooms' or 'iqtt'"),
    ("method", 3, "", "3", "text"),
    ("method", "m" * 201, "", f"{'m' * 201!r:.60}", "at most 200"),
    ("method", "\ud800", "", r"'\ud800'", "unicode"),
    ("comparable", 1, "", "1", "boolean"),
    ("comparable", GONE, "", "no such key", "to be there"),
    ("alignment", "affine", "", "'affine'", "'none', 'median_scale', 'scale' or 'scale_shift'"),
    ("metrics", {}, "", "an object of 0", "at least one"),
    ("metrics/chamfer", [], "", "a list of 0", "an object"),
    ("metrics/cd", ROOMS["metrics"]["chamfer"], "", "no score of task 'rooms'", "docs/scores.md"),
    ("metrics/iqtt_accuracy", ROOMS["metrics"]["chamfer"], "", "no score of task 'rooms'", "docs"),
    ("metrics/chamfer/value", None, "", "null", "number"),
    ("metrics/chamfer/value", -0.1, "", "-0.1", "a number from 0"),
    ("metrics/chamfer/value", 0.3, "", f"0.3 outside of {LOW} to {HIGH}", "within its interval"),
    ("metrics/chamfer/value", 0.21, "", "0.21", "0.2, the mean of items.chamfer"),
    ("metrics/chamfer/value", 10**400, "", "a huge whole number", "number"),
    ("metrics/f_score_0.05/value", 1.5, "", "1.5", "from 0 to 1"),
    ("metrics/chamfer/unit", "m", "", "'m'", "'scene unit'"),
    ("metrics/chamfer/low", None, "metrics.chamfer", "one end of an interval", "both"),
    (
        "metrics/chamfer/low",
        9.0,
        "metrics.chamfer.value",
        f"0.2 outside of 9.0 to {HIGH}",
        "within",
    ),
    (
        "by_view_angle/5/chamfer/low",
        0.01,
        "by_view_angle.5.chamfer",
        "one end of an interval",
        "both",
    ),
    ("metrics/chamfer/n", 0, "", "0", "equal to 1"),
    ("metrics/chamfer/n", 3, "", "3", "at most 2, the number of scenes"),
    ("metrics/chamfer/n", 1, "", "1", "2, as in items"),
    ("metrics/chamfer/n", 2.0, "", "2.0", "integer"),
    ("metrics/chamfer/std", -1, "", "-1", "equal to 0"),
    ("metrics/chamfer/std", True, "", "true", "number"),
    ("metrics/chamfer/more", 1, "", "an unknown key", "no key of this name"),
    ("by_view_angle/5.0", {}, "", "'5.0'", "[0-9]{1,3}"),
    ("by_distractor", {}, "", "an unknown key", "no key of this name"),
    (ROW, GONE, "", "no such key", "to be there"),
    (ROW, [0, 1, 2], "items.scene_index", "4 entries", "3, as in row"),
    (ROW, [0, 1, 2, 2], "", "2 twice", "each once"),
    (ROW, [0, 1, 2, -3], "items.row[3]", "-3", "whole number from 0"),
    (ROW, [0, 1, 2, 3.0], "items.row[3]", "3.0", "whole number from 0"),
    (ROW, [0, 1, 2, None], "items.row[3]", "null", "whole number from 0"),
    (ROW, [0, 1, 2, 2**53 + 1], "items.row[3]", "9007199254740993", "to 9.0072e+15"),
    (ROW, [0, 1, 2, 10**30], "items.row[3]", "a huge whole number", "whole number from 0"),
    ("items/chamfer", [0.1, 0.2], "", "2 entries", "4, as in row"),
    ("items/chamfer", [0.1, 0.3, 0.2, "x"], "items.chamfer[3]", "'x'", "finite number"),
    ("items/chamfer", [0.1, 0.3, 0.2, "1"], "items.chamfer[3]", "'1'", "finite number"),
    ("items/chamfer", [0.1, 0.3, 0.2, True], "items.chamfer[3]", "true", "finite number"),
    ("items/chamfer", [0.1, 0.3, 0.2, [1]], "items.chamfer[3]", "a list of 1", "finite number"),
    ("items/chamfer", [0.1, 10**400], "items.chamfer[1]", "a huge whole number", "finite number"),
    ("items/chamfer", [0.1, -0.3, 0.2, 0.2], "items.chamfer[1]", "-0.3", "number from 0"),
    ("items/f_score_0.05", [0.5, 0.25, 1, 1.5], "items.f_score_0.05[3]", "1.5", "from 0 to 1"),
    ("items/chamfer", [1e308] * 4, "metrics.chamfer.value", "0.2", "inf, the mean"),
    ("items/chamfer", [0.1, 0.3, 0.2, None], "", "null", "metrics.chamfer is their mean"),
    ("items/hausdorff", GONE, "", "no such key", "the column of metrics.hausdorff"),
    ("items/chamfer", 0.1, "", "0.1", "a list of numbers"),
    ("items/note", [0, 0, 0, 0], "", "no score of task 'rooms'", "docs/scores.md"),
    ("meta/truth_fingerprint", " ", "", "' '", "not blank"),
    ("meta/seed", 1.5, "", "1.5", "integer"),
    ("meta/seed", True, "", "true", "integer"),
    ("meta/seed", 2**60, "", f"{2**60}", "9007199254740992"),
    ("meta/seed", -1, "", "-1", "equal to 0"),
    ("meta/confidence", 1, "", "1", "equal to 0.999"),
    ("meta/resamples", 99, "", "99", "100 to 100000"),
    ("meta/resamples", 2**40, "", f"{2**40}", "100 to 100000"),
    ("meta/truth_digest", "AB", "", "'AB'", "64 hexadecimal"),
    ("meta/truth_source", "me", "", "'me'", "'given', 'known' or 'submission'"),
    ("meta/truth_source", "known", "", "'known'", "given, or submission"),
    ("meta/truth_digest", KNOWN_TESTS[0].digest, "meta.counts.rows_in_truth", "4", "8, as"),
    ("meta/truth_source", "submission", "comparable", "true", "false, as only the submission"),
    ("meta/warnings", ["not comparable: x"], "comparable", "true", "false, as meta.warnings"),
    ("meta/submissions", [], "", "a list of 0", "at least one"),
    ("meta/submissions/0/sha256", "AB", "meta.submissions[0].sha256", "'AB'", "64 hexadecimal"),
    ("meta/submissions/0", 1, "meta.submissions[0]", "1", "an object"),
    ("meta/counts/rows", "4", "", "'4'", "integer"),
    ("meta/counts/rows", 5, "", "5", "4, as in items"),
    ("meta/counts/rows", GONE, "", "no such key", "4, as in items"),
    ("meta/counts/scenes", 4, "", "4", "2, as in items"),
    ("meta/counts/runs", 1, "", "1", "2, as in items"),
    ("meta/counts/rows_in_truth", 3, "", "3", "more than 3"),
    ("meta/counts/rows_in_truth", 5, "comparable", "true", "false, as 4 of 5 are scored"),
    ("meta/counts/rows_penalised", 1, "comparable", "true", "false, as rows are penalised"),
    ("meta/counts/rows_penalised", 5, "", "5", "at most 4"),
    ("meta/warnings", "none", "", "'none'", "a list"),
    ("\x1b[31m\n", 1, r"\x1b[31m", "an unknown key", "no key of this name"),
]


SAME = ROOMS["meta"]["submissions"][:1]
WRONG += [
    ("meta/submissions", SAME, "meta.counts.runs", "2", "1, as in items"),
    ("meta/submissions", SAME * 2, "", "the same sha256 twice", "each submission once"),
    ("path", "s.json", "", "an unknown key", "no key of this name"),
]
WRONG_QUESTIONS = [
    ("metrics/iqtt_accuracy/std", 0.1, "", "0.1", "one run"),
    ("meta/resamples", 2000, "", "2000", "Wilson"),
    ("meta/counts/answers", 0, "", "0", "2 or 3"),
    ("meta/counts/answers", GONE, "", "no such key", "2 or 3"),
    ("by_distractor", {"other": {}}, "by_distractor.other", "no score", "at least one"),
    ("meta/counts/questions", 3, "", "3", "4, as in items"),
    ("meta/counts/questions_in_truth", 5, "comparable", "true", "false, as 4 of 5 are scored"),
    ("items/iqtt_accuracy", [1, 0, 1, 0.5], "", "0.5", "0 or 1"),
    ("alignment", "scale", "", "'scale'", "'none'"),
    ("by_view_angle", {}, "", "an unknown key", "no key of this name"),
    ("meta/noise_floors", {}, "", "an unknown key", "no key of this name"),
]


SKILL = OBJECTS["skills"]["chamfer"]
WRONG_OBJECTS = [
    ("skills/chamfer/value", 0.5, "", "0.5", "0.333"),
    ("skills/chamfer/value", 1.5, "", "1.5", "equal to 1"),
    ("skills/chamfer/low", 0.4, "skills.chamfer.value", f"{SKILL['value']!r} outside", "within"),
    ("skills/chamfer/low", None, "skills.chamfer", "one end of an interval", "both"),
    ("skills/chamfer/floor", 0.4, "", "0.4", "the mean of items.empty_room_chamfer"),
    ("skills/chamfer/floor", -1.0, "", "-1.0", "a number from 0"),
    ("skills/chamfer/floor_name", "mine", "", "'mine'", "'empty_room_chamfer'"),
    ("skills/relief_iou", SKILL, "skills.relief_iou.floor_name", "'empty_room_chamfer'", "other"),
    ("skills/rmse", SKILL, "", "the skill of no score", "metrics.rmse"),
    ("skills/object_recall_0.02", SKILL, "", "a score without skill", "one of relief"),
    ("skills/mine", SKILL, "", "no score of task 'rooms'", "docs"),
    ("items/empty_room_chamfer", GONE, "", "no such key", "skills.chamfer.floor"),
    ("items/object_recall_0.02", [0.5, 0, 0, 0], "items.object_recall_0.02[3]", "a number", "null"),
    ("items/object_completeness", [None] * 4, "items.object_completeness[0]", "null", "a number"),
    ("items/relief_iou", [0.1, 0.2, None, None], "items.relief_iou[2]", "null", "a number"),
    ("items/relief_correlation", [-2, 0, 0, None], "items.relief_correlation[0]", "-2", "-1 to 1"),
    ("metrics/relief_correlation/value", -1.5, "", "-1.5", "from -1 to 1"),
    ("metrics/relief_iou/n", 1, "", "1", "2, as in items"),
    ("objects/row", [0, 0, 1], "objects.object", "4 entries", "3, as in row"),
    ("objects/row", [0, 0, 1, 9], "objects.row[3]", "9", "a row of items"),
    ("objects/row", GONE, "", "no such key", "to be there"),
    ("objects/object", [1, 1, 1, 3], "", "1 twice in row 0", "each once"),
    ("objects/object", [1, 2, 1, 0], "objects.object[3]", "0", "from 1 to 127"),
    ("objects/pixels", [20, 60, 15, 30], "objects.pixels[2]", "15", "from 16"),
    ("objects/pixels", [20, 6000, 16, 30], "meta.counts.pixels", "4096", "at least 6020"),
    ("objects/shape", ["box", "cone", " x", "y"], "objects.shape[2]", "' x'", "60 characters"),
    ("objects/shape", ["box", "cone", 3, "y"], "objects.shape[2]", "3", "60 characters"),
    ("objects/shape", "box", "", "'box'", "a list of texts"),
    ("objects/shape", ["box"] * 3, "", "3 entries", "4, as in row"),
    ("objects/object_completeness", [0, 0, 0, None], "", "null", "numbers"),
    ("objects/object_recall_0.05", [0, 0, 0, 2], "objects.object_recall_0.05[3]", "2", "0 to 1"),
    ("objects/chamfer", [0] * 4, "", "no score of single objects", "object_depth_error"),
    ("by_object_size/small", {}, "", "'small'", "[0-9]{1,3}"),
    ("meta/counts/objects", 5, "", "5", "4, as in items"),
    ("meta/counts/rows_without_objects", 0, "", "0", "1, as in items"),
    (
        "meta/noise_floors",
        {"mine": 1},
        "meta.noise_floors.mine",
        "no score of task 'rooms'",
        "docs",
    ),
]
WRONG_QUESTIONS += [("objects", {}, "", "an unknown key", "no key of this name")]


@pytest.mark.parametrize(
    ("document", "place", "value", "where", "found", "expected"),
    [
        *((ROOMS, *wrong) for wrong in WRONG),
        *((IQTT, *wrong) for wrong in WRONG_QUESTIONS),
        *((OBJECTS, *wrong) for wrong in WRONG_OBJECTS),
    ],
)
def test_each_fault_is_told_by_its_place(document, place, value, where, found, expected, tmp_path):
    error = told(tmp_path / "s.json", json.dumps(changed(document, place, value)))
    assert error[0] == (where or place.replace("/", "."))
    assert error[1] == found or (found.endswith("outside") and error[1].startswith(found))
    assert expected in error[2]


def meta_with(seed):
    return json.dumps(ROOMS).replace('"seed": 0', f'"seed": {seed}')


TEXTS = {
    "empty": (b"", "", "no JSON"),
    "a number": (b"3", "", "3"),
    "a list": (b"[]", "", "a list of 0"),
    "cut": (json.dumps(ROOMS)[:500], "", "no JSON"),
    "more after it": (json.dumps(ROOMS) + "{}", "", "no JSON (Extra data"),
    "NaN": (meta_with("NaN"), "", "NaN"),
    "infinity": (meta_with("-Infinity"), "", "-Infinity"),
    "1e999": (json.dumps(ROOMS).replace("[0.1, 0.3,", "[1e999, 0.3,"), "items.chamfer[0]", "inf"),
    "a key twice": ('{"task": 1, "task": 1}', "", "the key 'task' twice"),
    "too many keys": (json.dumps(dict.fromkeys(map(str, range(10_001)))), "", "an object of 10001"),
    "not UTF-8": (b'{"format": "\xff"}', "", "bytes that are not UTF-8"),
    "UTF-16": (json.dumps(ROOMS).encode("utf-16"), "", "bytes that are not UTF-8"),
    "deep": (b"[" * 100_000, "", "JSON that is nested too deeply"),
    "deep objects": (b'{"a":' * 100_000, "", "JSON that is nested too deeply"),
    "many digits": (b'{"format": ' + b"9" * 10_000 + b"}", "", "no JSON (Exceeds the limit"),
    "many lists": (b"[" + b"[]," * 8_000_000 + b"[]]", "", "JSON that may take"),
    "HDF5": (b"\x89HDF\r\n\x1a\n" + bytes(100), "", "an HDF5 file"),
}


@pytest.mark.parametrize(("text", "where", "found"), TEXTS.values(), ids=TEXTS)
def test_text_that_is_no_score_file(text, where, found, tmp_path):
    error = told(tmp_path / "s.json", text)
    assert error[0] == where
    assert error[1].startswith(found)


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_files_of_older_formats_are_scored_again(version, tmp_path):
    path = tmp_path / "s.json"
    path.write_text(json.dumps(changed(ROOMS, "format_version", version)))
    with refused(JsonError, "format_version", hint="score the submission again"):
        read_scores(path)


def test_what_a_file_says_is_cut_short_in_errors():
    error = refusal("k" * 10**6, "f" * 10**4, "e" * 10**4)
    assert max(map(len, (error.where, error.found, error.expected))) == LONGEST_SHOWN

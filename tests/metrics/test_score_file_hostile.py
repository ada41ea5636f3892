"""Score files that are broken, one way at a time: one clear line each, and never a traceback."""

import copy
import json

import made_scores
import pytest

from metrics.score_file import JsonError, read_scores, to_json, write_scores

ROOMS = json.loads(to_json(made_scores.simple_rooms(runs=2, chamfer_floor=0.01)))
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
    """What a reader says about a file with this text."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    with pytest.raises(JsonError) as caught:
        read_scores(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert line.isprintable()
    assert len(line) < 400 + len(str(path))
    return line.removeprefix(f"{path}: ")


def every_place(document):
    """The place of each key and each member of a list, outside long columns."""
    for key, value in document.items() if isinstance(document, dict) else enumerate(document):
        yield str(key)
        if isinstance(value, (dict, list)):
            yield from (f"{key}/{rest}" for rest in every_place(value))


@pytest.mark.parametrize("document", [ROOMS, IQTT], ids=["rooms", "iqtt"])
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


WRONG = [
    ("format", GONE, "found no key 'format', expected a file of format 'pix2shape-bench/scores'"),
    ("format", "pix2shape-bench/rooms", "format: found 'pix2shape-bench/rooms', expected 'pix2sha"),
    ("format_version", "2.0", "format_version: found '2.0', expected 1.x"),
    ("task", "room", "task: found 'room', expected 'rooms' or 'iqtt'"),
    ("task", ["rooms"], "task: found a list of 1, expected 'rooms' or 'iqtt'"),
    ("method", 3, "method: found 3, expected a text"),
    ("method", "x" * 201, "method: found a text of 201 characters, expected at most 200"),
    ("method", "\ud800", "method: found half of a surrogate pair, expected valid Unicode"),
    ("comparable", 1, "comparable: found 1, expected true or false"),
    ("comparable", GONE, "comparable: found no such key, expected it to be there"),
    ("alignment", "affine", "alignment: found 'affine', expected 'none' or 'median_scale' or"),
    ("metrics", {}, "metrics: found an object of 0, expected at least one score"),
    ("metrics/chamfer", [], "metrics.chamfer: found a list of 0, expected an object"),
    (
        "metrics/cd",
        {},
        "metrics.cd: found no score of task 'rooms', expected a name listed in docs",
    ),
    ("metrics/iqtt_accuracy", {}, "metrics.iqtt_accuracy: found no score of task 'rooms'"),
    ("metrics/chamfer/value", None, "metrics.chamfer.value: found null, expected a finite number"),
    ("metrics/chamfer/value", -0.1, "metrics.chamfer.value: found -0.1, expected a number from 0"),
    ("metrics/chamfer/value", 0.3, "metrics: found chamfer.value 0.3, expected 0.2"),
    ("metrics/chamfer/value", 10**400, "chamfer.value: found a huge whole number, expected a fin"),
    (
        "metrics/f_score_0.05/value",
        1.5,
        "f_score_0.05.value: found 1.5, expected a number from 0 t",
    ),
    ("metrics/chamfer/unit", "m", "metrics.chamfer.unit: found 'm', expected 'scene unit'"),
    (
        "metrics/chamfer/low",
        None,
        "metrics.chamfer: found one end, expected both ends of the inter",
    ),
    ("metrics/chamfer/low", 9.0, "metrics.chamfer: found low 9.0 and high 0.2"),
    ("metrics/chamfer/n", 0, "metrics.chamfer.n: found 0, expected a whole number from 1 to 4"),
    ("metrics/chamfer/n", 2.0, "metrics.chamfer.n: found 2.0, expected a whole number from 1 to 4"),
    ("metrics/chamfer/std", -1, "metrics.chamfer.std: found -1, expected a number from 0"),
    ("metrics/chamfer/std", True, "metrics.chamfer.std: found true, expected a finite number"),
    ("metrics/chamfer/more", 1, "metrics.chamfer.more: found this key, expected no key but value"),
    ("by_view_angle/5.0", {}, "by_view_angle.5.0: found '5.0', expected whole degrees as key"),
    ("by_distractor", {}, "by_distractor: found this key, expected no key but format,"),
    ("items/row", GONE, "items: found none of that name, expected the column 'row'"),
    ("items/row", [0, 1, 2], "items: found a column scene_index of 4, expected columns of equal"),
    ("items/row", [0, 1, 2, 2], "items: found row 2 twice, expected each row once"),
    ("items/row", [0, 1, 2, -3], "items.row[3]: found -3, expected a whole number from 0 to"),
    ("items/row", [0, 1, 2, 3.0], "items.row[3]: found 3.0, expected a whole number"),
    ("items/row", [0, 1, 2, 10**30], "items.row[3]: found a huge whole number, expected a whole"),
    ("items/chamfer", [0.1, 0.2], "items: found a column chamfer of 2, expected columns of equal"),
    ("items/chamfer", [0.1, 0.3, 0.2, "x"], "items.chamfer[3]: found 'x', expected a number"),
    ("items/chamfer", [0.1, 0.3, 0.2, True], "items.chamfer[3]: found true, expected a number"),
    ("items/chamfer", [0.1, -0.3, 0.2, 0.2], "items.chamfer[1]: found -0.3, expected a number fro"),
    ("items/f_score_0.05", [0.5, 0.25, 1, 1.5], "5[3]: found 1.5, expected a number from 0 to 1"),
    ("items/chamfer", 0.1, "items.chamfer: found 0.1, expected a list of numbers"),
    (
        "items/note",
        [0, 0, 0, 0],
        "items.note: found no score of task 'rooms', expected a name list",
    ),
    ("meta/truth_fingerprint", " ", "meta.truth_fingerprint: found ' ', expected a text that is n"),
    ("meta/seed", 1.5, "meta.seed: found 1.5, expected a whole number from"),
    ("meta/seed", True, "meta.seed: found true, expected a whole number from"),
    ("meta/confidence", 1, "meta.confidence: found 1, expected a number between 0 and 1"),
    ("meta/submissions", [], "meta.submissions: found a list of 0, expected at least one submiss"),
    ("meta/submissions/0/sha256", "AB", "meta.submissions[0].sha256: found 'AB', expected 64 hexa"),
    ("meta/submissions/0", 1, "meta.submissions[0]: found 1, expected an object"),
    ("meta/counts/images", "4", "meta.counts.images: found '4', expected a whole number from 0 to"),
    ("meta/warnings", "none", "meta.warnings: found 'none', expected a list"),
    ("\x1b[31m\n", 1, "\ufffd[31m : found this key, expected no key but"),
]


@pytest.mark.parametrize(("place", "value", "expected"), WRONG)
def test_each_fault_has_its_line(place, value, expected, tmp_path):
    assert expected in told(tmp_path / "s.json", json.dumps(changed(ROOMS, place, value)))


def test_runs_and_single_answers_agree(tmp_path):
    path = tmp_path / "s.json"
    one = changed(ROOMS, "meta/submissions", ROOMS["meta"]["submissions"][:1])
    assert "std: found 0.002, expected null, as there is one run" in told(path, json.dumps(one))
    twice = changed(ROOMS, "meta/submissions", ROOMS["meta"]["submissions"][:1] * 2)
    assert "expected each submission once" in told(path, json.dumps(twice))
    answers = changed(IQTT, "items/iqtt_accuracy", [1, 0, 1, 0.5])
    assert "found an iqtt_accuracy of 0.5, expected 0 or 1 for one run" in told(
        path, json.dumps(answers)
    )
    aligned = json.dumps(changed(IQTT, "alignment", "scale"))
    assert "alignment: found 'scale', expected 'none'" in told(path, aligned)


TEXTS = {
    "empty": (b"", "no JSON"),
    "a number": (b"3", "found 3, expected an object"),
    "a list": (b"[]", "found a list of 0, expected an object"),
    "cut": (json.dumps(ROOMS)[:500], "found no JSON"),
    "more after it": (json.dumps(ROOMS) + "{}", "no JSON (Extra data"),
    "NaN": (
        json.dumps(ROOMS).replace('"seed": 0', '"seed": NaN'),
        "found NaN, expected finite num",
    ),
    "infinity": (json.dumps(ROOMS).replace('"seed": 0', '"seed": -Infinity'), "found -Infinity"),
    "1e999": (
        json.dumps(ROOMS).replace("[0.1, 0.3,", "[1e999, 0.3,"),
        "items.chamfer[0]: found inf",
    ),
    "a key twice": ('{"task": 1, "task": 1}', "found the key 'task' twice, expected each key once"),
    "not UTF-8": (b'{"format": "\xff"}', "found bytes that are not UTF-8"),
    "UTF-16": (json.dumps(ROOMS).encode("utf-16"), "found bytes that are not UTF-8"),
    "deep": (b"[" * 100_000, "found JSON that is nested too deeply"),
    "deep objects": (b'{"a":' * 100_000, "found JSON that is nested too deeply"),
    "many digits": (b'{"format": ' + b"9" * 10_000 + b"}", "found no JSON (Exceeds the limit"),
    "HDF5": (b"\x89HDF\r\n\x1a\n" + bytes(100), "found an HDF5 file, expected JSON"),
}


@pytest.mark.parametrize(("text", "expected"), TEXTS.values(), ids=TEXTS)
def test_text_that_is_no_score_file(text, expected, tmp_path):
    assert expected in told(tmp_path / "s.json", text)

"""The broken submissions of `broken` that answer questions, in HDF5 and in JSON."""

import h5py
import numpy as np
from h5_edits import attribute, gone, in_all, linked, put, replaced
from submissions import answers_edited, answers_kept, as_json, huge_json, raw

ANSWERS_OPEN = [
    ("no questions", ["question", "no such dataset"], answers_edited(gone("question"))),
    ("neither answer nor scores", ["answer: neither"], answers_edited(gone("answer", "scores"))),
    ("answer and scores disagree", ["answer", "other than scores say", "ids 2)"], answers_edited(
        put("answer", 2, 0))),
    ("an answer of 3", ["answer", "1 outside -1 to 2, such as 3", "ids 4)"], answers_edited(
        in_all(gone("scores"), put("answer", 4, 3)))),
    ("an answer of -2", ["answer", "such as -2"], answers_edited(
        in_all(gone("scores"), put("answer", 4, -2)))),
    ("answers are floats", ["answer", "float32", "expected integers"], answers_edited(
        replaced("answer", lambda v: v.astype("f4")))),
    ("answers are letters", ["answer", "type text"], answers_edited(
        replaced("answer", lambda v: list("abccba")))),
    ("a score of NaN", ["scores", "NaN", "ids 1)"], answers_edited(
        put("scores", (1, 2), np.nan))),
    ("an infinite score", ["scores", "infinite", "ids 5)"], answers_edited(
        put("scores", (5, 0), np.inf))),
    ("scores for four", ["scores", "shape (6, 4)", "(M, 3)"], answers_edited(
        replaced("scores", lambda v: np.zeros((6, 4))))),
    ("scores are an external link", ["scores: a link"], answers_edited(
        linked("scores", h5py.ExternalLink("other.h5", "/scores")))),
    ("fewer answers than questions", ["answer: 4 rows", "expected 6"], answers_edited(
        replaced("answer", lambda v: v[:4]))),
    ("a question twice", ["question", "more than once"], answers_edited(put("question", 3, 0))),
]  # fmt: skip


ANSWERS_MATCH = [
    ("questions missing", ["question: 2 of 6 missing", "ids 4, 5)"], answers_edited(
        answers_kept(4))),
    ("a question unknown", ["question", "does not have", "ids 77)"], answers_edited(
        put("question", 3, 77))),
    ("other questions", ["truth_fingerprint"], answers_edited(
        attribute("truth_fingerprint", "f" * 64))),
]  # fmt: skip


JSON_OPEN = [
    ("JSON: malformed", ["no JSON"], as_json("[0, 1, 2")),
    ("JSON: empty", ["no JSON"], as_json("")),
    ("JSON: nested deeply", ["nested too deeply"], as_json("[" * 200_000)),
    ("JSON: nested", ["expected 0, 1, 2"], as_json([[0], [1], [2], [0], [1], [2]])),
    ("JSON: NaN", ["NaN"], as_json("[0, 1, NaN, 0, 1, 2]")),
    ("JSON: infinity", ["inf"], as_json("[0, 1, 1e999, 0, 1, 2]")),
    ("JSON: floats", ["1.0", "ids 1)"], as_json("[0, 1.0, 2, 0, 1, 2]")),
    ("JSON: booleans", ["True", "ids 0)"], as_json("[true, 1, 2, 0, 1, 2]")),
    ("JSON: null", ["None"], as_json("[null, 1, 2, 0, 1, 2]")),
    ("JSON: texts", ["'0'", "ids 0, 1"], as_json(["0", "1", "2", "0", "1", "2"])),
    ("JSON: out of range", ["outside -1 to 2, such as 3", "ids 5)"], as_json([0, 1, 2, 0, 1, 3])),
    ("JSON: a huge number", ["ids 0)"], as_json([10**30, 1, 2, 0, 1, 2])),
    ("JSON: a number of 5000 digits", ["no JSON"], as_json("[" + "1" * 5000 + "]")),
    ("JSON: no answers", ["no rows"], as_json([])),
    ("JSON: no answers in an object", ["no rows"], as_json({})),
    ("JSON: a number", ["int, neither a list nor an object"], as_json(7)),
    ("JSON: a key twice", ["the key '1' twice"], as_json('{"0": 1, "1": 2, "1": 0}')),
    ("JSON: a key that is no number", ["the key 'one'"], as_json({"one": 1})),
    ("JSON: a key with zeros", ["the key '01'"], as_json({"01": 1})),
    ("JSON: a negative key", ["the key '-1'"], as_json({"-1": 1})),
    ("JSON: a key beyond all", ["the key '99999999999'"], as_json({"99999999999": 1})),
    ("JSON: an unknown key", ["the key 'model'"], as_json({"answers": [0] * 6, "model": "x"})),
    ("JSON: answers are a text", ["str, neither"], as_json({"answers": "012012"})),
    ("JSON: method is a number", ["method 7"], as_json({"answers": [0] * 6, "method": 7})),
    ("JSON: method is empty", ["method", "empty"], as_json({"answers": [0] * 6, "method": ""})),
    ("JSON: method of half a character", ["method", r"\ud800"], as_json(
        '{"answers": [0, 0, 0, 0, 0, 0], "method": "\\ud800"}')),
    ("JSON: not UTF-8", ["no JSON"], raw(b'["\xff\xfe"]', "answers.json")),
    ("JSON: binary", ["no JSON"], raw(b"\x00\x01\x02" * 100, "answers.json")),
    ("JSON: 40 MB", ["40000000 bytes"], huge_json),
]  # fmt: skip


JSON_MATCH = [
    ("JSON: too few", ["question: 2 of 6 missing", "ids 4, 5)"], as_json([0, 1, 2, 0])),
    ("JSON: too many", ["1 that the truth does not have", "ids 6)"], as_json([0] * 7)),
    ("JSON: a question left out", ["1 of 6 missing", "ids 3)"], as_json(
        {"answers": {"0": 0, "1": 1, "2": 2, "4": -1, "5": 1}, "method": "m"})),
]  # fmt: skip

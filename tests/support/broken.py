"""A corpus of broken submissions, made in code from good ones.

Each `Case` builds one file: a table says how to edit a good one, or, if its name ends in
FILES, has the builder itself. `stage` says what finds the fault:

- "open": opening, without any truth;
- "match": holding it against the truth;
- "values": reading its pixels;
- "hint": nothing, as the file is valid; `validate` gives a hint. Not to be refused by scoring.

`task` says which truth it is made for, `names_truth` whether that is recorded inside (JSON cannot).
All but hints must end with exit code 2 and one line that has all `words`.
"""

from dataclasses import dataclass

import h5py
import numpy as np
import submissions as made
from h5_edits import (
    attribute,
    claims,
    damaged_chunk,
    gone,
    grouped,
    in_all,
    linked,
    put,
    replaced,
    values,
)


@dataclass(frozen=True)
class Case:
    name: str
    stage: str
    words: tuple[str, ...]
    build: made.Build
    task: str = "rooms"
    names_truth: bool = True

    def __str__(self) -> str:
        return self.name


OPEN_FILES = [
    ("missing", ["no such file"], made.missing),
    ("folder", ["is a folder"], made.folder_itself),
    ("fifo", ["not a regular file"], made.fifo),
    ("empty file", ["not a readable HDF5 file"], made.raw(b"")),
    ("text file", ["not a readable HDF5 file"], made.raw(b"depth,1,2,3\n" * 99)),
    ("numpy file", ["not a readable HDF5 file"], made.raw(b"\x93NUMPY\x01\x00" + bytes(500))),
    ("signature only", ["not a readable HDF5 file"], made.raw(b"\x89HDF\r\n\x1a\n" + bytes(500))),
    ("truncated early", ["not a readable HDF5 file"], made.truncated(0.05)),
    ("truncated late", ["not a readable HDF5 file"], made.truncated(0.95)),
    ("the truth itself", ["a file of rooms, not a submission"], made.truth_itself),
    ("an external link to a fifo", ["depth", "a link to the file", "pipe.h5"], made.linked_to_fifo),
    ("values in a raw file", ["depth", "in another file"], made.elsewhere),
]  # fmt: skip

OPEN = [
    ("no attributes", ["format", "no such root attribute"],
     lambda file: [file.attrs.pop(name) for name in list(file.attrs)]),
    ("other format", ["'mine'", "'pix2shape-bench/predictions'"], attribute("format", "mine")),
    ("newer version", ["format_version", "'2.0'", "expected '1.0'"],
     attribute("format_version", "2.0")),
    ("no version", ["format_version", "no such root attribute"], gone("format_version")),
    ("version is a number", ["format_version", "float64"], attribute("format_version", 1.0)),
    ("no task", ["task", "no such root attribute"], gone("task")),
    ("other task", ["task", "'chairs'", "'rooms' or 'iqtt'"], attribute("task", "chairs")),
    ("task of the other kind", ["question", "no such dataset", "'depth'"],
     attribute("task", "iqtt")),
    ("no method", ["method", "no such root attribute"], gone("method")),
    ("empty method", ["method", "empty"], attribute("method", "")),
    ("method that moves the cursor", ["method", r"'\x1b'"], attribute("method", "\x1b[2Jmine")),
    ("method of great length", ["method", "30000 characters"],
     lambda file: file.attrs.update({"method": "m" * 30_000})),
    ("method is a list", ["method", "expected a text"], attribute("method", ["one", "two"])),
    ("run is a number", ["run", "expected a text"], attribute("run", 3)),
    ("two kinds of geometry", ["disparity", "in addition to depth"],
     lambda file: file.update({"disparity": file["depth"][()]})),
    ("a lens of 200 degrees", ["fov_y_degrees", "outside"],
     lambda file: file.update({"fov_y_degrees": np.full(8, 200.0)})),
    ("unknown alignment", ["alignment", "'affine'", "'scale_shift'"],
     attribute("alignment", "affine")),
    ("no fingerprint", ["truth_fingerprint", "no such root attribute"], gone("truth_fingerprint")),
    ("empty fingerprint", ["truth_fingerprint", "empty"], attribute("truth_fingerprint", "")),
    ("no rows", ["row", "no such dataset"], gone("row")),
    ("no depth", ["depth", "no such dataset", "'normal'"], gone("depth")),
    ("depth under another name", ["depth", "no such dataset", "'depths'"],
     lambda file: file.move("depth", "depths")),
    ("depth is a group", ["depth", "a group"], grouped("depth")),
    ("row is a group", ["row", "a group"], grouped("row")),
    ("depth is a named type", ["depth", "a datatype"], linked("depth", np.dtype("f4"))),
    ("depth is one number", ["depth", "shape ()"], replaced("depth", lambda v: 1.5)),
    ("depth is nothing", ["depth", "shape None"], replaced("depth", lambda v: h5py.Empty("f4"))),
    ("depth has a channel", ["depth", "shape (8, 32, 32, 1)"],
     replaced("depth", lambda v: v[..., None])),
    ("depth is flat", ["depth", "shape (8, 1024)"], replaced("depth", lambda v: v.reshape(8, -1))),
    ("depth without pixels", ["depth", "shape (8, 0, 32)"], replaced("depth", lambda v: v[:, :0])),
    ("depth in whole numbers", ["depth", "uint16", "expected floats"],
     replaced("depth", lambda v: (1000 * v).astype("u2"))),
    ("depth is true or false", ["depth", "type bool"], replaced("depth", lambda v: v > 1)),
    ("depth is compound", ["depth", "type [('z'"], made.compound),
    ("depth is references", ["depth", "type object"], made.referenced),
    ("fewer depths than rows", ["depth", "5 rows", "expected 8"],
     replaced("depth", lambda v: v[:5])),
    ("more normals than rows", ["normal", "16 rows", "expected 8"],
     replaced("normal", lambda v: np.tile(v, (2, 1, 1, 1)))),
    ("normals of two components", ["normal", "shape (8, 32, 32, 2)"],
     replaced("normal", lambda v: v[..., :2])),
    ("normals channels first", ["normal", "shape (8, 3, 32, 32)"],
     replaced("normal", lambda v: np.moveaxis(v, -1, 1))),
    ("normals as a picture", ["normal", "uint8", "expected floats"],
     replaced("normal", lambda v: np.uint8(127.5 * (v + 1)))),
    ("rows are floats", ["row", "float64", "expected integers"],
     replaced("row", lambda v: v.astype("f8"))),
    ("rows are true or false", ["row", "type bool"], replaced("row", lambda v: v > 3)),
    ("rows in two columns", ["row", "shape (8, 1)"], replaced("row", lambda v: v[:, None])),
    ("no row at all", ["row", "no rows"], made.rows_kept(0)),
    ("a row twice", ["row", "more than once", "ids 2)"], put("row", 5, 2)),
    ("all rows the same", ["row", "more than once", "ids 0)"], values("row", lambda v: 0 * v)),
    ("a negative row", ["row", "negative", "ids -1)"], put("row", 5, -1)),
    ("a row beyond all numbers", ["row", "18446744073709551615"],
     replaced("row", lambda v: np.full(8, 2**64 - 1, "u8"))),
    ("10^9 rows of nothing", ["1000000000 rows", "10,000,000"],
     in_all(claims("row", (10**9,), "i8", chunks=(1024,)),
            claims("depth", (10**9, 32, 32), chunks=(1, 32, 32)))),
    ("rows that were never written", ["row", "nothing was written"],
     claims("row", (8,), "i8", chunks=(8,))),
    ("depth that was never written", ["depth", "nothing was written"],
     claims("depth", (8, 32, 32), chunks=(1, 32, 32))),
    ("images of 10^10 pixels", ["depth", "100000x100000"],
     claims("depth", (8, 10**5, 10**5), chunks=(1, 1000, 1000))),
    ("chunks of a gigabyte", ["depth", "MiB to unpack"],
     claims("depth", (8, 32, 32), chunks=(250_000, 32, 32), maxshape=(None, 32, 32))),
    ("an external link", ["depth", "a link to the file 'other.h5'"],
     linked("depth", h5py.ExternalLink("other.h5", "/depth"))),
    ("a soft link to nowhere", ["depth", "a link"], linked("depth", h5py.SoftLink("/nowhere"))),
    ("a soft link to itself", ["depth", "a link"], linked("depth", h5py.SoftLink("/depth"))),
    ("a virtual dataset", ["depth", "in another file"], made.virtual),
    ("an unknown filter", ["depth", "filter 300"], made.unknown_filter),
]  # fmt: skip

MATCH_FILES = [
    ("other rooms", ["truth_fingerprint", "0123456789ab"], made.other_truth),
    ("truth is something else", ["other.h5", "not a rooms file"], made.truth_is_no_rooms_file),
]  # fmt: skip

MATCH = [
    ("truth not there", ["truth", "no file at", "gone/rooms.h5", "--truth"],
     attribute("truth_path", "gone/rooms.h5")),
    ("truth not named", ["no path of a ground truth", "--truth"], attribute("truth_path", "")),
    ("images too small", ["depth", "16x16", "expected 32x32"], made.smaller),
    ("rows missing", ["row", "3 of 8 missing", "ids 5, 6, 7)"], made.rows_kept(5)),
    ("a row unknown", ["row", "1 that the ground truth does not", "ids 8)"], put("row", 3, 8)),
    ("counted from 1", ["row", "does not have", "ids 8)"], values("row", lambda v: v + 1)),
]  # fmt: skip

VALUES = [
    ("NaN", ["depth", "finite", "3"], put("depth", (3, 5, 7), np.nan)),
    ("all NaN", ["depth", "finite"], values("depth", lambda v: v * np.nan)),
    ("infinity", ["depth", "finite", "7"], put("depth", (7, 0, 0), np.inf)),
    ("minus infinity", ["depth", "finite", "0"], put("depth", (0, 31, 31), -np.inf)),
    ("a signalling NaN", ["depth", "finite", "4"],
     put("depth", (4, 2, 2), np.array(0x7FA00001, "u4").view("f4"))),
    ("absurd magnitude", ["depth", "finite"], replaced("depth", lambda v: v.astype("f8") * 1e200)),
    ("beyond single precision", ["depth", "finite"],
     replaced("depth", lambda v: np.full(v.shape, 9e99))),
    ("overflow of half precision", ["depth", "finite"], replaced("depth", made.halved_precision)),
    ("NaN in a normal", ["normal", "finite", "2"], put("normal", (2, 5, 7, 1), np.nan)),
    ("normals of length 0", ["normal", "length 0"], put("normal", (6, 5), 0.0)),
    ("a damaged chunk", ["depth", "row 3", "cannot be read"], damaged_chunk("depth", 3)),
    ("a damaged chunk of normals", ["normal", "cannot be read"], damaged_chunk("normal", 3)),
]  # fmt: skip

# `submissions/test_hints` has the tests of each hint; here is one of each kind for the commands.
HINTS = [
    ("upside down", ["depth", "upside down"], values("depth", lambda v: v[:, ::-1])),
    ("rows shuffled", ["row", "rows look shuffled"], made.shuffled),
    ("flipped normals", ["normal", "facing away"], values("normal", np.negative)),
]  # fmt: skip

ANSWERS_OPEN = [
    ("no questions", ["question", "no such dataset"], gone("question")),
    ("neither answer nor scores", ["answer", "neither"], gone("answer", "scores")),
    ("answer and scores disagree", ["answer", "that disagree with scores", "ids 2)"],
     put("answer", 2, 0)),
    ("an answer of 3", ["answer", "such as 3", "ids 4)"],
     in_all(gone("scores"), put("answer", 4, 3))),
    ("an answer of -2", ["answer", "such as -2"], in_all(gone("scores"), put("answer", 4, -2))),
    ("answers are floats", ["answer", "float32", "expected integers"],
     replaced("answer", lambda v: v.astype("f4"))),
    ("answers are letters", ["answer", "type object"],
     replaced("answer", lambda v: list("abccba"))),
    ("a score of NaN", ["scores", "NaN", "ids 1)"], put("scores", (1, 2), np.nan)),
    ("an infinite score", ["scores", "infinite", "ids 5)"], put("scores", (5, 0), np.inf)),
    ("scores for four", ["scores", "shape (6, 4)", "2 or 3)"],
     replaced("scores", lambda v: np.zeros((6, 4)))),
    ("scores are an external link", ["scores", "a link"],
     linked("scores", h5py.ExternalLink("other.h5", "/scores"))),
    ("fewer answers than questions", ["answer", "4 rows", "expected 6"],
     replaced("answer", lambda v: v[:4])),
    ("a question twice", ["question", "more than once"], put("question", 3, 0)),
]  # fmt: skip

ANSWERS_MATCH = [
    ("questions missing", ["question", "2 of 6 missing", "ids 4, 5)"], made.answers_kept(4)),
    ("a question unknown", ["question", "does not have", "ids 77)"], put("question", 3, 77)),
    ("scores for two of three", ["scores", "shape (M, 2)", "(M, 3)"],
     in_all(gone("answer"), replaced("scores", lambda v: v[:, :2]))),
    ("other questions", ["truth_fingerprint"], attribute("truth_fingerprint", "f" * 64)),
]  # fmt: skip

JSON_OPEN = [
    ("JSON: a score file", ["the scores of a submission", "bench leaderboard"],
     {"format": "pix2shape-bench/scores", "method": "m"}),
    ("JSON: nested", ["answers[0]", "for each question"], [[0], [1], [2], [0], [1], [2]]),
    ("JSON: NaN", ["NaN"], "[0, 1, NaN, 0, 1, 2]"),
    ("JSON: floats", ["answers[1]", "1.0"], "[0, 1.0, 2, 0, 1, 2]"),
    ("JSON: booleans", ["answers[0]", "true"], "[true, 1, 2, 0, 1, 2]"),
    ("JSON: null", ["null"], "[null, 1, 2, 0, 1, 2]"),
    ("JSON: texts", ["answers[0]", "'0'"], ["0", "1", "2", "0", "1", "2"]),
    ("JSON: out of range", ["such as 3", "ids 5)"], [0, 1, 2, 0, 1, 3]),
    ("JSON: a huge number", ["answers[0]"], [10**30, 1, 2, 0, 1, 2]),
    ("JSON: no answers", ["no rows"], []),
    ("JSON: no answers in an object", ["no rows"], {}),
    ("JSON: a number", ["7", "a list or an object"], 7),
    ("JSON: a key that is no number", ["the key 'one'"], {"one": 1}),
    ("JSON: a key with zeros", ["the key '01'"], {"01": 1}),
    ("JSON: a negative key", ["the key '-1'"], {"-1": 1}),
    ("JSON: a key beyond all", ["the key '99999999999'"], {"99999999999": 1}),
    ("JSON: an unknown key", ["model", "an unknown key"], {"answers": [0] * 6, "model": "x"}),
    ("JSON: answers are a text", ["'012012'", "a list or"], {"answers": "012012"}),
    ("JSON: method is a number", ["method", "7"], {"answers": [0] * 6, "method": 7}),
    ("JSON: method is null", ["method", "null"], {"answers": [0] * 6, "method": None}),
    ("JSON: method is empty", ["method", "empty"], {"answers": [0] * 6, "method": ""}),
    ("JSON: method of half a character", ["method", r"\ud800"],
     '{"answers": [0, 0, 0, 0, 0, 0], "method": "\\ud800"}'),
]  # fmt: skip

JSON_FILES = [
    ("JSON: not UTF-8", ["not UTF-8"], made.raw(b'["\xff\xfe"]', "answers.json")),
    ("JSON: binary", ["no JSON"], made.raw(b"\x00\x01\x02" * 100, "answers.json")),
    ("JSON: 40 MB", ["40000000 bytes"], made.huge_json),
]  # fmt: skip

JSON_MATCH = [
    ("JSON: too few", ["question", "2 of 6 missing", "ids 4, 5)"], [0, 1, 2, 0]),
    ("JSON: too many", ["1 that the ground truth does not have", "ids 6)"], [0] * 7),
    ("JSON: a question left out", ["1 of 6 missing", "ids 3)"],
     {"answers": {"0": 0, "1": 1, "2": 2, "4": -1, "5": 1}, "method": "m"}),
]  # fmt: skip


def _cases(table, stage, build=lambda given: given, task="rooms", names_truth=True):
    return [
        Case(name, stage, tuple(words), build(given), task, names_truth)
        for name, words, given in table
    ]


CASES: list[Case] = [
    *_cases(OPEN_FILES, "open"),
    *_cases(OPEN, "open", made.edited),
    *_cases(MATCH_FILES, "match"),
    *_cases(MATCH, "match", made.edited),
    *_cases(VALUES, "values", made.edited),
    *_cases(HINTS, "hint", made.edited),
    *_cases(ANSWERS_OPEN, "open", made.answers_edited, "iqtt"),
    *_cases(ANSWERS_MATCH, "match", made.answers_edited, "iqtt"),
    *_cases(JSON_OPEN, "open", made.as_json, "iqtt", names_truth=False),
    *_cases(JSON_FILES, "open", task="iqtt", names_truth=False),
    *_cases(JSON_MATCH, "match", made.as_json, "iqtt", names_truth=False),
]

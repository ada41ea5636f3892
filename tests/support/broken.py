"""A corpus of broken submissions, made in code from good ones.

Each `Case` builds one file. `stage` says what finds the fault:

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
from submissions import (
    Build,
    answers_edited,
    answers_kept,
    as_json,
    compound,
    edited,
    elsewhere,
    fifo,
    folder_itself,
    halved_precision,
    huge_json,
    linked_to_fifo,
    missing,
    other_truth,
    raw,
    referenced,
    rows_kept,
    shuffled,
    smaller,
    truncated,
    truth_is_no_rooms_file,
    truth_itself,
    unknown_filter,
    virtual,
)


@dataclass(frozen=True)
class Case:
    name: str
    stage: str
    words: tuple[str, ...]
    build: Build
    task: str = "rooms"
    names_truth: bool = True

    def __str__(self) -> str:
        return self.name


OPEN = [
    ("missing", ["no such file"], missing),
    ("folder", ["is a folder"], folder_itself),
    ("fifo", ["not a regular file"], fifo),
    ("empty file", ["not a readable HDF5 file"], raw(b"")),
    ("text file", ["not a readable HDF5 file"], raw(b"depth,1,2,3\n" * 99)),
    ("numpy file", ["not a readable HDF5 file"], raw(b"\x93NUMPY\x01\x00" + bytes(500))),
    ("signature only", ["not a readable HDF5 file"], raw(b"\x89HDF\r\n\x1a\n" + bytes(500))),
    ("truncated early", ["not a readable HDF5 file"], truncated(0.05)),
    ("truncated late", ["not a readable HDF5 file"], truncated(0.95)),
    ("the truth itself", ["a file of rooms, not a submission"], truth_itself),
    ("no attributes", ["format", "no such root attribute"], edited(
        lambda file: [file.attrs.pop(name) for name in list(file.attrs)])),
    ("other format", ["'mine'", "'pix2shape-bench/predictions'"], edited(
        attribute("format", "mine"))),
    ("format is a number", ["format", "expected a text"], edited(attribute("format", 7))),
    ("newer version", ["version '2.0'", "expected 1.x"], edited(
        attribute("format_version", "2.0"))),
    ("no version", ["format_version", "expected 1.x"], edited(gone("format_version"))),
    ("version is a number", ["format_version", "float64"], edited(
        attribute("format_version", 1.0))),
    ("no task", ["task", "no such root attribute"], edited(gone("task"))),
    ("other task", ["task", "'chairs'", "'rooms' or 'iqtt'"], edited(attribute("task", "chairs"))),
    ("task of the other kind", ["question", "no such dataset", "'depth'"], edited(
        attribute("task", "iqtt"))),
    ("no method", ["method", "no such root attribute"], edited(gone("method"))),
    ("empty method", ["method", "empty"], edited(attribute("method", ""))),
    ("blank method", ["method", "empty"], edited(attribute("method", " \u00a0"))),
    ("method with a newline", ["method", r"'\n'"], edited(attribute("method", "a\nb"))),
    ("method that moves the cursor", ["method", r"'\x1b'"], edited(
        attribute("method", "\x1b[2Jmine"))),
    ("method written backwards", ["method", r"'\u202e'"], edited(attribute("method", "a\u202eb"))),
    ("method that is not UTF-8", ["method", "not UTF-8"], edited(
        lambda file: file.attrs.create("method", np.bytes_(b"\xff\xfe")))),
    ("method of great length", ["method", "30000 characters"], edited(
        lambda file: file.attrs.update({"method": "m" * 30_000}))),
    ("method is a list", ["method", "expected a text"], edited(
        attribute("method", ["one", "two"]))),
    ("run is a number", ["run", "expected a text"], edited(attribute("run", 3))),
    ("unknown alignment", ["alignment", "'affine'", "'scale_shift'"], edited(
        attribute("alignment", "affine"))),
    ("no fingerprint", ["truth_fingerprint", "no such root attribute"], edited(
        gone("truth_fingerprint"))),
    ("empty fingerprint", ["truth_fingerprint", "empty"], edited(
        attribute("truth_fingerprint", ""))),
    ("no rows", ["row", "no such dataset"], edited(gone("row"))),
    ("no depth", ["depth", "no such dataset", "'normal'"], edited(gone("depth"))),
    ("depth under another name", ["depth", "no such dataset", "'depths'"], edited(
        lambda file: file.move("depth", "depths"))),
    ("depth is a group", ["depth", "a group"], edited(grouped("depth"))),
    ("row is a group", ["row", "a group"], edited(grouped("row"))),
    ("depth is a named type", ["depth", "a datatype"], edited(
        linked("depth", np.dtype("f4")))),
    ("depth is one number", ["depth", "shape ()"], edited(replaced("depth", lambda v: 1.5))),
    ("depth is nothing", ["depth", "shape None"], edited(
        replaced("depth", lambda v: h5py.Empty("f4")))),
    ("depth has a channel", ["depth", "shape (8, 32, 32, 1)"], edited(
        replaced("depth", lambda v: v[..., None]))),
    ("depth is flat", ["depth", "shape (8, 1024)"], edited(
        replaced("depth", lambda v: v.reshape(8, -1)))),
    ("depth without pixels", ["depth", "shape (8, 0, 32)"], edited(
        replaced("depth", lambda v: v[:, :0]))),
    ("depth in whole numbers", ["depth", "uint16", "expected floats"], edited(
        replaced("depth", lambda v: (1000 * v).astype("u2")))),
    ("depth as text", ["depth", "type text"], edited(
        replaced("depth", lambda v: [["far"] * 32] * 8))),
    ("depth is true or false", ["depth", "type bool"], edited(
        replaced("depth", lambda v: v > 1))),
    ("depth is complex", ["depth", "complex64"], edited(
        replaced("depth", lambda v: v.astype("c8")))),
    ("depth is compound", ["depth", "type compound"], edited(compound)),
    ("depth is references", ["depth", "type reference"], edited(referenced)),
    ("fewer depths than rows", ["depth", "5 rows", "expected 8"], edited(
        replaced("depth", lambda v: v[:5]))),
    ("more normals than rows", ["normal", "16 rows", "expected 8"], edited(
        replaced("normal", lambda v: np.tile(v, (2, 1, 1, 1))))),
    ("normals of two components", ["normal", "shape (8, 32, 32, 2)"], edited(
        replaced("normal", lambda v: v[..., :2]))),
    ("normals channels first", ["normal", "shape (8, 3, 32, 32)"], edited(
        replaced("normal", lambda v: np.moveaxis(v, -1, 1)))),
    ("normals as a picture", ["normal", "uint8", "expected floats"], edited(
        replaced("normal", lambda v: np.uint8(127.5 * (v + 1))))),
    ("rows are floats", ["row", "float64", "expected integers"], edited(
        replaced("row", lambda v: v.astype("f8")))),
    ("rows are true or false", ["row", "type bool"], edited(replaced("row", lambda v: v > 3))),
    ("rows are texts", ["row", "type text"], edited(
        replaced("row", lambda v: [str(i) for i in v]))),
    ("rows in two columns", ["row", "shape (8, 1)"], edited(
        replaced("row", lambda v: v[:, None]))),
    ("no row at all", ["row", "no rows"], edited(rows_kept(0))),
    ("a row twice", ["row", "more than once", "ids 2)"], edited(put("row", 5, 2))),
    ("all rows the same", ["row", "more than once", "ids 0)"], edited(
        values("row", lambda v: 0 * v))),
    ("a negative row", ["row", "negative", "ids -1)"], edited(put("row", 5, -1))),
    ("a row beyond all numbers", ["row", "18446744073709551615"], edited(
        replaced("row", lambda v: np.full(8, 2**64 - 1, "u8")))),
    ("10^9 rows of nothing", ["1000000000 rows", "10,000,000"], edited(in_all(
        claims("row", (10**9,), "i8", chunks=(1024,)),
        claims("depth", (10**9, 32, 32), chunks=(1, 32, 32))))),
    ("rows that were never written", ["row", "nothing was written"], edited(
        claims("row", (8,), "i8", chunks=(8,)))),
    ("depth that was never written", ["depth", "nothing was written"], edited(
        claims("depth", (8, 32, 32), chunks=(1, 32, 32)))),
    ("images of 10^10 pixels", ["depth", "100000x100000"], edited(
        claims("depth", (8, 10**5, 10**5), chunks=(1, 1000, 1000)))),
    ("chunks of a gigabyte", ["depth", "MiB to unpack"], edited(
        claims("depth", (8, 32, 32), chunks=(250_000, 32, 32), maxshape=(None, 32, 32)))),
    ("an external link", ["depth", "a link to the file 'other.h5'"], edited(
        linked("depth", h5py.ExternalLink("other.h5", "/depth")))),
    ("an external link to a fifo", ["depth", "a link to the file", "pipe.h5"], linked_to_fifo),
    ("a soft link to nowhere", ["depth", "a link"], edited(
        linked("depth", h5py.SoftLink("/nowhere")))),
    ("a soft link to itself", ["depth", "a link"], edited(
        linked("depth", h5py.SoftLink("/depth")))),
    ("values in a raw file", ["depth", "in another file"], elsewhere),
    ("a virtual dataset", ["depth", "in another file"], edited(virtual)),
]  # fmt: skip

MATCH = [
    ("other rooms", ["truth_fingerprint", "0123456789ab"], other_truth),
    ("truth not there", ["truth", "nothing at", "gone/rooms.h5", "--truth"], edited(
        attribute("truth_path", "gone/rooms.h5"))),
    ("truth not named", ["no path of a truth", "--truth"], edited(attribute("truth_path", ""))),
    ("truth is something else", ["other.h5", "not a rooms file"], truth_is_no_rooms_file),
    ("images too small", ["depth", "16x16", "expected 32x32"], edited(smaller)),
    ("rows missing", ["row", "3 of 8 missing", "ids 5, 6, 7)"], edited(rows_kept(5))),
    ("a row unknown", ["row", "1 that the truth does not", "ids 8)"], edited(put("row", 3, 8))),
    ("counted from 1", ["row", "does not have", "ids 8)"], edited(
        values("row", lambda v: v + 1))),
]  # fmt: skip

VALUES = [
    ("NaN", ["depth", "finite", "3"], edited(put("depth", (3, 5, 7), np.nan))),
    ("all NaN", ["depth", "finite"], edited(values("depth", lambda v: v * np.nan))),
    ("infinity", ["depth", "finite", "7"], edited(put("depth", (7, 0, 0), np.inf))),
    ("minus infinity", ["depth", "finite", "0"], edited(put("depth", (0, 31, 31), -np.inf))),
    ("a signalling NaN", ["depth", "finite", "4"], edited(put(
        "depth", (4, 2, 2), np.array(0x7FA00001, "u4").view("f4")))),
    ("absurd magnitude", ["depth", "finite"], edited(
        replaced("depth", lambda v: v.astype("f8") * 1e200))),
    ("overflow of half precision", ["depth", "finite"], edited(
        replaced("depth", halved_precision))),
    ("NaN in a normal", ["normal", "finite", "2"], edited(put("normal", (2, 5, 7, 1), np.nan))),
    ("normals of length 0", ["normal", "length 0"], edited(put("normal", (6, 5), 0.0))),
    ("a damaged chunk", ["depth", "row 3", "cannot be read"], edited(damaged_chunk("depth", 3))),
    ("a damaged chunk of normals", ["normal", "cannot be read"], edited(
        damaged_chunk("normal", 3))),
    ("an unknown filter", ["depth", "cannot be read"], edited(unknown_filter)),
]  # fmt: skip

# `submissions/hints` has the tests of each hint; here is one of each kind for the commands.
HINTS = [
    ("upside down", ["depth", "upside down"], edited(values("depth", lambda v: v[:, ::-1]))),
    ("rows shuffled", ["row", "rows look shuffled"], edited(shuffled)),
    ("flipped normals", ["normal", "facing away"], edited(values("normal", np.negative))),
]

ANSWERS_OPEN = [
    ("no questions", ["question", "no such dataset"], answers_edited(gone("question"))),
    ("neither answer nor scores", ["answer", "neither"], answers_edited(gone("answer", "scores"))),
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
    ("scores are an external link", ["scores", "a link"], answers_edited(
        linked("scores", h5py.ExternalLink("other.h5", "/scores")))),
    ("fewer answers than questions", ["answer", "4 rows", "expected 6"], answers_edited(
        replaced("answer", lambda v: v[:4]))),
    ("a question twice", ["question", "more than once"], answers_edited(put("question", 3, 0))),
]  # fmt: skip

ANSWERS_MATCH = [
    ("questions missing", ["question", "2 of 6 missing", "ids 4, 5)"], answers_edited(
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
    ("JSON: booleans", ["true", "ids 0)"], as_json("[true, 1, 2, 0, 1, 2]")),
    ("JSON: null", ["null"], as_json("[null, 1, 2, 0, 1, 2]")),
    ("JSON: texts", ["'0'", "ids 0, 1"], as_json(["0", "1", "2", "0", "1", "2"])),
    ("JSON: out of range", ["outside -1 to 2, such as 3", "ids 5)"], as_json([0, 1, 2, 0, 1, 3])),
    ("JSON: a huge number", ["ids 0)"], as_json([10**30, 1, 2, 0, 1, 2])),
    ("JSON: a number of 5000 digits", ["no JSON"], as_json("[" + "1" * 5000 + "]")),
    ("JSON: no answers", ["no rows"], as_json([])),
    ("JSON: no answers in an object", ["no rows"], as_json({})),
    ("JSON: a number", ["7", "a list or an object"], as_json(7)),
    ("JSON: a key twice", ["the key '1' twice"], as_json('{"0": 1, "1": 2, "1": 0}')),
    ("JSON: a key that is no number", ["the key 'one'"], as_json({"one": 1})),
    ("JSON: a key with zeros", ["the key '01'"], as_json({"01": 1})),
    ("JSON: a negative key", ["the key '-1'"], as_json({"-1": 1})),
    ("JSON: a key beyond all", ["the key '99999999999'"], as_json({"99999999999": 1})),
    ("JSON: an unknown key", ["model", "this key"], as_json({"answers": [0] * 6, "model": "x"})),
    ("JSON: answers are a text", ["'012012'", "a list or"], as_json({"answers": "012012"})),
    ("JSON: method is a number", ["method", "7"], as_json({"answers": [0] * 6, "method": 7})),
    ("JSON: method is null", ["method", "null"], as_json({"answers": [0] * 6, "method": None})),
    ("JSON: method is empty", ["method", "empty"], as_json({"answers": [0] * 6, "method": ""})),
    ("JSON: method of half a character", ["method", r"\ud800"], as_json(
        '{"answers": [0, 0, 0, 0, 0, 0], "method": "\\ud800"}')),
    ("JSON: not UTF-8", ["not UTF-8"], raw(b'["\xff\xfe"]', "answers.json")),
    ("JSON: binary", ["no JSON"], raw(b"\x00\x01\x02" * 100, "answers.json")),
    ("JSON: 40 MB", ["40000000 bytes"], huge_json),
]  # fmt: skip

JSON_MATCH = [
    ("JSON: too few", ["question", "2 of 6 missing", "ids 4, 5)"], as_json([0, 1, 2, 0])),
    ("JSON: too many", ["1 that the truth does not have", "ids 6)"], as_json([0] * 7)),
    ("JSON: a question left out", ["1 of 6 missing", "ids 3)"], as_json(
        {"answers": {"0": 0, "1": 1, "2": 2, "4": -1, "5": 1}, "method": "m"})),
]  # fmt: skip


def _cases(table, stage, task="rooms", names_truth=True):
    return [
        Case(name, stage, tuple(words), build, task, names_truth) for name, words, build in table
    ]


CASES: list[Case] = [
    *_cases(OPEN, "open"),
    *_cases(MATCH, "match"),
    *_cases(VALUES, "values"),
    *_cases(HINTS, "hint"),
    *_cases(ANSWERS_OPEN, "open", "iqtt"),
    *_cases(ANSWERS_MATCH, "match", "iqtt"),
    *_cases(JSON_OPEN, "open", "iqtt", names_truth=False),
    *_cases(JSON_MATCH, "match", "iqtt", names_truth=False),
]

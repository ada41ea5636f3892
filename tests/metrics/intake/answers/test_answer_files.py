"""Answers from CSV, JSON and JSON lines: an index, a letter, or scores."""

import json

import numpy as np
import pytest

from metrics.intake.answers.answer_files import import_answers
from metrics.submissions.reader import open_predictions
from scenegen.common.errors import SceneGenError

SCORES = np.eye(3)[[0, 1, 2, 2, 1, 0]] + 0.25
RIGHT = [0, 1, 2, 2, 1, 0]


def lines(*entries):
    return "\n".join(json.dumps(entry) for entry in entries)


GOOD = {
    "letters.csv": ("answer\nA\nB\nc\n C \nb\na\n", RIGHT),
    "any order.csv": ("question,answer\n5,0\n4,1\n3,C\n2,2\n1,1\n0,A\n", RIGHT),
    "abstained.csv": ("id,answer\n0,\n1,-1\n2,2\n3,2\n4,1\n5,0\n", [-1, -1, 2, 2, 1, 0]),
    "scores.csv": ("A,B,C\n" + "\n".join(",".join(map(str, s)) for s in SCORES.tolist()), RIGHT),
    "replies.csv": ("answer\nA<|im_end|>\n(B)\nC.\n**C**\nThe answer is B.\na</s>\n", RIGHT),
    "pandas.csv": ("question,answer\n5.0,0.0\n4.0,1.0\n3.0,\n2,2.\n1.0,+1\n0.0,0.0\n",
                   [0, 1, 2, -1, 1, 0]),
    "missing.csv": ("answer\n0.0\nNaN\n2.0\nnan\n1.0\n-1.0\n", [0, -1, 2, -1, 1, -1]),
    "floats.json": ("[0.0, 1, 2, 2.0, 1, 0]", RIGHT),
    "bom.csv": ("\ufeffanswer\r\n" + "\r\n".join("012210"), RIGHT),
    "list.json": (json.dumps(RIGHT), RIGHT),
    "letters.json": (json.dumps({"answers": ["A", "B", "C", "C", "B", None]}), [*RIGHT[:5], -1]),
    "object.json": (json.dumps({str(5 - i): RIGHT[i] for i in range(6)}), RIGHT[::-1]),
    "scores.json": (json.dumps(SCORES.tolist()), RIGHT),
    "entries.json": (json.dumps([{"id": i, "answer": a} for i, a in enumerate(RIGHT)]), RIGHT),
    "lines.jsonl": (lines(*({"question": i, "answer": a} for i, a in enumerate(RIGHT))), RIGHT),
    "scores.jsonl": (lines(*({"question": i, "scores": s} for i, s in enumerate(SCORES.tolist()))),
                     RIGHT),
    "plain.jsonl": (lines(*RIGHT) + "\n\n", RIGHT),
}  # fmt: skip


@pytest.mark.parametrize("name", GOOD)
def test_answers(name, truths, tmp_path):
    text, expected = GOOD[name]
    (tmp_path / name).write_text(text, encoding="utf-8", newline="")
    assert import_answers(tmp_path / name, truths.iqtt, tmp_path / "a.h5", method="m") == 6
    with open_predictions(tmp_path / "a.h5") as found:
        assert found.answers[np.argsort(found.rows)].tolist() == expected
        assert (found.scores is None) == ("scores" not in name)


BAD = {
    "empty.csv": "",
    "no answers.csv": "answer\n",
    "other columns.csv": "question,guess\n0,A\n",
    "letter D.csv": "answer\nA\nB\nC\nD\nA\nA\n",
    "unread.csv": "answer\nA\nB\nC\nA or B\nA\nA\n",
    "few.csv": "answer\nA\nB\n",
    "twice.csv": "question,answer\n" + "0,A\n" * 6,
    "beyond.csv": "question,answer\n" + "".join(f"{i + 1},A\n" for i in range(6)),
    "short line.csv": "question,answer\n0,A\n1\n",
    "words.csv": "A,B,C\n1,2,x\n",
    "nan.csv": "A,B,C\n" + "1,2,nan\n" * 6,
    "binary.csv": "\x00\x01",
    "not.json": "{",
    "text.json": '"A"',
    "halves.csv": "answer\n0.5\n1.0\n2.0\n2.0\n1.0\n0.0\n",
    "index 1.5.csv": "question,answer\n" + "".join(f"{i + 0.5},A\n" for i in range(6)),
    "float.json": "[0.5, 1, 2, 2, 1, 0]",
    "true.json": "[true, 1, 2, 2, 1, 0]",
    "mixed.json": "[[1, 2, 3], 1, 2, 2, 1, 0]",
    "ragged.json": "[[1, 2, 3], [1, 2], [1, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 3]]",
    "not.jsonl": "0\n{\n",
    "keys.jsonl": '{"question": 0, "label": 1}',
    "half.jsonl": '{"question": 0, "answer": 1}\n{"answer": 1}',
    "answers.txt": "0",
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_answer(name, truths, tmp_path):
    (tmp_path / name).write_text(BAD[name])
    with pytest.raises(SceneGenError) as caught:
        import_answers(tmp_path / name, truths.iqtt, tmp_path / "a.h5", method="m")
    assert len(str(caught.value).splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]

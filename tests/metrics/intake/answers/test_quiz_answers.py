"""Answers of people become submissions."""

import copy
import json
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

import cli
from iqtt.quiz.page import quiz_name
from metrics.intake.answers.quiz_answers import QuizError, import_quiz, read_answers
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from metrics.submissions.reader import open_predictions

ROWS = [9, 2, 17, 4]


@pytest.fixture
def saved(quiz_split):
    """Return what the page saves of a participant who answered four questions with 0, 1, 2, 0."""
    with h5py.File(quiz_split / "iqtt-test.h5") as file:
        digest = file.attrs["fingerprint"]
    answers = [
        {"question": row, "answer": i % 3, "seconds": 2.5, "times_shown": 1}
        for i, row in enumerate(ROWS)
    ]
    return {
        "format": "pix2shape-bench/quiz-answers", "format_version": "1.0",
        "quiz": quiz_name(digest, ROWS), "digest": digest, "participant": "0" * 16,
        "answers": answers, "practice": [{"answer": 1, "seconds": 4, "times_shown": 2}],
    }  # fmt: skip


def written(path, content):
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_each_person_is_a_run(quiz_split, saved, tmp_path):
    test, key = (quiz_split / f"iqtt-test{end}.h5" for end in ("", "-answers"))
    with h5py.File(key) as file:
        right = file["answers"][:].reshape(-1)
    for person, wrong in enumerate((0, 0, 2)):  # two who answer alike are two people
        content = copy.deepcopy(saved) | {"participant": f"{person:016x}"}
        for i, answer in enumerate(content["answers"]):
            answer["answer"] = int(right[answer["question"]] + (i < wrong)) % 3
        written(tmp_path / f"{person}.json", content)
    words = ["import", "--quiz", str(tmp_path / "*.json"), "--data", str(test)]
    done = CliRunner().invoke(cli.bench, [*words, "--out", str(tmp_path / "people")])
    assert done.exit_code == 0, done.output
    made = sorted((tmp_path / "people").iterdir())
    assert [path.name for path in made] == [f"{person:016x}.h5" for person in range(3)]
    with open_predictions(made[2]) as opened:
        assert (opened.method, opened.run) == ("people", f"{2:016x}")
        assert opened.rows.tolist() == ROWS
    scores = score(made, key, Settings(allow_partial=True))
    accuracy = scores.metrics["iqtt_accuracy"]
    assert accuracy.value == pytest.approx((1 + 1 + 0.5) / 3)
    assert accuracy.std == pytest.approx(np.std([1, 1, 0.5], ddof=1))
    assert scores.ids.tolist() == sorted(ROWS)


def drop(content, *names):
    for name in names:
        del content[name]


EDITS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "another file": (lambda c: c.update(digest="0" * 64), ""),
    "no such answer": (lambda c: c["answers"][1].update(answer=3), "answers[1].answer"),
    "below 0": (lambda c: c["answers"][1].update(answer=-1), "answers[1].answer"),
    "no number": (lambda c: c["answers"][0].update(answer="A"), "answers[0].answer"),
    "half": (lambda c: c["answers"][0].update(answer=0.5), "answers[0].answer"),
    "no such question": (lambda c: c["answers"][2].update(question=24), "answers[2].question"),
    "twice": (lambda c: c["answers"][3].update(question=ROWS[0]), "answers[3].question"),
    "another question": (lambda c: c["answers"][3].update(question=0), ""),
    "one left out": (lambda c: c["answers"].pop(), ""),
    "no answers": (lambda c: c.update(answers=[]), "answers"),
    "one that lacks its time": (lambda c: drop(c["answers"][0], "seconds"), "answers[0].seconds"),
    "time below 0": (lambda c: c["answers"][0].update(seconds=-1), "answers[0].seconds"),
    "no participant": (lambda c: drop(c, "participant"), "participant"),
    "a name": (lambda c: c.update(participant="../../me"), "participant"),
    "a later version": (lambda c: c.update(format_version="2.0"), "format_version"),
    "another format": (lambda c: c.update(format="x"), ""),
    "more": (lambda c: c.update(more=1), "more"),
}


@pytest.mark.parametrize("name", EDITS)
def test_a_file_that_is_not_as_saved_is_refused(quiz_split, saved, tmp_path, name):
    edit, place = EDITS[name]
    edit(saved)
    path = written(tmp_path / "a.json", saved)
    with pytest.raises(QuizError) as info:
        import_quiz([path], quiz_split / "iqtt-test.h5", tmp_path / "people")
    assert info.value.where == (f"{path}: {place}" if place else str(path))
    assert not (tmp_path / "people").exists()


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"format": NaN}', "\xff", "[" * 9000])
def test_broken_json_is_refused(tmp_path, text):
    with pytest.raises(QuizError):
        read_answers(written(tmp_path / "a.json", text))


def test_a_person_comes_once_and_quizzes_do_not_mix(quiz_split, saved, tmp_path):
    first = written(tmp_path / "a.json", saved)
    other = copy.deepcopy(saved) | {"participant": "1" * 16}
    other["answers"][0]["question"] = 0
    other["quiz"] = quiz_name(saved["digest"], [0, *ROWS[1:]])
    for second in (saved, other):
        files = [first, written(tmp_path / "b.json", second)]
        with pytest.raises(QuizError):
            import_quiz(files, quiz_split / "iqtt-test.h5", tmp_path / "people")

"""Answers of people become submissions; a participant answers in a real browser."""

import copy
import json
import threading
from collections.abc import Callable
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
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
def saved(quiz_split: Path) -> dict[str, Any]:
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


def written(path: Path, content: Any) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_each_person_is_a_run(quiz_split: Path, saved: dict[str, Any], tmp_path: Path) -> None:
    test, key = (quiz_split / f"iqtt-test{end}.h5" for end in ("", "-answers"))
    with h5py.File(key) as file:
        right = file["answers"][:].reshape(-1)
    files = []
    for person, wrong in enumerate((0, 0, 2)):  # two who answer alike are two people
        content = copy.deepcopy(saved) | {"participant": f"{person:016x}"}
        for i, answer in enumerate(content["answers"]):
            answer["answer"] = int(right[answer["question"]] + (i < wrong)) % 3
        files.append(written(tmp_path / f"{person}.json", content))
    made = import_quiz(files, test, tmp_path / "people")
    assert [path.name for path in made] == [f"{person:016x}.h5" for person in range(3)]
    with open_predictions(made[2]) as opened:
        assert (opened.method, opened.run) == ("people", f"{2:016x}")
        assert opened.rows.tolist() == ROWS
    scores = score(made, key, Settings(allow_partial=True))
    accuracy = scores.metrics["iqtt_accuracy"]
    assert accuracy.value == pytest.approx((1 + 1 + 0.5) / 3)
    assert accuracy.std == pytest.approx(np.std([1, 1, 0.5], ddof=1))
    assert scores.ids.tolist() == sorted(ROWS)


def drop(content: dict[str, Any], *names: str) -> None:
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
def test_a_file_that_is_not_as_saved_is_refused(
    quiz_split: Path, saved: dict[str, Any], tmp_path: Path, name: str
) -> None:
    edit, place = EDITS[name]
    edit(saved)
    path = written(tmp_path / "a.json", saved)
    with pytest.raises(QuizError) as info:
        import_quiz([path], quiz_split / "iqtt-test.h5", tmp_path / "people")
    assert info.value.where == (f"{path}: {place}" if place else str(path))
    assert not (tmp_path / "people").exists()


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"format": NaN}', "\xff", "[" * 9000])
def test_broken_json_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(QuizError):
        read_answers(written(tmp_path / "a.json", text))


def test_a_person_comes_once_and_quizzes_do_not_mix(
    quiz_split: Path, saved: dict[str, Any], tmp_path: Path
) -> None:
    first = written(tmp_path / "a.json", saved)
    other = copy.deepcopy(saved) | {"participant": "1" * 16}
    other["answers"][0]["question"] = 0
    other["quiz"] = quiz_name(saved["digest"], [0, *ROWS[1:]])
    for second in (saved, other):
        files = [first, written(tmp_path / "b.json", second)]
        with pytest.raises(QuizError):
            import_quiz(files, quiz_split / "iqtt-test.h5", tmp_path / "people")


@pytest.fixture
def site(tmp_path: Path) -> Any:
    """Serve a folder, and take what is posted to it: status 500 at first, then 200."""
    posted: list[bytes] = []

    class Handler(SimpleHTTPRequestHandler):
        def do_POST(self) -> None:
            posted.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(500 if len(posted) == 1 else 200)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=tmp_path))
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}", posted
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_participant_in_a_browser(
    visit: Any, site: Any, quiz_split: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the keyboard alone, on a phone's width: 1 for practice, 5 that count, all of them 2.

    Every screen is checked by axe-core once; a reload in the middle goes on.
    """
    monkeypatch.chdir(tmp_path)
    address, posted = site

    def run(group: Any, *words: object) -> str:
        result = CliRunner().invoke(group, list(map(str, words)), catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.output

    few = ("--questions", 5, "--practice", 1, "--post", "/answers", "--contact", "<b>lab</b>")
    run(cli.iqtt, "quiz", quiz_split / "iqtt-test.h5", *few)
    seen = visit(f"{address}/quiz.html", width=360, height=740)
    page = seen.page

    def ready(title: str) -> None:
        seen = "(buttons.length === 0 || shown !== null)"  # of quiz.js
        page.wait_for_function(f"t => document.title.startsWith(t) && {seen}", arg=title)

    def check() -> None:
        assert seen.violations() == []
        assert page.evaluate("document.documentElement.scrollWidth") == 360

    check()
    assert "<b>lab</b>" in page.inner_text("main")
    for key in ("Tab", "Space", "Tab", "Enter"):
        page.keyboard.press(key)
    ready("Practice question 1 of 1")
    page.keyboard.press("2")
    page.wait_for_function("() => document.title.includes('ight: it is answer')")
    check()
    page.keyboard.press("Enter")
    for i in range(5):
        ready(f"Question {i + 1} of 5")
        if i == 0:
            check()
        if i == 2:
            page.reload()
            ready("Question 3 of 5")
        if i == 3:
            for _ in range(2):
                page.keyboard.press("Tab")
            page.keyboard.press("Enter")
        else:
            page.keyboard.press("2" if i % 2 else "b")
    page.wait_for_selector("text=could not be sent")
    seen.errors.clear()  # of status 500
    check()
    page.click("button:text('Try again')")
    page.wait_for_selector("text=You can close this page")
    with page.expect_download() as download:
        page.click("text=Save my answers")
    (tmp_path / "answers").mkdir()
    path = tmp_path / "answers" / download.value.suggested_filename
    download.value.save_as(path)
    assert posted == [path.read_bytes()] * 2
    page.click("text=Hand over")
    ready("Which one is it")

    answers = read_answers(path)
    assert [answer.answer for answer in answers.answers] == [1] * 5
    assert [answer.times_shown for answer in answers.answers] == [1, 1, 2, 1, 1]
    assert all(0 <= answer.seconds < 60 for answer in answers.answers)
    rows = [answer.question for answer in answers.answers]
    assert rows != sorted(rows) or len(answers.practice) == 1
    run(cli.bench, "import", "--quiz", "answers/*.json", "--data", quiz_split / "iqtt-test.h5",
        "--out", "people")  # fmt: skip
    with open_predictions(tmp_path / "people" / f"{answers.participant}.h5") as opened:
        assert opened.answers.tolist() == [1] * 5

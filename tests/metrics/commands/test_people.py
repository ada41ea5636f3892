"""`iqtt quiz` and `iqtt quiz-report` as users run them, with a participant in a real browser."""

import json
import os
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
from contextlib import closing, contextmanager

import h5py
import pytest
from click.testing import CliRunner
from quizzes import Site, made_answers, served

import cli
from iqtt.quiz.answers import read_answers
from iqtt.quiz.study import Study

# Whoever starts the tests in the background has Ctrl-C ignored.
HEAR = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
QUIZ = [sys.executable, "-c", f"{HEAR}; import cli; cli.iqtt()", "quiz"]


@contextmanager
def started(split, db, *options):
    """Start `iqtt quiz` on a free port; give the process and the site."""
    command = [*QUIZ, split / "iqtt-test.h5", "--db", db, "--port", "0", *options]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    try:
        line = process.stdout.readline()
        assert line, process.stderr.read()
        yield process, Site(int(re.search(r":(\d+)/", line)[1]), db, None)
    finally:
        process.kill()
        process.communicate()


@contextmanager
def running(split, db, questions):
    """Serve that many questions from a thread, none of them for practice."""
    with (
        Study(split / "iqtt-test.h5", questions=questions, calibrations=0) as study,
        served(study, db) as site,
    ):
        yield site


@pytest.fixture
def iqtt(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *a: CliRunner().invoke(cli.iqtt, list(map(str, a)), catch_exceptions=False)


@pytest.fixture
def refused(iqtt, check_refusal):
    def call(*arguments, words=()):
        result = iqtt(*arguments)
        return check_refusal(result.exit_code, result.stdout, result.stderr, words)

    return call


def right_answers(split, db):
    """Return the places of a participant's right answers, from the file of answers."""
    with (
        h5py.File(split / "iqtt-test-answers.h5") as test,
        h5py.File(split / "iqtt-val.h5") as val,
        closing(sqlite3.connect(db)) as asked,
    ):
        rows = asked.execute("SELECT calibration, row FROM question ORDER BY position").fetchall()
        return [int((val if told else test)["answers"][row]) for told, row in rows]


def test_a_participant_in_a_browser(visit, quiz_split, tmp_path, iqtt):
    """With the keyboard alone, on a phone's width: 2 for practice, 5 that count, 3 of them right.

    Every page is checked by axe-core once; a reload in the middle goes on.
    """
    db = tmp_path / "answers.db"
    with started(quiz_split, db, "--questions", "5") as (_, site):
        seen = visit(f"http://localhost:{site.port}/", width=360, height=740)
        page, wrong = seen.page, []

        def ready(title):
            done = "document.readyState == 'complete' && document.title.startsWith(t)"
            timed = "(typeof shown == 'undefined' || shown !== null)"  # of quiz.js
            page.wait_for_function(f"t => {done} && {timed}", arg=title)

        def check():
            wrong.extend(seen.violations())
            assert page.evaluate("document.documentElement.scrollWidth") == 360

        check()
        page.keyboard.press("Tab")
        page.keyboard.press("Space")
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        ready("Practice question 1 of 2")
        right = right_answers(quiz_split, db)
        given = [right[0], (right[1] + 1) % 3, *right[2:5], *((k + 1) % 3 for k in right[5:])]
        for i, choice in enumerate(given):
            ready(f"Practice question {i + 1} of 2" if i < 2 else f"Question {i - 1} of 5")
            assert int(page.locator("progress").get_attribute("value")) == i
            if i in (0, 2):
                check()
            if i == 5:
                page.reload()
                ready("Question 4 of 5")
            if i == 6:  # by the Tab key
                for _ in range(choice + 1):
                    page.keyboard.press("Tab")
                page.keyboard.press("Enter")
            else:
                page.keyboard.press(str(choice + 1))
            if i < 2:
                ready("Right" if i == 0 else "Not right")
                check()
                page.keyboard.press("Enter")
        ready("Your score: 3 of 5")
        check()
        page.go_back()
        ready("Your score: 3 of 5")
        assert wrong == []
        page.close()  # before the server stops, so that it asks for nothing more
    found = read_answers(db).answers
    assert [one.answer for one in found] == given
    assert [one.times_shown for one in found] == [1] * 5 + [2, 1]
    assert all(0 <= one.response_seconds <= one.server_seconds + 1 for one in found)
    result = iqtt("quiz-report", db, "--json", "r.json")
    assert result.exit_code == 0, result.output
    assert json.loads((tmp_path / "r.json").read_text())["groups"][0]["accuracy"] == 3 / 5


def test_without_scripts_the_quiz_works(visit, quiz_split, tmp_path):
    with running(quiz_split, tmp_path / "a.db", 2) as site:
        page = visit(f"http://localhost:{site.port}/", java_script_enabled=False).page
        page.check("#consent")
        for name in ("Start", "Answer B", "Answer B"):
            with page.expect_navigation():
                page.click(f"text={name}")
        assert page.title().startswith("Your score")
        page.close()
    assert {one.response_seconds for one in read_answers(tmp_path / "a.db").answers} == {None}


def test_a_kill_loses_no_answer_that_was_acknowledged(quiz_split, tmp_path):
    db = tmp_path / "answers.db"
    options = ("--calibration", "0", "--questions", "24")
    told, cookie = 0, None
    for _ in range(2):
        with started(quiz_split, db, *options) as (process, site):
            cookie = cookie or site.begin()
            for _ in range(12):
                assert site.answer(cookie) == 303
                told += 1
            process.kill()
        assert len(read_answers(db).answers) == told
    found = read_answers(db).answers
    assert {one.finished for one in found} == {True}


def test_public_means_all_addresses_of_this_machine_and_signals_end_it_well(quiz_split, tmp_path):
    """127.0.0.2 is one of them, at which a server at localhost does not listen."""
    for options, reached, number in (
        ([], False, signal.SIGINT),
        (["--public"], True, signal.SIGTERM),
    ):
        with started(quiz_split, tmp_path / "answers.db", *options) as (process, site):
            try:
                socket.create_connection(("127.0.0.2", site.port), timeout=5).close()
                found = True
            except ConnectionRefusedError:
                found = False
            assert found == reached
            site.begin()
            process.send_signal(number)
            out, err = process.communicate(timeout=20)
        assert (process.returncode, err) == (0, "")
        assert "0 finished" in out
    assert not (tmp_path / "answers.db-wal").exists()


def test_export_while_the_server_runs(quiz_split, tmp_path, iqtt, refused):
    with running(quiz_split, tmp_path / "a.db", 24) as site:
        cookie = site.begin()
        assert {site.answer(cookie) for _ in range(24)} == {303}
        assert iqtt("quiz", "--db", "a.db", "--export", "a.csv").exit_code == 0
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 25
    split = quiz_split / "iqtt-test.h5"
    assert iqtt("quiz-report", "a.db", "--questions", split).exit_code == 0
    refused("quiz", "--db", "a.db", "--export", "a.csv", words=("a.csv", "overwrite"))
    other = made_answers(tmp_path / "other.db", 2)
    refused("quiz", split, "--db", other, "--export", "c.csv", words=("aaaaaaaaaaaa", str(split)))
    refused("quiz-report", other, "--questions", split, words=("aaaaaaaaaaaa", str(split)))
    assert not (tmp_path / "c.csv").exists()


def test_what_is_refused_before_anything_is_served(quiz_split, tmp_path, refused):
    split = quiz_split / "iqtt-test.h5"
    for host in ("0.0.0.0", "192.168.0.1", "example.org", "::", "", "0"):
        refused("quiz", split, "--host", host, words=("--host", "--public"))
    refused("quiz", split, "--host", "host.invalid", "--public", words=("host.invalid",))
    refused("quiz", words=("SPLIT.h5",))
    refused("quiz", split, "--questions", "25", words=("25",))
    refused("quiz", split, "--questions", "0", words=("questions", "0"))
    refused("quiz", split, "--db", split, words=("input",))
    refused("quiz", split, "--db", "none/a.db", words=("none", "folder"))
    assert list(tmp_path.iterdir()) == []
    shutil.copy(split, tmp_path / "alone.h5")
    refused("quiz", tmp_path / "alone.h5", words=("answers",))
    other = made_answers(tmp_path / "other.db", 2)
    refused("quiz", split, "--db", other, words=("another split", "--db"))
    (tmp_path / "text.db").write_text("text")
    refused("quiz", split, "--db", "text.db", words=("text.db",))
    refused("quiz-report", "text.db", words=("text.db",))
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        refused("quiz", split, "--port", port, words=(str(port), "in use"))


def test_the_report_refuses_to_write_over_its_input(tmp_path, refused):
    path = made_answers(tmp_path / "answers.db", 2)
    refused("quiz-report", path, "--json", path, "--overwrite", words=("input",))


def test_without_the_extra(quiz_split, refused, monkeypatch):
    find = __import__("importlib.util").util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda n: None if n == "uvicorn" else find(n))
    refused("quiz", quiz_split / "iqtt-test.h5", words=("uvicorn", "[quiz]"))

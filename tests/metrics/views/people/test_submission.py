"""People's answers as a submission: `bench score` gives the accuracy that the answers have."""

from collections import Counter
from statistics import mean

import pytest
from quizzes import made_answers

from iqtt.quiz.answers import read_answers
from iqtt.quiz.study import Study
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from metrics.submissions.reader import open_predictions
from metrics.views.people.figures import counted
from metrics.views.people.submission import write_submission


@pytest.fixture(scope="module")
def people(quiz_split, tmp_path_factory):
    """Return answers of 8 people to 12 of the 24 questions each."""
    import quizzes

    path = tmp_path_factory.mktemp("people") / "answers.db"
    with Study(quiz_split / "iqtt-test.h5", questions=12, calibrations=1) as study:
        drawn = quizzes.made_draw
        quizzes.made_draw = lambda number, settings=None: study.draw(number)
        try:
            made_answers(path, 8, 1, settings=study.settings)
        finally:
            quizzes.made_draw = drawn
    return read_answers(path)


def test_one_of_those_who_were_asked(people, quiz_split, tmp_path):
    split, truth = quiz_split / "iqtt-test.h5", quiz_split / "iqtt-test-answers.h5"
    given, different = {}, set()
    for one in counted(people):
        given.setdefault(one.question, set()).add(one.answer)
    scored = []
    for seed in range(30):
        path = tmp_path / f"{seed}.h5"
        count = write_submission(people, split, path, "one", seed)
        with open_predictions(path) as predictions:
            rows, answers = predictions.rows.tolist(), predictions.answers.tolist()
        assert rows == sorted(given)
        different.add(tuple(answers))
        assert all(answer in given[row] for row, answer in zip(rows, answers, strict=True))
        scores = score([path], truth, Settings(allow_partial=True, processes=1))
        scored.append(scores.metrics["iqtt_accuracy"].value)
        assert scores.metrics["iqtt_accuracy"].n == count
    shares = [mean(one.correct for one in counted(people) if one.question == row) for row in given]
    assert mean(scored) == pytest.approx(mean(shares), abs=0.04)
    assert len(different) == 30
    assert write_submission(people, split, tmp_path / "again.h5", "one", 3) == count
    assert (tmp_path / "again.h5").read_bytes() == (tmp_path / "3.h5").read_bytes()


def test_what_most_answered(people, quiz_split, tmp_path):
    write_submission(people, quiz_split / "iqtt-test.h5", tmp_path / "m.h5", "majority")
    with open_predictions(tmp_path / "m.h5") as predictions:
        scored = dict(zip(predictions.rows.tolist(), predictions.answers.tolist(), strict=True))
    for row, answer in scored.items():
        votes = Counter(one.answer for one in counted(people) if one.question == row)
        best = [place for place, n in votes.items() if n == max(votes.values())]
        assert answer == (best[0] if len(best) == 1 else -1)
    assert -1 in scored.values(), "a tie is among the made-up answers"

"""People's answers as a submission that `bench score` reads, beside those of models."""

from collections import defaultdict
from pathlib import Path
from typing import Literal

import numpy as np

from iqtt.quiz.answers import Answers
from metrics.measures.answers import answers_from_scores
from metrics.submissions.writer import write_answers
from metrics.views.people.figures import counted
from scenegen.common.random.seeding import Purpose, item_rng

Whose = Literal["one", "majority"]


def write_submission(
    people: Answers, split: str | Path, path: str | Path, whose: Whose = "one", seed: int = 0,
    overwrite: bool = False,
) -> int:  # fmt: skip
    """Write an answer to each question that people were asked; return how many these are.

    With "one", the answer of a question is that of one participant, drawn from those who were asked
    it: accuracy is then an unbiased estimate of a person's. With "majority" it is what most of them
    answered, an abstention where two answers have as many; accuracy is then a crowd's, which is
    higher. Questions that nobody was asked are left out, so that a score is partial.

    Args:
        split: the file of questions, which `people` belong to.
        seed: of the draw, which is that of the question for each seed.

    Raises FileFormatError where nobody finished, and as `write_answers`.
    """
    answers_to: dict[int, list[int]] = defaultdict(list)
    for answer in counted(people):
        answers_to[answer.question].append(answer.answer)
    rows = sorted(answers_to)
    if whose == "one":
        answers = [
            answers_to[row][
                item_rng(seed, row, Purpose.QUIZ, attempt=3).integers(len(answers_to[row]))
            ]
            for row in rows
        ]
        scores = None
    else:
        places = range(people.settings.answers)
        votes = [answers_to[row] for row in rows]
        scores = np.array([[vote.count(k) / len(vote) for k in places] for vote in votes])
        answers = answers_from_scores(scores).tolist()
    notes = f"{len({answer.participant for answer in counted(people)})} participants of iqtt quiz"
    write_answers(
        path, split, method=f"people, {whose}", run=f"seed {seed}" if whose == "one" else "",
        answer=np.array(answers), scores=scores, rows=rows, notes=notes, overwrite=overwrite,
    )  # fmt: skip
    return len(rows)

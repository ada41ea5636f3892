"""What stands beside people's scores: chance, the floor of outlines, and the paper's figures."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from iqtt.floors import Floor, floor_of_questions
from iqtt.quiz.pages import Bar
from iqtt.quiz.study import UNTOLD, Question
from metrics.measures.statistics import wilson_interval
from metrics.views.paper import PAPER, PEOPLE, TABLES

THREE = 3  # answers of each of the paper's questions
CONFLICT = (
    "The paper counts 40 people in its text and 41 participants in its appendix; 20 questions each."
)
SHAPIRO = (
    "The paper calls its scores normally distributed as the Shapiro-Wilk test gave p < 0.05. A"
    " small p speaks against a normal distribution."
)


@dataclass(frozen=True)
class Reference:
    """A fraction of right answers that others reached, and where it comes from."""

    name: str
    value: float
    note: str


def references(kinds: Sequence[str], answers: int, floors: Mapping[str, Floor]) -> list[Reference]:
    """Return chance, the floor of these kinds of questions if known, and figures of the paper.

    Args:
        kinds: of each question that counts.
        answers: how many answers a question offers.
        floors: as `floors.floors_of` returns them.
    """
    counts = {} if UNTOLD in kinds else dict(Counter(kinds))
    found = floor_of_questions(counts, floors)
    beside = [Reference("Chance", 1 / answers, "guessing")]
    if found is not None:
        beside.append(Reference("Without 3D", found[0], f"the best of many tricks: {found[1]}"))
    figures = [f for f in TABLES[2].figures if f.method in (PEOPLE, PAPER)]
    for figure in figures if answers == THREE else ():
        spread = f" ± {figure.spread}" if figure.spread else ""
        labels = f", {figure.labels:,} labels" if figure.labels else ", no labels"
        name = "People in the paper" if figure.method == PEOPLE else f"{figure.method}{labels}"
        note = f"{figure.text}{spread}, as reported, on other questions"
        beside.append(Reference(name, float(figure.text), note))
    return beside


def compare(
    answers: int, floors: Mapping[str, Floor], results: Sequence[tuple[Question, bool]]
) -> list[Bar]:
    """Return a participant's score with Wilson's interval, and the references below it.

    Args:
        answers, floors: as in `references`.
        results: each question that counts, and whether it was answered rightly.
    """
    right, count = sum(good for _, good in results), len(results)
    score = Bar(
        "You", right / count, *wilson_interval(right, count), f"{right} of {count}", own=True
    )
    others = references([question.kind for question, _ in results], answers, floors)
    return [score, *(Bar(other.name, other.value, None, None, other.note) for other in others)]

"""What people's answers in `iqtt.quiz` tell: accuracy by kind, beside the people of the paper.

Only participants who finished count, and only the questions after the calibration. Accuracy is a
fraction of right answers. Participants are the sample of all intervals.
"""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType

import numpy as np
from scipy import stats

from iqtt.floors import Floor, floor_of_questions
from iqtt.quiz.answers import Answer, Answers
from iqtt.quiz.study import UNTOLD
from metrics.views.paper import PAPER, PEOPLE, TABLES
from metrics.views.table import make_table, to_text
from scenegen.common.errors import FileFormatError

FORMAT_NAME, FORMAT_VERSION = "pix2shape-bench/quiz-report", "2.0"
CONFIDENCE = 0.95
ALL = "all"
THREE = 3  # answers of each of the paper's questions
NONE = "-"
NOTES = (
    "Only participants who finished count, and only the questions after the calibration. Intervals"
    " take participants as the sample.",
    "The paper counts 40 people in its text and 41 participants in its appendix, with 20 questions"
    " each.",
)


@dataclass(frozen=True)
class Group:
    """The answers to questions of one kind, or to all.

    Attributes:
        answers: their number.
        accuracy: mean of participants' accuracies.
        low, high: its 95% interval (Student); None for fewer than three participants, or where
            none differ.
        floor: of methods without 3D, where it is known.
    """

    name: str
    answers: int
    accuracy: float
    low: float | None
    high: float | None
    floor: float | None


@dataclass(frozen=True)
class Reference:
    """A fraction of right answers that others reached, and where it comes from."""

    name: str
    value: float
    note: str


@dataclass(frozen=True)
class Figures:
    """What a report tells.

    Attributes:
        begun, finished: numbers of participants.
        questions: how many each was asked; `distinct` is how many different ones were asked.
        candidates: how many answers a question offered.
        groups: all answers, then those of each kind.
        references: what stands beside them.
    """

    begun: int
    finished: int
    questions: int
    distinct: int
    candidates: int
    groups: Sequence[Group]
    references: Sequence[Reference]


def compute(people: Answers, floors: Mapping[str, Floor] = MappingProxyType({})) -> Figures:
    """Return all figures; `floors` are those of the kinds of questions, from `iqtt.floors`.

    Raises FileFormatError where nobody finished.
    """
    answers = [a for a in people.answers if a.finished and not a.calibration]
    if not answers:
        found = f"{people.participants} participants, of whom none finished"
        raise FileFormatError(people.path, found, "at least one who did")
    kinds = Counter(answer.kind for answer in answers)
    floor = floor_of_questions({} if UNTOLD in kinds else kinds, floors)
    groups = [_group(ALL, answers, None if floor is None else floor[0])]
    for kind in sorted(kinds):
        chosen = [answer for answer in answers if answer.kind == kind]
        groups.append(_group(kind, chosen, floors[kind].accuracy if kind in floors else None))
    offered = people.settings.answers
    beside = [Reference("Chance", 1 / offered, "guessing")]
    if floor is not None:
        beside.append(Reference("Without 3D", floor[0], f"the best of many tricks: {floor[1]}"))
    return Figures(
        begun=people.participants,
        finished=len({answer.participant for answer in answers}),
        questions=people.settings.questions,
        distinct=len({answer.question for answer in answers}),
        candidates=offered,
        groups=groups,
        references=[*beside, *(_of_paper() if offered == THREE else ())],
    )


def _group(name: str, answers: Sequence[Answer], floor: float | None) -> Group:
    index = np.unique([answer.participant for answer in answers], return_inverse=True)[1]
    shares = np.bincount(index, [answer.correct for answer in answers]) / np.bincount(index)
    mean, low, high = float(shares.mean()), None, None
    if len(shares) > 2 and np.ptp(shares) > 0:
        quantile = float(stats.t.ppf((1 + CONFIDENCE) / 2, len(shares) - 1))
        half = quantile * float(shares.std(ddof=1)) / math.sqrt(len(shares))
        low, high = max(0.0, mean - half), min(1.0, mean + half)
    return Group(name, len(answers), mean, low, high, floor)


def _of_paper() -> list[Reference]:
    """Return what people and the model reached in the paper, on other questions."""
    references = []
    for figure in TABLES[2].figures:
        if figure.method in (PEOPLE, PAPER):
            spread = f" ± {figure.spread}" if figure.spread else ""
            labels = f", {figure.labels:,} labels" if figure.labels else ", no labels"
            name = "People in the paper" if figure.method == PEOPLE else f"{figure.method}{labels}"
            note = f"{figure.text}{spread}, as reported, on other questions"
            references.append(Reference(name, float(figure.text), note))
    return references


def text_report(figures: Figures) -> str:
    """Return the tables and the notes."""
    rows = [
        (group.name, str(group.answers), _percent(group.accuracy), _ends(group),
         NONE if group.floor is None else _percent(group.floor))
        for group in figures.groups
    ]  # fmt: skip
    head = ("kind", "answers", "right in percent", "95% interval", "floor")
    beside = [(other.name, _percent(other.value), other.note) for other in figures.references]
    tables = [
        make_table("By kind of question", head, rows),
        make_table("Beside it", ("accuracy in percent", "value", "where it comes from"), beside),
    ]
    people = f"{figures.finished} participants finished of {figures.begun} who began"
    questions = f"{figures.questions} questions each, {figures.distinct} different ones"
    title = f"{people}; {questions}, with {figures.candidates} answers"
    return to_text(title, tables, [f"note: {note}" for note in NOTES])


def to_json(figures: Figures) -> str:
    """Return JSON whose keys are the attributes of `Figures` and of what is in it."""
    head = {"format": FORMAT_NAME, "format_version": FORMAT_VERSION, "confidence": CONFIDENCE}
    return json.dumps({**head, **asdict(figures), "notes": NOTES}, indent=2, allow_nan=False) + "\n"


def _percent(value: float) -> str:
    return f"{100 * value:.1f}"


def _ends(group: Group) -> str:
    if group.low is None or group.high is None:
        return NONE
    return f"[{_percent(group.low)}, {_percent(group.high)}]"

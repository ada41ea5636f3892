"""The headline of a report: the answer in a sentence, and each main score beside what it means.

Beside a score stand its floor, what the paper reports, and the scores of other methods.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from metrics.report.axes import span, tick_labels
from metrics.report.charts import FLOOR, Svg, kind_of, strip
from metrics.report.paper_tables import REPORTED, SOURCE, TABLES, Figure
from metrics.report.text import as_shown, floor_text, interval_cells, references
from metrics.scoring.estimates import question_skill
from metrics.scoring.metric_names import HEADLINE, in_order, metric
from metrics.scoring.records import Score, ScoreFile, Skill
from scenegen.common.text_table import by_number, distinct, number, plain

PAPER = "Pix2Shape"  # of the paper's methods, the one that the headline shows
PEOPLE = "Human Evaluation"
PAPER_KIND = "other"  # of questions, which is that of the paper's
NOTHING_DRAWN = Svg()
PAPER_NOTE = f"† {SOURCE.split(',')[0]}), {REPORTED}, so it only tells the order of magnitude."


@dataclass(frozen=True)
class Cell:
    """What stands in a cell: a value, what follows it in small letters, and a drawing."""

    value: str = "-"
    rest: str = ""
    drawing: Svg = NOTHING_DRAWN


Grid = tuple[tuple[str, ...], list[tuple[Cell | str, ...]]]  # the head of a table, and its rows


def main_scores(scores: ScoreFile) -> list[str]:
    """Return the names of the headline's scores that a file has; else of others."""
    return [n for n in HEADLINE[scores.task] if n in scores.metrics] or in_order(scores.metrics)[:5]


def answer(scores: ScoreFile) -> tuple[str, str, str]:
    """Return what a report is about as value, interval, and words; of the skill where there is one.

    The interval is empty where there is none.
    """
    names = main_scores(scores)
    name = next((name for name in names if name in scores.skills), names[0])
    title = metric(name).title
    if name in scores.skills:
        skill = scores.skills[name]
        value, interval = interval_cells(skill)
        told = f"skill of {title}: {_verdict(skill)} (floor: {_floor_name(scores, name)})"
    else:
        value, interval = interval_cells(scores.metrics[name])
        told = f"{title} ({metric(name).unit}, {metric(name).direction}); no floor is known"
    return value, "" if interval == "-" else interval, told


def _verdict(skill: Skill) -> str:
    if skill.value == 1.0:
        return "perfect"
    if skill.low is None or skill.high is None:
        where = "above" if skill.value > 0.0 else "not above"
        return f"{where} the floor, but too little was scored for an interval"
    if skill.low > 0.0:
        return "better than the floor"
    return "worse than the floor" if skill.high < 0.0 else "not told apart from the floor"


def labels_beside(scores: ScoreFile, beside: Sequence[ScoreFile]) -> list[str]:
    """Return names of this method and of the others, all of them different."""
    files = [scores, *beside]
    return distinct([f.method for f in files], [f.path.stem if f.path else "" for f in files])


def headline_table(scores: ScoreFile, beside: Sequence[ScoreFile] = ()) -> Grid:
    """Return a row for each main score: skill, value, drawing, floor, paper, other methods.

    Columns in which no score has anything are left out, but for the paper's.
    """
    own, *others = labels_beside(scores, beside)
    head = ("score", "skill", own, "on its scale", "floor", "paper †", *others)
    rows = [_headline_row(scores, beside, name) for name in main_scores(scores)]
    empty = {
        i for i in (1, 4) if all(isinstance(row[i], Cell) and row[i] == Cell() for row in rows)
    }
    kept = [i for i in range(len(head)) if i not in empty]
    return tuple(head[i] for i in kept), [tuple(row[i] for i in kept) for row in rows]


def _headline_row(
    scores: ScoreFile, beside: Sequence[ScoreFile], name: str
) -> tuple[Cell | str, ...]:
    score, known = scores.metrics[name], metric(name)
    skill = scores.skills.get(name)
    others = [(i, f.metrics[name]) for i, f in enumerate(beside, 1) if name in f.metrics]
    marks = [] if skill is None else [(f"at {FLOOR}", skill.floor)]
    ends = [end for one in (score, *(s for _, s in others)) for end in _ends(one)]
    ticks = span([*ends, *(at for _, at in marks)], known.smallest, known.largest)
    marks += [(f"mark {kind_of(i)}", one.value) for i, one in others]
    low, high = _ends(score)[1:]
    drawing = strip(score.value, (low, high), marks, ticks)
    first, *_, last = tick_labels(ticks)
    unit = "" if known.unit in ("fraction", "correlation") else f"{known.unit}, "
    found = dict(others)
    return (
        Cell(known.title, unit + known.direction),
        Cell() if skill is None else _cell(skill),
        _cell(score),
        Cell("", f"{first} to {last}", drawing),
        _floor_cell(scores, name),
        paper_cell(name),
        *(_cell(found[i]) if i in found else Cell() for i in range(1, len(beside) + 1)),
    )


def _ends(one: Score) -> tuple[float, float, float]:
    low, high = (math.nan if end is None else end for end in (one.low, one.high))
    return one.value, low, high


def _cell(one: Score | Skill, drawing: Svg = NOTHING_DRAWN) -> Cell:
    value, interval = interval_cells(one)
    std = getattr(one, "std", None)
    spread = "" if std is None else f"± {number(std, one.value)} "
    return Cell(value, spread + ("" if interval == "-" else interval), drawing)


def _floor_cell(scores: ScoreFile, name: str) -> Cell:
    """The floor of a score, and what chance or noise gives."""
    told = []
    label, value = references(scores).get(name, ("", 0.0))
    like = as_shown(scores.metrics[name])
    if name in scores.skills:
        floor = f"{number(scores.skills[name].floor, like)}"
        told.append(_floor_name(scores, name))
        if label and label not in told[0]:
            told.append(f"{label} {number(value, like)}")
        return Cell(floor, "; ".join(told))
    return Cell(number(value, like), label) if label else Cell()


def _floor_name(scores: ScoreFile, name: str) -> str:
    """What the floor is, in words; of several kinds of questions each has its own."""
    if len(scores.by_distractor) > 1:
        return "the mean of the floors of these kinds of questions"
    return plain(floor_text(scores, name))


def paper_cell(name: str) -> Cell:
    """Return what the paper reports of its own method, and of people, in this score."""
    figures = [f for table in TABLES[:3] for f in table.figures if f.metric == name]
    shown = [f for f in figures if f.view_angle is None and f.method == PAPER]
    people = [f for f in figures if f.method == PEOPLE]
    if people:  # of questions; with most labels is what the paper reports as best
        best = max(shown, key=lambda figure: figure.labels or 0)
        rest = f"people, ± {people[0].spread}; {PAPER} {best.text} with {best.labels:,} labels"
        return Cell(people[0].text, rest)
    if not shown:
        return Cell("-", "not in the paper")
    first, *rest_of = [_with_data(figure) for figure in shown]
    return Cell(shown[0].text, "; ".join([first.partition(" ")[2], *rest_of]))


def _with_data(figure: Figure) -> str:
    return f"{figure.text} {figure.data}"


def kinds_table(scores: ScoreFile, grouping: str, beside: Sequence[ScoreFile] = ()) -> Grid:
    """Return a row for each group of questions: accuracy, drawing, and what it stands beside.

    That is chance; by kind of question also skill, the best floor without 3D, and people, whose
    questions were all of one kind.
    """
    answers = scores.meta.counts["answers"]
    by_kind = grouping == "by_distractor"
    own, *others = labels_beside(scores, beside)
    head = ["", own, "from 0 to 1", "questions", "chance"]
    head += ["skill", "floor", "people †"] if by_kind else []
    groups = getattr(scores, grouping)
    rows: list[tuple[Cell | str, ...]] = []
    for key in by_number(groups):
        score = groups[key].get("iqtt_accuracy")
        if score is None:
            continue
        marks, cells = [("chance", 1.0 / answers)], list[Cell | str]()
        if by_kind:
            skill = question_skill(score, {key: score.n}, answers)
            marks.append((f"at {FLOOR}", skill.floor))
            people = next(f for f in TABLES[2].figures if f.method == PEOPLE)
            told = Cell(people.text, f"± {people.spread}") if key == PAPER_KIND else Cell()
            cells = [_cell(skill), Cell(number(skill.floor), skill.floor_name), told]
        beside_it = [(i, getattr(f, grouping).get(key, {})) for i, f in enumerate(beside, 1)]
        found = {i: one["iqtt_accuracy"] for i, one in beside_it if "iqtt_accuracy" in one}
        marks += [(f"mark {kind_of(i)}", one.value) for i, one in found.items()]
        drawing = strip(score.value, _ends(score)[1:], marks, [0.0, 1.0])
        rows.append(
            (
                Cell(key),
                _cell(score),
                Cell("", "", drawing),
                f"{score.n:,}",
                number(1.0 / answers),
                *cells,
                *(_cell(found[i]) if i in found else Cell() for i in range(1, len(beside) + 1)),
            )
        )
    return (*head, *others), rows


def notes(scores: ScoreFile) -> Iterator[str]:
    """Yield what has to be known to read the headline."""
    level = f"{100 * scores.meta.confidence:.4g}%"
    over = "scenes" if scores.task == "rooms" else "shapes or questions"
    yield (
        f"[low, high]: {level} interval over {over}. On its scale: the dot is this method with its"
        " interval, the solid line its floor, and dashed lines are the methods beside it."
    )
    yield PAPER_NOTE

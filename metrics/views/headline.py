"""The headline of a page: the answer in a sentence, and each main score beside what it means.

Beside a score stand its floor, what the paper reports, and the scores of other methods.
"""

from collections.abc import Iterator, Sequence

from metrics.scoring.metric_names import in_order, metric
from metrics.scoring.records import GROUPINGS, Score, ScoreFile, Skill
from metrics.views.by_angle import score_point
from metrics.views.page import Lead, Section
from metrics.views.paper import PAPER, PAPER_KIND, PEOPLE, REPORTED, SOURCE, TABLES, tables_beside
from metrics.views.plots import kind_of, strip
from metrics.views.score_tables import (
    GROUP_TITLES,
    INTERVAL,
    SKILL,
    few_clusters,
    floor_cell,
    floor_text,
    interval_cells,
    kind_skill,
    labels_of,
    score_cell,
    unread_notes,
    what_the_floor_is,
)
from metrics.views.table import Cell, Table, make_table
from scenegen.common.text_table import by_number, number

PAPER_NOTE = f"† {SOURCE.split(',')[0]}), {REPORTED}, so it only tells the order of magnitude."
KINDS_REMARK = (
    "On each line the dot is this method with its interval; the solid line is the floor, the best"
    " method without 3D, the dotted one chance; dashed lines are the methods beside. † as above;"
    " the paper's questions were of the kind “other”."
)


def headline_lead(scores: ScoreFile) -> Lead:
    """Return the main result: the value of the first skill, or of the first score without any."""
    names = _main_scores(scores)
    name = next((name for name in names if name in scores.skills), names[0])
    title = metric(name).title
    if name in scores.skills:
        skill = scores.skills[name]
        value, interval = interval_cells(skill)
        text = f"skill of {title}: {_verdict(skill)} (floor: {floor_text(scores, name)})"
    else:
        value, interval = interval_cells(scores.metrics[name])
        text = f"{title} ({scores.unit_of(name)}, {metric(name).direction}); no floor is known"
    return Lead(value, text if interval == "-" else f"{interval} {text}")


def _main_scores(scores: ScoreFile) -> list[str]:
    """Return the names of the headline's scores that a file has; else of others."""
    return list(scores.headline) or in_order(scores.metrics)[:5]


def _verdict(skill: Skill) -> str:
    if skill.value == 1.0:
        return "perfect"
    if skill.is_floor:
        return "the floor itself"
    if skill.low is None or skill.high is None:
        where = "above" if skill.value > 0.0 else "not above"
        return f"{where} the floor, but too little was scored for an interval"
    if skill.low > 0.0:
        return "better than the floor"
    return "worse than the floor" if skill.high < 0.0 else "not told apart from the floor"


def headline_section(files: Sequence[ScoreFile]) -> Section:
    """Return a row for each main score of the first file: skill, value, floor, paper, the others.

    Columns in which no score has anything are left out, but for the paper's.
    """
    scores, *beside = files
    label, *labels = labels_of(files)
    head = ("score", "skill", label, "on its scale", "floor", "paper †", *labels)
    rows = [_headline_row(scores, beside, name) for name in _main_scores(scores)]
    empty = {i for i in (1, 4) if all(row[i] == Cell() for row in rows)}
    reported = tables_beside(scores)
    empty |= set() if reported else {5}
    kept = [i for i in range(len(head)) if i not in empty]
    cells = ([row[i] for i in kept] for row in rows)
    table = make_table("Headline", [head[i] for i in kept], cells)
    over = scores.unit if scores.task != "iqtt" else "shapes or questions"
    notes = unread_notes(files)
    notes += [f"{SKILL} {what_the_floor_is(scores)}"] if scores.skills else []
    notes += [
        f"[low, high]: {INTERVAL} over {over}. On its scale: the dot is this method with its"
        " interval, the solid line its floor, and dashed lines are the methods beside it.",
        *([PAPER_NOTE] if reported else []),
        *(f"Warning: {text}." for text in few_clusters(scores)),
    ]
    return Section("", tables=[table], notes=notes)


def _headline_row(scores: ScoreFile, beside: Sequence[ScoreFile], name: str) -> list[Cell]:
    score, definition = scores.metrics[name], metric(name)
    skill, others = scores.skills.get(name), [file.metrics.get(name) for file in beside]
    marks = [] if skill is None else [("floor", skill.floor)]
    unit = "" if definition.unit in ("fraction", "correlation") else f"{scores.unit_of(name)}, "
    return [
        Cell(definition.title, unit + definition.direction),
        score_cell(skill),
        score_cell(score),
        _strip_cell(score, others, marks, (definition.smallest, definition.largest)),
        floor_cell(scores, name),
        paper_cell(name),
        *map(score_cell, others),
    ]


def _strip_cell(
    score: Score,
    others: Sequence[Score | None],
    marks: Sequence[tuple[str, float]],
    limits: tuple[float, float],
    ends: Sequence[float] = (),
) -> Cell:
    """Return a drawing of a score with marks, and with those of other methods.

    Its scale goes as far as `ends`, and farther where a score does.
    """
    theirs = [(kind_of(i), other) for i, other in enumerate(others, 1) if other is not None]
    shown = [*marks, *((kind, other.value) for kind, other in theirs)]
    points = [score_point(other) for _, other in theirs]
    farther = [end for point in points for end in (point.low, point.high)]
    drawing, scale = strip(score_point(score), shown, [*farther, *ends], limits)
    return Cell("", scale, drawing=drawing)


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
    others = (f"{figure.text} {figure.data}" for figure in shown[1:])
    return Cell(shown[0].text, "; ".join([shown[0].data, *others]))


def kinds_sections(files: Sequence[ScoreFile]) -> Iterator[Section]:
    """Yield the accuracy by each grouping of questions: of the first file, and of those beside."""
    for grouping in GROUPINGS["iqtt"]:
        if getattr(files[0], grouping):
            table = _kinds_table(files, grouping)
            first = grouping == "by_distractor"
            yield Section(table.title, tables=[table], notes=[KINDS_REMARK] if first else [])


def _kinds_table(files: Sequence[ScoreFile], grouping: str) -> Table:
    """Return a row for each group of questions: accuracy, drawing, and what it stands beside.

    That is chance; by kind of question also skill, the best floor without 3D, and people, whose
    questions were all of one kind.
    """
    scores = files[0]
    chance = 1.0 / scores.meta.counts["answers"]
    by_kind = grouping == "by_distractor"
    people = next(f for f in TABLES[2].figures if f.method == PEOPLE)
    rows: list[Sequence[Cell | str]] = []
    for key in by_number(getattr(scores, grouping)):
        score, *others = [
            getattr(file, grouping).get(key, {}).get("iqtt_accuracy") for file in files
        ]
        if score is None:
            continue
        marks, cells = [("chance", chance)], list[Cell]()
        if by_kind:
            skill = kind_skill(scores, key)
            marks += [] if skill is None else [("floor", skill.floor)]
            reported = Cell(people.text, f"± {people.spread}") if key == PAPER_KIND else Cell()
            floor = Cell() if skill is None else Cell(number(skill.floor), skill.floor_name)
            cells = [score_cell(skill), floor, reported]
        drawing = _strip_cell(score, others, marks, (0.0, 1.0), ends=(0.0, 1.0))
        beside_it = map(score_cell, others)
        rows.append(
            (key, score_cell(score), drawing, f"{score.n:,}", number(chance), *cells, *beside_it)
        )
    label, *labels = labels_of(files)
    more = ("skill", "floor", "people †") if by_kind else ()
    head = ("", label, "on its scale", "questions", "chance", *more, *labels)
    return make_table(f"Accuracy {GROUP_TITLES[grouping]}", head, rows)

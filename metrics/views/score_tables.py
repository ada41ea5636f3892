"""Tables of one score file, as text, Markdown and CSV: headline, all scores, main ones by group."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np

from iqtt.questions.specs import LETTERS
from metrics.measured.protocols import BY_NAME, DECLARED
from metrics.measures.alignment import Alignment
from metrics.measures.statistics import FEW_CLUSTERS
from metrics.scoring.estimates import CONFIDENCE, question_skill
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import (
    BASELINES,
    HEADLINE,
    OTHER_SCENE,
    in_order,
    metric,
)
from metrics.scoring.records import GROUPINGS, Meta, Score, ScoreFile, Skill
from metrics.views.table import Cell, Table, make_table, to_markdown, to_text
from scenegen.common.text_table import by_number, distinct, number, plain, with_interval
from scenegen.files.new_file import written_beside

INTERVAL = f"{CONFIDENCE:.0%} interval"
NO_FLOOR = (
    "no skill: no floor is known of questions with these settings. `iqtt floors {} --out"
    " floors.json` measures it, and `bench score --floors floors.json` uses it"
)
SKILL = "Skill: 1 is perfect, 0 is as good as the floor, below 0 is worse than the floor."
UNREAD = "replies that name no letter; they count as wrong"
BY_KIND = "by kind of question"
GROUP_TITLES = {
    "by_view_angle": "by degrees between the view and the scene's first one",
    "by_object_shape": "of single objects, by shape",
    "by_object_size": "of single objects, by share of the picture in percent",
    "by_distractor": BY_KIND,
    "by_rotation_angle": "by rotation between reference and right answer, degrees",
    "by_position": "by place of the right answer",
    "by_answer": "by the answer that was given",
    "by_outcome": "by what the model's text held",
    "by_circle": "circular: right in every order of the answers",
}
ALIGNMENT_SCORES = ("abs_rel", "rmse", "delta_1")
GROUP_SCORES = HEADLINE


def text_report(
    scores: ScoreFile, as_markdown: bool = False, whole: bool = False, width: int | None = None
) -> str:
    """Return the headline, as aligned text or Markdown, and accuracy by kind of question.

    Args:
        whole: whether all scores, and the main ones by group, stand there as well.
        width: characters of a line, to which sentences are wrapped.
    """
    tables, notes = [headline_rows(scores)], list(notes_of(scores))
    if whole:
        tables += [*alignment_tables(scores), all_scores(scores), *group_tables(scores)]
    else:
        tables += [table for table in group_tables(scores) if table.title == BY_KIND]
        notes.append("--all prints all scores and groups")
    return (to_markdown if as_markdown else to_text)(title_of(scores), tables, notes, width)


def write_csv(scores: ScoreFile, path: str | Path, overwrite: bool = False) -> None:
    """Write a line with the scores of each item. Raises OSError as `new_file.written_beside`."""
    with (
        written_beside(path, overwrite) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        out = csv.writer(file)
        out.writerow(scores.items)
        columns = [np.asarray(column).tolist() for column in scores.items.values()]
        out.writerows(zip(*columns, strict=True))


def headline_rows(scores: ScoreFile) -> Table:
    """Return a row for each skill of a headline score, then for each such score, with floors."""
    names = scores.headline
    rows: list[Sequence[str]] = [
        (f"skill of {n}", *interval_cells(scores.skills[n]), f"0: {floor_text(scores, n)}")
        for n in names
        if n in scores.skills
    ]
    for name in names:
        floor = floor_cell(scores, name)
        text = f"{floor.value}: {floor.rest}" if floor.rest else floor.value
        rows.append((name, *interval_cells(scores.metrics[name]), text))
    if scores.unread is not None:
        rows.append(("unread replies", f"{scores.unread:.0%}", "-", UNREAD))
    return make_table("", ("headline", "value", INTERVAL, "floor"), rows)


def floor_text(scores: ScoreFile, name: str) -> str:
    """Return the name of the floor of a score that has a skill."""
    if scores.task != "iqtt":
        return BASELINES[scores.skills[name].floor_name[: -len(name)]].name
    return scores.skills[name].floor_name


def floor_cell(scores: ScoreFile, name: str) -> Cell:
    """Return the floor of a score with its name, and what chance gives."""
    label, value = references(scores).get(name, ("", 0.0))
    reference = _beside(value, scores.metrics[name])
    if name not in scores.skills:
        return Cell(reference, label) if label else Cell()
    floor, texts = scores.skills[name].floor, [floor_text(scores, name)]
    if label and not texts[0].startswith(label):
        texts.append(f"{label} {reference}")
    return Cell(_beside(floor, scores.metrics[name]), "; ".join(texts))


def _beside(reference: float, score: Score) -> str:
    """Return a number as its score is shown, but never a rounded 0."""
    text = number(reference, (score.low, score.high))
    return number(reference) if reference and float(text) == 0 else text


def references(scores: ScoreFile) -> dict[str, tuple[str, float]]:
    """Return by name of the score what chance gives, with its label."""
    if scores.task == "iqtt":
        return {"iqtt_accuracy": ("chance", 1.0 / scores.meta.counts["answers"])}
    return {}


def alignment_tables(scores: ScoreFile) -> Iterator[Table]:
    """Yield the scores of depth under each alignment side by side, the one that ranks first."""
    ending = "" if scores.alignment == "none" else f"_after_{scores.alignment}"
    names = [f"{name}{ending}" for name in ALIGNMENT_SCORES]
    if not all(name in scores.metrics for name in names):
        return
    rows = []
    for alignment in get_args(Alignment):
        ending = "" if alignment == "none" else f"_after_{alignment}"
        shown = [scores.metrics.get(f"{name}{ending}") for name in ALIGNMENT_SCORES]
        if shown[0] is not None and (ending or scores.alignment == "none"):
            ranks = alignment == scores.alignment
            label = f"{alignment} (ranks)" if ranks else alignment
            rows.append((not ranks, [label, *map(score_cell, shown)]))
    table = [row for _, row in sorted(rows, key=lambda row: row[0])]
    yield make_table("depth after each alignment", ("alignment", *ALIGNMENT_SCORES), table)


def all_scores(scores: ScoreFile) -> Table:
    """Return a row for each score; what chance gives follows its score."""
    rows: list[Sequence[str]] = []
    beside = references(scores)
    for name in in_order(scores.metrics):
        score = scores.metrics[name]
        better = "higher" if metric(name).higher_is_better else "lower"
        std = "-" if score.std is None else number(score.std, (score.low, score.high))
        skill = scores.skills.get(name)
        floor = "-" if skill is None else _beside(skill.floor, score)
        rows.append((name, *interval_cells(score), std, floor, score.unit, better))
        if name in beside:
            label, value = beside[name]
            rows.append((f"  {label}", _beside(value, score), "-", "-", "-", score.unit, ""))
    head = ("score", "value", INTERVAL, "std of runs", "floor", "unit", "better")
    return make_table("all scores", head, rows)


def group_tables(scores: ScoreFile) -> Iterator[Table]:
    """Yield a table for each grouping that the scores have: a row for each group."""
    for grouping in GROUPINGS[scores.task]:
        groups = getattr(scores, grouping)
        if not groups:
            continue
        held = {name for group in groups.values() for name in group}
        names = [name for name in GROUP_SCORES[scores.task] if name in held] or in_order(held)
        with_floors = grouping == "by_distractor"
        rows: list[Sequence[Cell | str]] = []
        for key in by_number(groups):
            group = groups[key]
            cells = [_group_cell(group.get(name)) for name in names]
            n = str(max(score.n for score in group.values()))
            label = shown_key(grouping, key)
            rows.append((label, *cells, n, *(_kind_cells(scores, key) if with_floors else ())))
        head = ("", *names, "n", *(("skill", "floor") if with_floors else ()))
        yield make_table(GROUP_TITLES[grouping], head, rows)


def shown_key(grouping: str, key: str) -> str:
    """Return a group's name as people see it: answers have letters."""
    numbered = grouping in ("by_position", "by_answer") and key.isdigit()
    return LETTERS[int(key)] if numbered else key


def _group_cell(score: Score | None) -> Cell:
    return Cell() if score is None else score_cell(replace(score, std=None))


def _kind_cells(scores: ScoreFile, kind: str) -> tuple[Cell, str]:
    """Return the skill in a kind of questions, and its floor."""
    skill = kind_skill(scores, kind)
    floor = "-" if skill is None else f"{number(skill.floor)}: {skill.floor_name}"
    return score_cell(skill), floor


def kind_skill(scores: ScoreFile, kind: str) -> Skill | None:
    """Return the skill in a kind of questions over the floor of that kind, if it is known."""
    accuracy = scores.by_distractor[kind]["iqtt_accuracy"]
    return question_skill(accuracy, {kind: accuracy.n}, scores.question_floors)


def interval_cells(score: Score | Skill) -> tuple[str, str]:
    """Return a value and its interval as text; "-" stands for no interval."""
    return with_interval(score.value, score.low, score.high)


def score_cell(score: Score | Skill | None, best: bool = False, floor: float | None = None) -> Cell:
    """Return a value, with standard deviation over runs, interval, and a floor of its own.

    Args:
        best: whether it is the best value of its column.
    """
    if score is None:
        return Cell()
    if isinstance(score, Skill) and score.is_floor:
        return Cell("0", "is the floor")
    value, interval = interval_cells(score)
    std, ends = getattr(score, "std", None), (score.low, score.high)
    rest = [] if std is None else [f"± {number(std, ends)}"]
    rest += [] if interval == "-" else [interval]
    rest += [] if floor is None else [f"floor {number(floor, ends)}"]
    return Cell(value, " ".join(rest), best)


def labels_of(files: Sequence[ScoreFile]) -> list[str]:
    """Return names of the files' methods, all of them different."""
    return distinct([f.method for f in files], [f.path.stem if f.path else "" for f in files])


def title_of(scores: ScoreFile) -> str:
    """Return method, size and truth."""
    size = f"{len(scores.ids)} questions"
    if scores.task == "rooms":
        size = f"{len(scores.ids)} images of {len(np.unique(scores.clusters))} scenes"
    if scores.task == "measured":
        size = f"{len(scores.ids)} images"
        size += f" in {len(np.unique(scores.clusters))} groups" if scores.grouped else ""
    runs = f", mean of {scores.runs} runs" if scores.runs > 1 else ""
    return f"{plain(scores.method)}: {size} of {plain(scores.meta.truth_path)}{runs}"


def notes_of(scores: ScoreFile) -> Iterator[str]:
    """Yield what has to be known to read the tables, and where the scores come from."""
    meta = scores.meta
    yield from floor_sentences(scores)
    for warning in (*scores.warnings, *few_clusters(scores)):
        yield f"warning: {warning}"
    if scores.skills:
        yield f"{SKILL} {what_the_floor_is(scores)}"
    yield from partner_sentences(scores)
    bootstrap = f"{meta.resamples} resamples, seed {meta.seed}"
    if scores.task != "iqtt":
        claim = f"alignment: {scores.alignment}"
        if scores.alignment != "none":
            claim += ", fitted to the truth of each image before all scores"
        yield f"intervals: bootstrap over {scores.unit}, {bootstrap}; {claim}"
        if scores.protocol:
            yield f"protocol {scores.protocol}: {BY_NAME[scores.protocol].source}; 1 unit is 1 m"
            yield from measured_sentences(scores)
    else:
        how = "Wilson's" if scores.runs == 1 else f"bootstrap, {bootstrap}"
        over = "questions, as the truth does not tell their shapes"
        if "shape" in scores.items:
            over = f"the shapes of references, {len(np.unique(scores.items['shape']))} in all"
        yield f"intervals: {how}, over {over}"
        yield "abstentions and ties count as wrong"
        if not scores.skills and scores.by_distractor:
            yield NO_FLOOR.format(plain(meta.truth_path))
        elif not scores.skills:
            yield "no skill: the truth does not tell its settings, so no floor is known"
    yield (
        f"truth: {plain(meta.truth_path)}, digest {meta.truth_digest[:12]}, {source_text(meta)};"
        f" fingerprint {meta.truth_fingerprint[:12]}"
    )
    runs = ", ".join(f"{run.path} {run.sha256[:12]}" for run in meta.submissions)
    yield f"submissions: {plain(runs)}"


def measured_sentences(scores: ScoreFile) -> Iterator[str]:
    """Yield what the truth of measured images cannot tell."""
    yield "scores of objects: none, as nobody marked them"
    if not scores.grouped:
        yield "images count as independent, as no groups are known; frames of a drive are alike"
    if scores.protocol == DECLARED.name and "boundary_f1" not in scores.items:
        yield "boundaries: none, as depth is known at too few pixels"
    if scores.protocol == DECLARED.name and "normal_mean_degrees" not in scores.items:
        yield "normals: none, unless both the truth and the predictions have them"


def unread_notes(files: Sequence[ScoreFile]) -> list[str]:
    """Return in words the share of unread replies of each method whose replies were read."""
    return [
        f"{label}: {file.unread:.0%} unread {UNREAD}"
        for file, label in zip(files, labels_of(files), strict=True)
        if file.unread is not None
    ]


def floor_sentences(scores: ScoreFile) -> list[str]:
    """Return a sentence where a method scores what its floor does; else none."""
    headline = [name for name in scores.headline if name in scores.skills]
    names = [name for name in headline if scores.skills[name].is_floor]
    floors = dict.fromkeys(" ".join(floor_text(scores, name).split()) for name in names)
    return [f"this method is the floor ({', '.join(floors)}) of {', '.join(names)}"] * bool(names)


def partner_sentences(scores: ScoreFile) -> list[str]:
    """Return a sentence where skills of relief leave out images for want of another scene."""
    name = "relief_iou"
    if name not in scores.skills:
        return []
    has_score, has_floor = (
        int(np.isfinite(scores.items[column]).sum()) for column in (name, OTHER_SCENE + name)
    )
    why = "no other scene has the view of the others"
    text = f"skills of relief are over {has_floor} of {has_score} images: {why}"
    return [text] * (has_floor < has_score)


def few_clusters(scores: ScoreFile) -> list[str]:
    """Return a warning where bootstrapped intervals rest on too few scenes or shapes; else none."""
    labels = scores.items.get("shape", scores.clusters)
    units = "shapes" if scores.task == "iqtt" else scores.unit
    return too_few_warning(len(np.unique(labels)), units) if scores.meta.resamples else []


def too_few_warning(count: int, units: str) -> list[str]:
    """Return a warning where so many scenes or shapes do not suffice for intervals; else none."""
    if not 1 < count < FEW_CLUSTERS:
        return []
    return [
        f"{count} {units} are too few for intervals at {CONFIDENCE:.0%}, which then hold the truth"
        f" less often; take at least {FEW_CLUSTERS}"
    ]


def what_the_floor_is(scores: ScoreFile) -> str:
    """Return in a sentence what the floor of the skills is."""
    if scores.task == "rooms":
        return (
            "The floor of shape is a flat cut-out of each object at its median depth, or the empty"
            " room, or in closed rooms a cut-out between both, whichever is best. Of relief it is"
            " the same prediction, held against the relief of another scene. Of what is"
            " behind it is the best guess that was shown as much. Else it is the empty room: walls"
            " and floor from the true camera, no objects."
        )
    if scores.task == "measured":
        return (
            "The floor is the better of two guesses that see no picture: one depth everywhere, or"
            " nearer evenly to the lower edge. They are fitted as predictions are, by scale and"
            " shift where nothing is fitted."
        )
    return (
        "The floor is the best method without 3D on questions of the same settings, by kind of"
        " question: docs/results.md."
    )


def source_text(meta: Meta) -> str:
    """Return in words where the truth comes from."""
    test = known_test(meta.truth_digest)
    name = f" ({test.name})" if test else ""
    return {
        "given": "given to be scored against",
        "known": "known to the benchmark",
        "submission": "chosen by the submission itself",
    }[meta.truth_source] + name

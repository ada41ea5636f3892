"""Scores as text for a terminal or as Markdown, and the scores of every item as CSV."""

import csv
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from metrics.scoring.estimates import question_skill
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import (
    EMPTY_ROOM,
    HEADLINE,
    OTHER_SCENE,
    SKILLED,
    in_order,
    metric,
)
from metrics.scoring.records import GROUPINGS, Meta, Score, ScoreFile, Skill
from scenegen.common.text_table import by_number, laid_out, markdown, number, plain, printable
from scenegen.files.new_file import written_beside

SKILL = "Skill: 1 is perfect, 0 is as good as the floor, below 0 is worse than the floor."
FLOORS_OF_ROOMS = {EMPTY_ROOM: "empty room", OTHER_SCENE: "against another scene"}
HEADLINE_HEAD = ("headline", "value", "{} interval", "floor")
HEAD = ("score", "value", "{} interval", "std of runs", "floor", "unit", "better")
GROUP_TITLES = {
    "by_view_angle": "by degrees between the view and the scene's first one",
    "by_object_shape": "of single objects, by shape",
    "by_object_size": "of single objects, by share of the picture in percent",
    "by_distractor": "by kind of question",
    "by_rotation_angle": "by rotation between reference and right answer, degrees",
    "by_position": "by place of the right answer",
}
GROUP_SCORES = {
    "rooms": HEADLINE["rooms"],
    "iqtt": ("iqtt_accuracy",),
}


def text_report(scores: ScoreFile, as_markdown: bool = False) -> str:
    """Return the headline, all scores, and the main ones by group, as aligned text or Markdown."""
    escape = markdown if as_markdown else str
    tables = [("", headline_rows(scores, escape)), ("all scores", score_rows(scores, escape))]
    tables += [(GROUP_TITLES[name], rows) for name, rows in group_tables(scores, escape)]
    notes = [f"- {markdown(note)}" if as_markdown else note for note in _notes(scores)]
    lines = [_title(scores, escape), *laid_out(tables, as_markdown), "", *notes]
    return "\n".join(map(printable, lines))


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


def headline_rows(scores: ScoreFile, escape: Callable[[str], str] = str) -> list[Sequence[str]]:
    """Return a head, then a row for each skill of a headline score, then for each such score.

    Each row says what its floor is.
    """
    names = [name for name in HEADLINE[scores.task] if name in scores.metrics]
    skilled = [name for name in names if name in scores.skills]
    shown: list[tuple[str, Score | Skill, str]] = [
        (f"skill of {name}", scores.skills[name], f"0: {floor_text(scores, name)}")
        for name in skilled
    ]
    shown += [(name, scores.metrics[name], _floors_beside(scores, name)) for name in names]
    rows = [(escape(name), *interval_cells(one), escape(floor)) for name, one, floor in shown]
    return [_head(HEADLINE_HEAD, scores), *rows]


def floor_text(scores: ScoreFile, name: str) -> str:
    """Return in words what the floor of a score that has a skill is."""
    if scores.task == "rooms":
        return FLOORS_OF_ROOMS[SKILLED[name]]
    return scores.skills[name].floor_name


def _floors_beside(scores: ScoreFile, name: str) -> str:
    """Return the floor of a score, and what chance or noise gives, each with its name."""
    like, told = as_shown(scores.metrics[name]), []
    if name in scores.skills:
        told.append(f"{number(scores.skills[name].floor, like)}: {floor_text(scores, name)}")
    label, value = references(scores).get(name, ("", 0.0))
    if label and not any(f": {label}" in text for text in told):
        told.append(f"{label} {number(value, like)}")
    return "; ".join(told) or "-"


def references(scores: ScoreFile) -> dict[str, tuple[str, float]]:
    """Return by name of the score what noise or chance gives, and which of them it is."""
    found = {name: ("noise floor", floor) for name, floor in scores.meta.noise_floors.items()}
    if "answers" in scores.meta.counts:
        found["iqtt_accuracy"] = ("chance", 1.0 / scores.meta.counts["answers"])
    return found


def score_rows(scores: ScoreFile, escape: Callable[[str], str] = str) -> list[Sequence[str]]:
    """Return a head, and a row for each score; what chance or noise gives follows its score."""
    rows: list[Sequence[str]] = [_head(HEAD, scores)]
    beside = references(scores)
    for name in in_order(scores.metrics):
        score, known = scores.metrics[name], metric(name)
        better = "higher" if known.higher_is_better else "lower"
        std = "-" if score.std is None else number(score.std, score.value)
        skill = scores.skills.get(name)
        floor = "-" if skill is None else number(skill.floor, as_shown(score))
        rows.append((escape(name), *interval_cells(score), std, floor, escape(score.unit), better))
        if name in beside:
            label, value = beside[name]
            cells = number(value, score.value), "-", "-", "-", escape(score.unit), ""
            rows.append((f"  {label}", *cells))
    return rows


def _head(names: Sequence[str], scores: ScoreFile) -> Sequence[str]:
    return [name.format(f"{100 * scores.meta.confidence:.4g}%") for name in names]


def group_tables(
    scores: ScoreFile, escape: Callable[[str], str] = str
) -> Iterator[tuple[str, list[Sequence[str]]]]:
    """Yield each grouping that the scores have, and its table: a row for each group."""
    for grouping in GROUPINGS[scores.task]:
        groups = getattr(scores, grouping)
        held = {name for found in groups.values() for name in found}
        names = [name for name in GROUP_SCORES[scores.task] if name in held] or in_order(held)
        rows: list[Sequence[str]] = [("", *map(escape, names), "n")]
        for key in by_number(groups):
            found = groups[key]
            cells = [" ".join(interval_cells(found[n])) if n in found else "-" for n in names]
            rows.append((escape(key), *cells, str(max(score.n for score in found.values()))))
        if groups:
            if grouping == "by_distractor" and "answers" in scores.meta.counts:
                _add_floors(rows, scores, escape)
            yield grouping, rows


def _add_floors(rows: list[Sequence[str]], scores: ScoreFile, escape: Callable[[str], str]) -> None:
    """Add the floor of each kind of question, and the skill over it, to the rows of the kinds."""
    answers = scores.meta.counts["answers"]
    rows[0] = (*rows[0], "skill", "floor")
    for i, kind in enumerate(by_number(scores.by_distractor), 1):
        accuracy = scores.by_distractor[kind]["iqtt_accuracy"]
        known = question_skill(accuracy, {kind: accuracy.n}, answers)
        floor = f"{number(known.floor)}: {known.floor_name}"
        rows[i] = (*rows[i], " ".join(interval_cells(known)), escape(floor))


def interval_cells(score: Score | Skill) -> tuple[str, str]:
    """Return a value and its interval as text; "-" stands for no interval."""
    like = as_shown(score)
    if score.low is None or score.high is None:
        return number(score.value, like), "-"
    return number(score.value, like), f"[{number(score.low, like)}, {number(score.high, like)}]"


def as_shown(score: Score | Skill) -> float:
    """Return a number with as many decimals as a score is shown with: four where 0 is a middle."""
    signed = isinstance(score, Skill) or score.unit == "correlation"
    return 0.1 if signed else score.value


def _title(scores: ScoreFile, escape: Callable[[str], str]) -> str:
    what = f"{len(scores.ids)} questions"
    if scores.task == "rooms":
        what = f"{len(scores.ids)} images of {len(np.unique(scores.clusters))} scenes"
    runs = f", mean of {scores.runs} runs" if scores.runs > 1 else ""
    method, truth = (escape(plain(text)) for text in (scores.method, scores.meta.truth_path))
    return f"{method}: {what} of {truth}{runs}"


def _notes(scores: ScoreFile) -> Iterator[str]:
    meta = scores.meta
    for warning in scores.warnings:
        yield f"warning: {warning}"
    if scores.skills:
        yield f"{SKILL} {what_the_floor_is(scores)}"
    if scores.task == "rooms":
        yield (
            f"intervals: bootstrap over scenes, {meta.resamples} resamples, seed {meta.seed};"
            f" alignment claimed: {scores.alignment} (points are never aligned)"
        )
        if meta.noise_floors:
            yield "noise floor: the score of the true surface, sampled elsewhere, against itself"
    else:
        one = scores.runs == 1
        how = "Wilson's" if one else f"bootstrap, {meta.resamples} resamples, seed {meta.seed}"
        over = "questions, as the truth does not tell their shapes"
        if "shape" in scores.items:
            over = f"the shapes of references, {len(np.unique(scores.items['shape']))} in all"
        yield f"intervals: {how}, over {over}"
        yield "abstentions and ties count as wrong"
    submissions = ", ".join(f"{one.path} {one.sha256[:12]}" for one in meta.submissions)
    yield (
        f"truth: {plain(meta.truth_path)}, digest {meta.truth_digest[:12]}, {source_text(meta)};"
        f" fingerprint {meta.truth_fingerprint[:12]}"
    )
    yield f"submissions: {plain(submissions)}"


def what_the_floor_is(scores: ScoreFile) -> str:
    """Return in a sentence what the floor of the skills is."""
    if scores.task == "rooms":
        return (
            "The floor is the empty room: walls and floor from the true camera, no objects; of"
            " relief it is the same prediction, held against the relief of another scene."
        )
    return "The floor is the best method without 3D, by kind of question: docs/results.md."


def source_text(meta: Meta) -> str:
    """Return in words where the truth comes from."""
    known = known_test(meta.truth_digest)
    name = f" ({known.name})" if known else ""
    return {
        "given": "given to be scored against",
        "known": "known to the benchmark",
        "submission": "chosen by the submission itself",
    }[meta.truth_source] + name

"""Scores for people: a table for the terminal, the same as Markdown, and items as CSV."""

import csv
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from metrics.scoring.metric_names import in_order, metric
from metrics.scoring.records import GROUPINGS, Score, ScoreFile
from scenegen.common.new_file import written_beside
from scenegen.common.text_table import aligned, markdown, number, piped, plain

HEAD = ("score", "value", "95% interval", "std of runs", "unit", "better")
GROUP_TITLES = {
    "by_view_angle": "by degrees between the view and the scene's first one",
    "by_distractor": "by kind of wrong answers",
    "by_rotation_angle": "by rotation between reference and right answer, degrees",
    "by_position": "by place of the right answer",
}
CHANCE = 1 / 3


def table(scores: ScoreFile) -> str:
    """Return aligned text for a terminal."""
    lines = [_title(scores, plain), ""]
    lines += ["  " + line for line in aligned([HEAD, *_rows(scores, str)])]
    for title, rows in _group_tables(scores, str):
        lines += ["", title, *("  " + line for line in aligned(rows))]
    return "\n".join([*lines, "", *_notes(scores)])


def markdown_report(scores: ScoreFile) -> str:
    """Return the same as Markdown."""
    lines = [
        _title(scores, lambda text: markdown(plain(text))),
        "",
        *piped([HEAD, *_rows(scores, markdown)]),
    ]
    for title, rows in _group_tables(scores, markdown):
        lines += ["", f"**{title}**", "", *piped(rows)]
    return "\n".join([*lines, "", *(f"- {markdown(note)}" for note in _notes(scores))])


def write_csv(scores: ScoreFile, path: str | Path, overwrite: bool = False) -> None:
    """Write the scores of every item, a line each; raises as `new_file.written_beside`."""
    with (
        written_beside(path, overwrite) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        out = csv.writer(file)
        out.writerow(scores.items)
        columns = [np.asarray(column).tolist() for column in scores.items.values()]
        out.writerows(zip(*columns, strict=True))


def _title(scores: ScoreFile, escape: Callable[[str], str]) -> str:
    counts = scores.meta.counts
    what = f"{counts['rows']} images of {counts['scenes']} scenes" if "rows" in counts else ""
    what = what or f"{counts['questions']} questions"
    runs = f", mean of {scores.runs} runs" if scores.runs > 1 else ""
    return f"{escape(scores.method)}: {what} of {escape(scores.meta.truth_path)}{runs}"


def _rows(scores: ScoreFile, escape: Callable[[str], str]) -> Iterator[Sequence[str]]:
    floor = scores.meta.chamfer_floor
    for name in in_order(scores.metrics):
        score, known = scores.metrics[name], metric(name)
        better = "higher" if known.higher_is_better else "lower"
        std = "-" if score.std is None else number(score.std, score.value)
        yield (escape(name), *interval_cells(score), std, escape(score.unit), better)
        if name == "chamfer" and floor is not None:
            yield (escape("  noise floor"), number(floor, score.value), "-", "-", score.unit, "")
        if name == "iqtt_accuracy":
            yield (escape("  chance"), number(CHANCE, score.value), "-", "-", score.unit, "")


def _group_tables(
    scores: ScoreFile, escape: Callable[[str], str]
) -> Iterator[tuple[str, list[Sequence[str]]]]:
    for grouping in GROUPINGS[scores.task]:
        groups = getattr(scores, grouping)
        if not groups:
            continue
        names = [name for name in SHORT[scores.task] if name in scores.metrics]
        rows: list[Sequence[str]] = [("", *(f"{escape(name)}" for name in names), "n")]
        for key, found in groups.items():
            cells = [" ".join(interval_cells(found[name])) for name in names]
            rows.append((escape(key), *cells, str(found[names[0]].n)))
        yield GROUP_TITLES[grouping], rows


SHORT = {
    "rooms": ("chamfer", "hausdorff", "hausdorff_forward", "hausdorff_reverse", "mse_depth"),
    "iqtt": ("iqtt_accuracy",),
}


def interval_cells(score: Score) -> tuple[str, str]:
    """Return a score's value and its interval as text, "-" where it has none."""
    if score.low is None or score.high is None:
        return number(score.value), "-"
    ends = f"[{number(score.low, score.value)}, {number(score.high, score.value)}]"
    return number(score.value), ends


def _notes(scores: ScoreFile) -> Iterator[str]:
    meta = scores.meta
    for warning in meta.warnings:
        yield f"warning: {warning}"
    if scores.task == "rooms":
        yield (
            f"intervals: bootstrap over scenes, {meta.resamples} resamples, seed {meta.seed};"
            f" alignment claimed: {scores.alignment} (points are never aligned)"
        )
        if meta.chamfer_floor is not None:
            yield "noise floor: Chamfer distance of the true surface to itself, sampled elsewhere"
    elif scores.runs == 1:
        yield "intervals: Wilson's; abstentions and ties count as wrong"
    else:
        yield f"intervals: bootstrap over questions, {meta.resamples} resamples, seed {meta.seed}"
    submissions = ", ".join(f"{one.path} {one.sha256[:12]}" for one in meta.submissions)
    yield f"truth {meta.truth_fingerprint[:12]}; {plain(submissions)}"

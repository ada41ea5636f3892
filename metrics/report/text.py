"""Scores as text for a terminal or as Markdown, and the scores of every item as CSV."""

import csv
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from metrics.measures.answers import CHANCE
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import in_order, metric
from metrics.scoring.records import GROUPINGS, Meta, Score, ScoreFile
from scenegen.common.new_file import written_beside
from scenegen.common.text_table import by_number, laid_out, markdown, number, plain, printable

HEAD = ("score", "value", "95% interval", "std of runs", "unit", "better")
GROUP_TITLES = {
    "by_view_angle": "by degrees between the view and the scene's first one",
    "by_object_shape": "of single objects, by shape",
    "by_object_size": "of single objects, by share of the picture in percent",
    "by_distractor": "by kind of wrong answers",
    "by_rotation_angle": "by rotation between reference and right answer, degrees",
    "by_position": "by place of the right answer",
}
GROUP_SCORES = {
    "rooms": ("chamfer", "hausdorff", "hausdorff_forward", "hausdorff_reverse", "mse_depth"),
    "iqtt": ("iqtt_accuracy",),
}


def text_report(scores: ScoreFile, as_markdown: bool = False) -> str:
    """Return all scores, then the main ones by group, as aligned text or as Markdown."""
    escape = markdown if as_markdown else str
    tables = [("", score_rows(scores, escape))]
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


def score_rows(scores: ScoreFile, escape: Callable[[str], str] = str) -> list[Sequence[str]]:
    """Return a head, and a row for each score; what chance or noise gives follows its score."""
    references = {"iqtt_accuracy": ("  chance", CHANCE)}
    references |= {n: ("  noise floor", floor) for n, floor in scores.meta.noise_floors.items()}
    rows: list[Sequence[str]] = [HEAD]
    for name in in_order(scores.metrics):
        score, known = scores.metrics[name], metric(name)
        better = "higher" if known.higher_is_better else "lower"
        std = "-" if score.std is None else number(score.std, score.value)
        rows.append((escape(name), *interval_cells(score), std, escape(score.unit), better))
        if name in references:
            label, value = references[name]
            rows.append((escape(label), number(value, score.value), "-", "-", score.unit, ""))
    return rows


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
            yield grouping, rows


def interval_cells(score: Score) -> tuple[str, str]:
    """Return a score's value and its interval as text; "-" stands for no interval."""
    if score.low is None or score.high is None:
        return number(score.value), "-"
    ends = f"[{number(score.low, score.value)}, {number(score.high, score.value)}]"
    return number(score.value), ends


def _title(scores: ScoreFile, escape: Callable[[str], str]) -> str:
    counts = scores.meta.counts
    what = f"{counts['rows']} images of {counts['scenes']} scenes" if "rows" in counts else ""
    what = what or f"{counts['questions']} questions"
    runs = f", mean of {scores.runs} runs" if scores.runs > 1 else ""
    method, truth = (escape(plain(text)) for text in (scores.method, scores.meta.truth_path))
    return f"{method}: {what} of {truth}{runs}"


def _notes(scores: ScoreFile) -> Iterator[str]:
    meta = scores.meta
    for warning in meta.warnings:
        yield f"warning: {warning}"
    if scores.task == "rooms":
        yield (
            f"intervals: bootstrap over scenes, {meta.resamples} resamples, seed {meta.seed};"
            f" alignment claimed: {scores.alignment} (points are never aligned)"
        )
        if meta.noise_floors:
            yield "noise floor: the score of the true surface, sampled elsewhere, against itself"
    elif scores.runs == 1:
        yield "intervals: Wilson's; abstentions and ties count as wrong"
    else:
        yield f"intervals: bootstrap over questions, {meta.resamples} resamples, seed {meta.seed}"
    submissions = ", ".join(f"{one.path} {one.sha256[:12]}" for one in meta.submissions)
    yield (
        f"truth: {plain(meta.truth_path)}, digest {meta.truth_digest[:12]}, {source_text(meta)};"
        f" fingerprint {meta.truth_fingerprint[:12]}"
    )
    yield f"submissions: {plain(submissions)}"


def source_text(meta: Meta) -> str:
    """Return in words where the truth comes from."""
    known = known_test(meta.truth_digest)
    name = f" ({known.name})" if known else ""
    return {
        "given": "given to be scored against",
        "known": "known to the benchmark",
        "submission": "chosen by the submission itself",
    }[meta.truth_source] + name

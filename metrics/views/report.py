"""Scores of one submission as a page that answers first."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from metrics.measured.reader import Images
from metrics.score_file import read_scores
from metrics.scoring.estimates import CONFIDENCE
from metrics.scoring.metric_names import HEADLINE, in_order, metric
from metrics.scoring.records import ScoreFile
from metrics.scoring.runs import Runs
from metrics.scoring.truth_digests import require_truth, stated_truth
from metrics.views.by_angle import view_curves
from metrics.views.examples import examples_of
from metrics.views.headline import headline_lead, headline_section, kinds_sections
from metrics.views.page import Section, html_page
from metrics.views.plots import Chart, histogram
from metrics.views.score_tables import (
    all_scores,
    group_tables,
    labels_of,
    source_text,
)
from metrics.views.table import make_table

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile

ROOMS_REMARK = (
    "Depths share the truth's range; the error ends at a tenth of it. Normals are x, y, z as red,"
    " green, blue. Grey is not scored. A click enlarges a picture."
)
CURVES_REMARK = (
    "Bars are intervals. The paper's figures (†) are in the tables only, as it states no unit of"
    " length."
)


def html_report(
    scores: ScoreFile, runs: Runs | None = None, beside: Sequence[ScoreFile] = ()
) -> str:
    """Return the page as text.

    Args:
        runs: what was scored, for pictures of the first run; None for no pictures.
        beside: scores of other methods on the same truth, to be shown beside these.

    Raises OtherTruthError where a file of `beside` is of another truth, OSError and FileFormatError
    where a picture's row cannot be read.
    """
    for file in beside:
        require_truth(file, scores.truth, scores.method, scores.protocol)
    files = [scores, *beside]
    sections = [headline_section(files)]
    if scores.task == "iqtt":
        sections += kinds_sections(files)
        remark = "One answer shows the shape of the reference, turned. The questions are spread"
        remark, title = f"{remark} evenly over the file.", "Questions"
    else:
        remark, title = ROOMS_REMARK, "Scenes" if scores.task == "rooms" else "Images"
        if scores.grouped:
            remark += f" Of several in {scores.unit} the one nearest to their mean is shown."
    examples = [] if runs is None else examples_of(scores, runs.truth, runs.files[0])
    if examples:
        sections.append(Section(title, remarks=[remark], examples=examples))
    if scores.task == "rooms":
        sections += curves_section(files)
    charts = list(_distributions(scores))
    if charts:
        sections.append(Section("Distribution over images", charts=charts))
    return html_page(
        scores.method,
        [*sections, *_all_numbers(scores)],
        leads=[headline_lead(scores)],
        warnings=scores.warnings,
    )


def curves_section(files: Sequence[ScoreFile]) -> list[Section]:
    """Return the section of scores of rooms by view angle; none where all views have one."""
    charts = list(view_curves(files, labels_of(files)))
    title = "By degrees between the view and the scene's first one"
    return [Section(title, charts=charts, notes=[CURVES_REMARK])] if charts else []


def read_beside(paths: Sequence[str | Path], truth: "Images | AnswersFile") -> list[ScoreFile]:
    """Read score files to show beside those of a truth that is about to be scored against.

    Raises OtherTruthError where one is of another truth; of those that state no digest, as they
    were released, `html_report` does. Else as `read_scores`.
    """
    files = [read_scores(path) for path in paths]
    task, digest = stated_truth(truth)
    for file in files:
        require_truth(file, (task, digest or file.truth[1]), truth.path)
    return files


def _distributions(scores: ScoreFile) -> Iterator[Chart]:
    for name in (*HEADLINE[scores.task], "normal_mean_degrees", "derived_normal_mean_degrees"):
        if name in scores.items:
            values = np.asarray(scores.items[name], float)
            chart = histogram(values, metric(name).title, scores.unit_of(name))
            if chart:
                yield chart


def _all_numbers(scores: ScoreFile) -> Iterator[Section]:
    """Yield what is folded at the end: all scores, their definitions, and where they come from."""
    yield Section("All numbers")
    for table in group_tables(scores) if scores.task != "iqtt" else ():
        yield Section(table.title.capitalize(), tables=[table], folded=True)
    title = f"All scores ({len(scores.metrics)})"
    yield Section(title, tables=[all_scores(scores)], folded=True)
    rows = [(name, metric(name).definition) for name in in_order(scores.metrics)]
    table = make_table("Definitions", ("score", "of one item"), rows)
    yield Section("How each number is defined", tables=[table], folded=True)
    meta = scores.meta
    drawn = f" from {meta.resamples} resamples with seed {meta.seed}" if meta.resamples else ""
    counts = ", ".join(f"{name.replace('_', ' ')} {n}" for name, n in meta.counts.items())
    notes = [
        f"{counts}.",
        f"Truth: {meta.truth_path} {meta.truth_digest[:12]}, {source_text(meta)}.",
        f"Scored by {meta.writer}, with intervals at {CONFIDENCE:.0%}{drawn}.",
        *(f"{run.path} {run.run} {run.sha256[:16]}" for run in meta.submissions),
    ]
    yield Section("Where the numbers come from", notes=notes, folded=True)

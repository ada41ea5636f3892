"""Scores of one submission as a page: main metrics, examples, charts, then all numbers."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from metrics.measured.reader import Images
from metrics.measures.confidence import sparsification
from metrics.score_file import read_scores
from metrics.scoring.aligned import aligned
from metrics.scoring.metric_names import HEADLINE, in_order, metric
from metrics.scoring.records import ScoreFile, Scores
from metrics.scoring.runs import MeasuredRuns, RoomRuns, Runs
from metrics.scoring.truth_digests import require_truth, stated_truth
from metrics.submissions.reader import RoomPredictions
from metrics.views.examples import examples_of
from metrics.views.figures import (
    draw_groups,
    draw_histogram,
    draw_sparsification,
    shown_row,
    svg_url,
)
from metrics.views.page import Section, html_page
from metrics.views.paper import figures_of, paper_table
from metrics.views.score_tables import (
    alignment_tables,
    all_scores,
    group_tables,
    main_table,
    notes_of,
    side_by_side,
    title_of,
    warnings_of,
)
from metrics.views.table import make_table

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile

ROOMS_REMARK = (
    "All depth images share the range of the ground truth; error images end at a tenth of this"
    " range."
    " Normals show x, y, z as red, green, blue. Grey pixels are not scored. Click an image to"
    " enlarge"
    " it."
)
MOST_CURVES = 64  # images, spread evenly, over which the curve of confidence is a mean
QUESTIONS_REMARK = (
    "One option shows the shape of the reference, rotated. The questions are spread evenly over the"
    " file."
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
    files = aligned([scores, *beside])
    tables = [main_table(scores), *([side_by_side(files)] if beside else [])]
    sections = [Section(remarks=[title_of(scores)], tables=tables, notes=notes_of(scores))]
    examples = [] if runs is None else examples_of(scores, runs.truth, runs.files[0])
    if examples:
        titles = {"rooms": "Scenes", "measured": "Images", "iqtt": "Questions"}
        remark = QUESTIONS_REMARK if scores.task == "iqtt" else ROOMS_REMARK
        if scores.grouped:
            remark += " For each group, the image closest to the mean of the group is shown."
        sections.append(Section(titles[scores.task], remarks=[remark], examples=examples))
    groups = list(group_tables(scores))
    reported = figures_of(scores)
    sections += group_charts(files)
    if isinstance(runs, RoomRuns | MeasuredRuns):
        sections += confidence_chart(runs.files[0], runs.truth)
    distributions = list(_distributions(scores))
    if distributions:
        sections.append(Section("Distribution over images", charts=distributions))
    sections.append(Section("All numbers"))
    tables = [*alignment_tables(scores), *groups, all_scores(scores)]
    tables += [paper_table(reported)] if reported else []
    sections += [Section(t.title.capitalize(), tables=[t], folded=True) for t in tables]
    rows = [(name, metric(name).definition) for name in in_order(scores.metrics)]
    table = make_table("Definitions", ("metric", "value for one image or question"), rows)
    sections += [
        Section("Definitions of the metrics", tables=[table], folded=True),
        Section("Sources", notes=_origin(scores), folded=True),
    ]
    return html_page(scores.method, sections, warnings_of(scores))


def confidence_chart(predictions: RoomPredictions, truth: Images) -> list[Section]:
    """Return how the error falls as the least sure pixels leave; no section without confidence."""
    if not predictions.has_confidence:
        return []
    curves = []
    for i in np.unique(np.linspace(0, len(predictions) - 1, MOST_CURVES).astype(int)).tolist():
        view = predictions.view(i)
        _, true, (depth,) = shown_row(truth, int(predictions.rows[i]), [view])
        known = np.isfinite(depth) & np.isfinite(true)
        if known.any() and view.confidence is not None:
            errors = np.abs(depth - true)[known] / true[known]
            sure = view.confidence[: len(true), : true.shape[1]][known]
            orders = (sure, np.zeros_like(errors), -errors)
            curves.append([sparsification(errors, order) for order in orders])
    if not curves:
        return []
    mean = np.mean(curves, axis=0)
    chart = ("AbsRel without the least confident pixels", svg_url(draw_sparsification, mean))
    return [Section("Confidence", charts=[chart])]


def group_charts(files: Sequence[ScoreFile]) -> list[Section]:
    """Return charts of the main metrics by view angle, or of accuracy by kind of question.

    They show all methods, and the baseline of the first one. There are none where all views have
    one angle, or all questions are of one kind.
    """
    by = {"rooms": ("angle", files[0].by_view_angle), "iqtt": ("kind", files[0].by_distractor)}
    grouping, groups = by.get(files[0].task, ("", {}))
    names = [
        name
        for name in HEADLINE[files[0].kind]
        if sum(all(name in _group(file, grouping, key) for file in files) for key in groups) > 1
    ]
    charts = [(metric(n).title, svg_url(draw_groups, files, grouping, n)) for n in names]
    titles = {"angle": "By angle to the first view of the scene"}
    title = titles.get(grouping, "Accuracy by distractor type")
    return [Section(title, charts=charts)] if charts else []


def _group(file: ScoreFile, grouping: str, key: str) -> Scores:
    groups = file.by_view_angle if grouping == "angle" else file.by_distractor
    return groups.get(key, {})


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


def _distributions(scores: ScoreFile) -> Iterator[tuple[str, str]]:
    if scores.task == "iqtt":
        return
    for name in (*HEADLINE[scores.kind], "normal_mean_degrees", "derived_normal_mean_degrees"):
        if name in scores.items and np.isfinite(np.asarray(scores.items[name], float)).any():
            yield metric(name).title, svg_url(draw_histogram, scores, name)


def _origin(scores: ScoreFile) -> list[str]:
    meta = scores.meta
    counts = ", ".join(f"{name.replace('_', ' ')} {n}" for name, n in meta.counts.items())
    return [
        f"{counts}.",
        f"Ground truth: {meta.truth_path}, hash {meta.truth_digest}, recipe hash"
        f" {meta.truth_fingerprint}.",
        f"Scored by {meta.writer}.",
        *(f"{run.path} {run.run} {run.sha256}" for run in meta.submissions),
    ]

"""Scores of one submission as a page that answers first."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from metrics.score_file import read_scores
from metrics.scoring.estimates import CONFIDENCE
from metrics.scoring.metric_names import HEADLINE, in_order, metric
from metrics.scoring.records import ScoreFile
from metrics.submissions.reader import Predictions
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
from scenegen.common.errors import SceneGenError

ROOMS_REMARK = (
    "Depths share the truth's range; the error ends at a tenth of it. Normals are x, y, z as red,"
    " green, blue. Grey is not scored. A click enlarges a picture."
)
CURVES_REMARK = (
    "Bars are intervals. The paper's figures (†) are in the tables only, as it states no unit of"
    " length."
)


class BesideError(SceneGenError):
    """A score file that cannot stand beside others."""


def html_report(
    scores: ScoreFile,
    truth_path: Path,
    submissions: Sequence[Path],
    beside: Sequence[ScoreFile] = (),
) -> str:
    """Return the page as text; pictures come from the truth and the first run.

    Args:
        truth_path: of the truth that was scored against.
        submissions: the files that were scored; without any there are no pictures.
        beside: scores of other methods on the same truth, to be shown beside these.

    Raises BesideError where a file of `beside` is of another truth, OSError and FileFormatError
    where a picture's row cannot be read.
    """
    _require_same_truth(scores, beside)
    files = [scores, *beside]
    sections = [headline_section(files)]
    if scores.task == "iqtt":
        sections += kinds_sections(files)
        remark = "One answer shows the shape of the reference, turned. The questions are spread"
        remark, title = f"{remark} evenly over the file.", "Questions"
    else:
        remark, title = ROOMS_REMARK, "Scenes"
        remark += " Of each scene it is the view whose score is nearest to the scene's mean."
    examples = examples_of(scores, truth_path, submissions[0]) if submissions else []
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


def read_beside(paths: Sequence[str | Path], predictions: Predictions) -> list[ScoreFile]:
    """Read score files to show beside those of a submission that is about to be scored.

    Raises BesideError at once where one is of another task, or of a truth that the submission does
    not name; else as `read_scores`.
    """
    files = [read_scores(path) for path in paths]
    named = predictions.truth_fingerprint
    for file in files:
        scored = file.meta.truth_fingerprint
        if file.task != predictions.task or (named and named != scored):
            found = f"scores of {file.task}, truth {scored[:12]}"
            expected = f"{predictions.task}, truth {(named or 'any')[:12]}, of {predictions.path}"
            raise BesideError(file.place, found, expected)
    return files


def _require_same_truth(scores: ScoreFile, beside: Sequence[ScoreFile]) -> None:
    """Raise BesideError unless all files are scores of one truth."""
    expected = scores.task, scores.meta.truth_digest[:12]
    for file in beside:
        found = file.task, file.meta.truth_digest[:12]
        if file.truth != scores.truth:
            raise BesideError(
                file.place,
                "scores of {}, truth of digest {}".format(*found),
                "{}, truth of digest {}, as of {}".format(*expected, scores.method),
                "score it again with the same --truth",
            )


def _distributions(scores: ScoreFile) -> Iterator[Chart]:
    for name in (*HEADLINE["rooms"], "normal_mean_degrees", "derived_normal_mean_degrees"):
        if name in scores.items:
            values = np.asarray(scores.items[name], float)
            chart = histogram(values, metric(name).title, metric(name).unit)
            if chart:
                yield chart


def _all_numbers(scores: ScoreFile) -> Iterator[Section]:
    """Yield what is folded at the end: all scores, their definitions, and where they come from."""
    yield Section("All numbers")
    for table in group_tables(scores) if scores.task == "rooms" else ():
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

"""Scores as one self-contained page that answers first: headline, pictures, curves, all numbers."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from metrics.report.charts import Chart, histogram
from metrics.report.curves import view_curves
from metrics.report.headline import (
    Grid,
    answer,
    headline_table,
    kinds_table,
    labels_beside,
    notes,
)
from metrics.report.html import render
from metrics.report.questions import pictured_questions
from metrics.report.scenes import Pictured, pictured_scenes, shown_score
from metrics.report.text import (
    GROUP_TITLES,
    SKILL,
    group_tables,
    score_rows,
    source_text,
    what_the_floor_is,
)
from metrics.score_file import read_scores
from metrics.scoring.metric_names import HEADLINE, in_order, metric
from metrics.scoring.records import GROUPINGS, ScoreFile
from metrics.submissions.reader import open_predictions
from scenegen.common.errors import SceneGenError


class BesideError(SceneGenError):
    """A score file that cannot stand beside others."""


def html_report(
    scores: ScoreFile,
    truth_path: Path,
    submissions: Sequence[Path],
    beside: Sequence[ScoreFile] = (),
    home: str = "",
) -> str:
    """Return the page as text; pictures come from the truth and the first run.

    Args:
        truth_path: of the truth that was scored against.
        submissions: the files that were scored; without any there are no pictures.
        beside: scores of other methods on the same truth, to be shown beside these.
        home: address of the page that this one belongs to, such as "index.html".

    Raises BesideError where a file of `beside` is of another truth, OSError and FileFormatError
    where a picture's row cannot be read.
    """
    require_same_truth(scores, beside)
    names = in_order(scores.metrics)
    rooms = scores.task == "rooms"
    labels = labels_beside(scores, beside)
    pictures = list(_pictures(scores, truth_path, submissions)) if submissions else []
    return render(
        "report.html",
        scores=scores,
        home=home,
        answer=answer(scores),
        headline=headline_table(scores, beside),
        notes=list(notes(scores)),
        skill_text=f"{SKILL} {what_the_floor_is(scores)}" if scores.skills else "",
        kinds=[] if rooms else list(_kinds(scores, beside)),
        pictures=pictures,
        curves=list(view_curves([scores, *beside], labels)) if rooms else [],
        groups=[(GROUP_TITLES[g].capitalize(), rows) for g, rows in group_tables(scores) if rooms],
        distributions=list(_distributions(scores)),
        score_rows=score_rows(scores),
        definitions=[("score", "of one item"), *((n, metric(n).definition) for n in names)],
        source_text=source_text(scores.meta),
    )


def read_beside(paths: Sequence[str | Path], submission: str | Path) -> list[ScoreFile]:
    """Read score files to show beside those of a submission that is about to be scored.

    Raises BesideError at once where one is of another task, or of a truth that the submission does
    not name; else as `read_scores` and `open_predictions`.
    """
    files = [read_scores(path) for path in paths]
    with open_predictions(submission) as predictions:
        named = predictions.truth_fingerprint
        for file in files:
            asked = file.meta.truth_fingerprint
            if file.task != predictions.task or (named and named != asked):
                found = f"scores of {file.task}, truth {asked[:12]}"
                expected = f"{predictions.task}, truth {(named or 'any')[:12]}, of {submission}"
                raise BesideError(file.place, found, expected)
    return files


def require_same_truth(scores: ScoreFile, beside: Sequence[ScoreFile]) -> None:
    """Raise BesideError unless all files are scores of one truth."""
    for file in beside:
        for what, found, expected in (
            ("task", file.task, scores.task),
            ("truth of digest", file.meta.truth_digest[:12], scores.meta.truth_digest[:12]),
        ):
            if found != expected:
                raise BesideError(
                    file.place,
                    f"scores of {what} {found}",
                    f"{expected}, as of {scores.method}",
                    "score it again with the same --truth",
                )


def _kinds(scores: ScoreFile, beside: Sequence[ScoreFile]) -> Iterator[tuple[str, Grid]]:
    """Yield title and table of each grouping of questions."""
    for grouping in GROUPINGS["iqtt"]:
        if getattr(scores, grouping):
            yield f"Accuracy {GROUP_TITLES[grouping]}", kinds_table(scores, grouping, beside)


def _pictures(
    scores: ScoreFile, truth_path: Path, submissions: Sequence[Path]
) -> Iterator[tuple[str, list[Pictured]]]:
    """Yield the title and the items of each list of scenes, or of questions."""
    if scores.task == "iqtt":
        yield from pictured_questions(scores, truth_path, submissions[0])
        return
    name = shown_score(scores)
    if name:
        yield from pictured_scenes(scores, truth_path, submissions[0], name)


def _distributions(scores: ScoreFile) -> Iterator[Chart]:
    for name in (*HEADLINE["rooms"], "normal_mean_degrees", "derived_normal_mean_degrees"):
        if name in scores.items:
            values = np.asarray(scores.items[name], float)
            chart = histogram(values, metric(name).title, metric(name).unit)
            if chart:
                yield chart

"""Scores of single rows, and scenes in their order: the worst first."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.score_file import read_scores
from metrics.scoring.metric_names import OF_TRUTH, OTHER_SCENE, in_order, metric
from metrics.scoring.records import ID_COLUMNS, OPTIONAL_COLUMNS
from metrics.scoring.rows import score_rows
from metrics.scoring.runs import Progress, ScoringError, Settings, matched_rows
from metrics.scoring.truth_digests import stored_digest
from metrics.submissions.reader import Predictions, RoomPredictions
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
MOST_SCORED = 100  # rows that are scored unless others are asked for


@dataclass(frozen=True, eq=False)
class RowScores:
    """Scores of some rows of a submission.

    Attributes:
        rows: of the truth, ascending, (N,).
        values: (N,) by name of the score; NaN where a row has no such score.
    """

    rows: Array
    values: Mapping[str, Array]

    def of(self, row: int) -> dict[str, float]:
        """Return the scores of a row by name."""
        i = int(np.searchsorted(self.rows, row))
        return {name: float(column[i]) for name, column in self.values.items()}


def require_rooms(predictions: Predictions) -> RoomPredictions:
    """Return a submission of rooms. Raises ScoringError for answers to questions."""
    if not isinstance(predictions, RoomPredictions):
        found, hint = f"answers to {predictions.task}", "only rooms are shown in 3D"
        raise ScoringError(predictions.path, found, "predictions of rooms", hint)
    return predictions


def shown_scores(
    predictions: RoomPredictions,
    truth: RoomsFile,
    items: Sequence[int] | None = None,
    scores_path: str | Path | None = None,
    progress: Progress = lambda done: None,
) -> RowScores:
    """Return the scores of the rows to show, from a score file or computed here.

    Args:
        items: rows of the truth; None for all of the score file, or the first MOST_SCORED that are
            predicted.
        scores_path: a score file of these predictions; of several runs, its scores are means.
            Without it, the rows are scored as by `bench score --non-finite penalise`.
        progress: called with the number of rows that were scored since it was last called.

    Raises:
        OSError, JsonError: as `read_scores`.
        ScoringError: predictions of another truth, or scores of others.
        SpecError: a row that is not predicted or has no score.
    """
    answered = matched_rows([predictions], truth, partial=True)
    if scores_path is not None:
        stored = _stored_scores(scores_path, predictions, truth)
        rows = _chosen(items, np.intersect1d(answered, stored.rows), scores_path)
        here = np.searchsorted(stored.rows, rows)
        return RowScores(rows, {name: column[here] for name, column in stored.values.items()})
    rows = answered[:MOST_SCORED] if items is None else _chosen(items, answered, predictions.path)
    settings = Settings(allow_partial=True, non_finite="penalise")
    scored = score_rows([predictions], truth, rows, settings, progress)
    return RowScores(rows, {name: runs[0] for name, runs in scored.scores.items()})


def _chosen(items: Sequence[int] | None, there: Array, path: str | Path) -> Array:
    """Return these rows, or all that are there."""
    rows = there if items is None else np.unique(np.array(items, np.int64))
    unknown = rows[~np.isin(rows, there)]
    if unknown.size or not rows.size:
        found = f"row {unknown[0]}" if unknown.size else "no row"
        raise SpecError("items", found, f"some of the {len(there)} rows of {path}")
    return rows


def _stored_scores(path: str | Path, predictions: RoomPredictions, truth: RoomsFile) -> RowScores:
    """Read the scores of a submission from a score file."""
    scores = read_scores(path)
    digest = stored_digest(truth)
    if scores.truth != ("rooms", digest):
        expected = f"those of {truth.path}, truth of digest {digest or 'none':.12}"
        found = f"scores of {scores.task}, truth of digest {scores.meta.truth_digest:.12}"
        raise ScoringError(path, found, expected)
    if predictions.sha256 not in {run.sha256 for run in scores.meta.submissions}:
        found = f"scores of {', '.join(run.path for run in scores.meta.submissions)}"
        expected = f"those of {predictions.path} as it is now"
        raise ScoringError(path, found, expected, "score it again, or leave out --scores")
    others = (*ID_COLUMNS["rooms"], *OPTIONAL_COLUMNS["rooms"])
    columns = {name: column for name, column in scores.items.items() if name not in others}
    return RowScores(scores.ids, columns)


def sortable(scores: RowScores) -> dict[str, str]:
    """Return titles of scores that some row has, with the names of the scores."""
    names = in_order(name for name, column in scores.values.items() if np.isfinite(column).any())
    of_others = (*OF_TRUTH, OTHER_SCENE)
    return {metric(name).title: name for name in names if not name.startswith(of_others)}


def worst_first(
    scores: RowScores, name: str, scenes: Sequence[tuple[int, ...]]
) -> list[tuple[int, ...]]:
    """Return scenes, each the rows of its views, from the worst mean score to the best.

    The views of a scene come in the same order. What has no such score comes last, equals stay in
    their order.
    """
    sign = 1.0 if metric(name).higher_is_better else -1.0
    value = dict(zip(scores.rows.tolist(), (sign * scores.values[name]).tolist(), strict=True))

    def place(rows: Sequence[int]) -> float:
        finite = [value[row] for row in rows if np.isfinite(value[row])]
        return float(np.mean(finite)) if finite else np.inf

    inside = [tuple(sorted(rows, key=lambda row: place([row]))) for rows in scenes]
    return sorted(inside, key=place)

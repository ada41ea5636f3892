"""Predictions of rooms for a 3D page: which rows are shown, in which order, with what beside."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from metrics.measured.protocols import DECLARED
from metrics.measured.reader import Images, MeasuredFile, matrix_of, rays_of
from metrics.score_file import read_scores
from metrics.scoring.geometry import points_as_scored
from metrics.scoring.measured_rows import PIXELS, points_as_declared
from metrics.scoring.metric_names import HEADLINE, OF_TRUTH, OTHER_SCENE, in_order, metric, unit_in
from metrics.scoring.records import ID_COLUMNS, OPTIONAL_COLUMNS, ScoreFile
from metrics.scoring.rows import score_measured_rows, score_rows
from metrics.scoring.runs import Progress, ScoringError, Settings, matched_rows
from metrics.scoring.truth_digests import require_truth, stated_truth
from metrics.submissions.reader import Predictions, RoomPredictions
from scenegen.common.errors import SpecError
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.rendering.ground_truth import undeveloped
from scenegen.rooms.reader import Room
from scenegen.viewing.page import Predicted, Scenes, scene_rows

Array = NDArray[Any]
MOST_SCORED = 100  # rows that are scored unless others are asked for
SHOWN_SCORES = ("relief_iou", "chamfer", "hausdorff", "rmse", "normal_mean_degrees")
UNITS = {"fraction": "", "correlation": "", "ratio": "", "degree": "degrees"}  # behind a number


@dataclass(frozen=True, eq=False)
class RowScores:
    """Scores of some rows of a submission.

    Attributes:
        rows: of the truth, ascending, (N,).
        values: (N,) by name of the score; NaN where a row has no such score.
    """

    rows: Array
    values: Mapping[str, Array]


def require_rooms(predictions: Predictions) -> RoomPredictions:
    """Return a submission of rooms. Raises ScoringError for answers to questions."""
    if not isinstance(predictions, RoomPredictions):
        found, hint = f"answers to {predictions.task}", "only rooms are shown in 3D"
        raise ScoringError(predictions.path, found, "predictions of rooms", hint)
    return predictions


def shown_scores(
    predictions: RoomPredictions,
    truth: Images,
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
    there, path = matched_rows([predictions], truth, partial=True), str(predictions.path)
    stored = None if scores_path is None else _scores_of(scores_path, predictions, truth)
    if stored is not None:
        there, path = np.intersect1d(there, stored.ids), stored.place
    rows = there if items is None else np.unique(np.array(items, np.int64))
    rows = rows[:MOST_SCORED] if items is None and stored is None else rows
    unknown = rows[~np.isin(rows, there)]
    if unknown.size or not rows.size:
        found = f"row {unknown[0]}" if unknown.size else "no row"
        raise SpecError("items", found, f"some of the {len(there)} rows of {path}")
    if stored is not None:
        here = np.searchsorted(stored.ids, rows)
        ids = (*ID_COLUMNS[stored.task], *OPTIONAL_COLUMNS[stored.task])
        return RowScores(rows, {n: c[here] for n, c in stored.items.items() if n not in ids})
    settings = Settings(allow_partial=True, non_finite="penalise")
    if isinstance(truth, MeasuredFile):
        names = (DECLARED.name,)
        scored = score_measured_rows([predictions], truth, rows, names, settings, progress)
    else:
        scored = score_rows([predictions], truth, rows, settings, progress)
    values = {n.removeprefix(f"{DECLARED.name} "): runs[0] for n, runs in scored.scores.items()}
    values.pop(PIXELS, None)
    return RowScores(rows, values)


def _scores_of(path: str | Path, predictions: RoomPredictions, truth: Images) -> ScoreFile:
    """Read a score file of a submission. Raises ScoringError for scores of others."""
    scores = read_scores(path)
    require_truth(scores, stated_truth(truth), truth.path)
    if predictions.sha256 not in {run.sha256 for run in scores.meta.submissions}:
        found = f"scores of {', '.join(run.path for run in scores.meta.submissions)}"
        expected = f"those of {predictions.path} as it is now"
        raise ScoringError(path, found, expected, "score it again, or leave out --scores")
    return scores


def predicted_rooms(
    predictions: RoomPredictions, truth: Images, scores: RowScores
) -> tuple[Scenes, Predicted]:
    """Return the scenes of the rows of `scores`, and what a page shows of their predictions.

    A submission has its normals, and points as they are scored.
    """
    rows, entry_of = scores.rows.tolist(), {int(row): i for i, row in enumerate(predictions.rows)}
    place_of = {row: i for i, row in enumerate(rows)}
    names = _sortable(scores, predictions.task)
    alone = [(row,) for row in rows]
    in_metres = isinstance(truth, MeasuredFile) or truth.spec.interior
    length = "metre" if in_metres else "scene unit"
    scenes = alone if isinstance(truth, MeasuredFile) else scene_rows(truth, rows)
    orders = {title: worst_first(scores, name, scenes) for title, name in names.items()}

    def points(room: Room) -> Array:
        view = predictions.view(entry_of[room.index])
        if isinstance(room, MeasuredRoom):
            return points_as_declared(view, room.depth, room.rays)
        return points_as_scored(view, room.depth, room.fov_y_degrees)

    def normal(room: Room) -> Array:
        height, width = room.depth.shape
        return predictions.normal(entry_of[room.index])[:height, :width]

    def texts(row: int, title: str) -> dict[str, str]:
        values = {name: float(column[place_of[row]]) for name, column in scores.values.items()}
        shown = [n for n in dict.fromkeys((names[title], *SHOWN_SCORES)) if n in values]
        return {metric(name).title: _text(name, values[name], length) for name in shown}

    return scenes, Predicted(orders, points, normal if predictions.has_normals else None, texts)


@dataclass(frozen=True, eq=False)
class MeasuredRoom(Room):
    """An image of measured truth, as the page takes views of rooms; `rays` are those of its pixels.

    It is a scene of its own, without objects. 1 m is a scene unit.
    """

    rays: Array

    @property
    def radiance(self) -> Array:
        """Linear RGB of the picture, (H, W, 3)."""
        return undeveloped(self.image)

    @property
    def points(self) -> Array:
        """Measured points in the camera frame, (H, W, 3), metres; NaN for none."""
        return np.asarray(self.rays * self.depth[..., None])


class MeasuredRooms:
    """The images of a file of measured truth by their rows. Raises as `reader.matrix_of`."""

    def __init__(self, truth: MeasuredFile) -> None:
        self._truth = truth

    def __getitem__(self, row: int) -> MeasuredRoom:
        """Return an image as a view."""
        view, size = self._truth.view(row), self._truth.size(row)
        fov = 2.0 * np.degrees(np.arctan(0.5 * size[0] / matrix_of(self._truth, row)[1, 1]))
        none = np.full(size, -1), np.zeros((*size, 3), np.float32)
        scene = cast(
            "SceneSpec", SimpleNamespace(index=row, cameras=(fov,), objects=(), interior=None)
        )
        normal = none[1] if view.normal is None else view.normal
        return MeasuredRoom(
            row, 0, 0.0, self._truth.picture(row), view.depth, normal, none[0], np.eye(4),
            float(fov), scene, {}, rays_of(self._truth, row, *size),
        )  # fmt: skip


def no_shape(item: PlacedObject) -> Array:
    """Raise SpecError: nobody measured the objects of an image."""
    raise SpecError("objects", item.shape, "an image of measured truth, which has none")


def _sortable(scores: RowScores, task: str) -> dict[str, str]:
    """Return titles of scores that some row has, headline first, with the names of the scores."""
    finite = [name for name, column in scores.values.items() if np.isfinite(column).any()]
    names = in_order(name for name in finite if not name.startswith((*OF_TRUTH, OTHER_SCENE)))
    headline = [name for name in names if name in HEADLINE[task]]
    return {metric(name).title: name for name in (*headline, *names)}


def worst_first(
    scores: RowScores, name: str, scenes: Iterable[tuple[int, ...]]
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


def _text(name: str, value: float, length: str) -> str:
    """Return a score with its unit; `length` is that of lengths."""
    if not np.isfinite(value):
        return "none"
    unit = unit_in(name, length)
    return f"{value:.4g} {UNITS.get(unit, unit)}".rstrip()

"""Predictions of rooms in 3D: which scenes are recorded, in which orders, and with what text."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.reader import Images, MeasuredFile, matrix_of, rays_of
from metrics.score_file import read_scores
from metrics.scoring.images.geometry import points_as_scored
from metrics.scoring.images.layers import fitted_layers, read_true_layers
from metrics.scoring.images.measured_rows import points_as_declared
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import ScoreFile
from metrics.scoring.runs import ScoringError
from metrics.scoring.truth_digests import require_truth, stated_truth
from metrics.submissions.reader import Predictions, RoomPredictions
from metrics.submissions.truths import read_true_view
from scenegen.camera import pixel_directions
from scenegen.common.errors import SpecError
from scenegen.common.text_table import piped
from scenegen.viewing import (
    MOST_ROWS,
    SCENE,
    RecordedScene,
    Surfaces,
    View,
    hidden_points,
    room_scenes,
)

Array = NDArray[Any]
Scenes = Sequence[Sequence[int]]  # of each scene the rows of its images
SORTED_BY = tuple(
    dict.fromkeys(
        name for kind in ("rooms", "interiors", "measured", "layers") for name in HEADLINE[kind]
    )
)


def require_rooms(predictions: Predictions) -> RoomPredictions:
    """Return a submission of rooms. Raises ScoringError for answers to questions."""
    if not isinstance(predictions, RoomPredictions):
        wrong, hint = f"responses to {predictions.task}", "rooms, which alone have a 3D view"
        raise ScoringError(predictions.path, wrong, "predictions of rooms", hint)
    return predictions


def scores_of(path: str | Path, predictions: RoomPredictions, truth: Images) -> ScoreFile:
    """Read a score file of a submission. Raises as `read_scores`, and for scores of others."""
    scores = read_scores(path)
    require_truth(scores, stated_truth(truth), truth.path)
    if predictions.sha256 not in {run.sha256 for run in scores.meta.submissions}:
        wrong = f"scores of {', '.join(run.path for run in scores.meta.submissions)}"
        expected = f"those of {predictions.path} as it is now"
        raise ScoringError(path, wrong, expected, "score it again, or leave out --scores")
    return scores


def predicted_scenes(
    predictions: RoomPredictions,
    truth: Images,
    scores: ScoreFile,
    items: Sequence[int] | None = None,
) -> Iterator[RecordedScene]:
    """Yield scenes with their predictions: those of `items`, or the worst of about MOST_ROWS rows.

    Raises SpecError for rows that have no score, and FileFormatError for damaged rows.
    """
    chosen = scores.ids if items is None else np.unique(items)
    for row in np.setdiff1d(chosen, scores.ids):
        raise SpecError("items", f"row {row}", f"some of the {len(scores.ids)} rows with a score")
    measured, by_scene = isinstance(truth, MeasuredFile), dict[int, list[int]]()
    scene_of = scores.ids if measured else scores.clusters
    for k in np.flatnonzero(np.isin(scores.ids, chosen)):
        by_scene.setdefault(int(scene_of[k]), []).append(int(scores.ids[k]))
    names = [n for n in dict.fromkeys(SORTED_BY) if np.isfinite(scores.items.get(n, np.nan)).any()]
    orders = {name: worst_first(scores, name, list(by_scene.values())) for name in names}
    shown = orders[names[0]]
    if items is None:  # whole scenes, and at least one
        before = np.cumsum([0, *map(len, shown)])
        shown = [rows for rows, k in zip(shown, before, strict=False) if k < MOST_ROWS]
    for scene, rows in zip(_true_scenes(truth, shown), shown, strict=True):
        steps = {f"worst {metric(n).title} first": orders[n].index(rows) for n in names}
        views = [_with_prediction(view, predictions, truth) for view in scene.views]
        text = "\n".join([scene.text, "", *_scores_table(scores, names, views)])
        yield replace(scene, steps={**steps, **scene.steps}, views=views, text=text)


def worst_first(scores: ScoreFile, name: str, scenes: Scenes) -> Scenes:
    """Return scenes from the worst mean score to the best; those without a score come last."""
    sign = 1.0 if metric(name).higher_is_better else -1.0
    value = dict(zip(scores.ids.tolist(), (sign * scores.items[name]).tolist(), strict=True))

    def mean(rows: Sequence[int]) -> float:
        finite = [value[row] for row in rows if np.isfinite(value[row])]
        return float(np.mean(finite)) if finite else np.inf

    return sorted(scenes, key=mean)


def _true_scenes(truth: Images, scenes: Scenes) -> Iterator[RecordedScene]:
    """Yield scenes of rooms, or each image of measured truth as a scene of its own."""
    if not isinstance(truth, MeasuredFile):
        yield from room_scenes(truth, scenes)
        return
    for (row,) in scenes:
        view, rays = truth.view(row), rays_of(truth, row, *truth.size(row))
        surfaces = Surfaces(rays * view.depth[..., None], view.normal)
        matrix, picture = matrix_of(truth, row), truth.picture(row)
        shown = View("view_0", row, picture, None, np.eye(4), matrix, surfaces)
        yield RecordedScene({SCENE: row}, [shown], (), f"# Image {row}")


def _with_prediction(view: View, predictions: RoomPredictions, truth: Images) -> View:
    """Return a view with its prediction: points as they are scored, and normals."""
    (entry,) = np.flatnonzero(predictions.rows == view.row)
    predicted = predictions.view(int(entry))
    (height, width), hidden = view.image.shape[:2], None
    depth = view.truth.depth
    if isinstance(truth, MeasuredFile):
        points = points_as_declared(predicted, depth, rays_of(truth, view.row, height, width))
    elif predicted.kind == "layers":
        true = read_true_layers(truth, view.row, read_true_view(truth, view.row))
        layers = fitted_layers(predicted, true)
        rays = pixel_directions(height, width, truth.lens(view.row))
        points, hidden = rays * layers[..., :1], hidden_points(rays, layers)
    else:
        points = points_as_scored(predicted, depth, truth.lens(view.row))
    normal = None if predicted.normal is None else predicted.normal[:height, :width]
    return replace(view, prediction=Surfaces(points, normal, hidden))


def _scores_table(scores: ScoreFile, names: Sequence[str], views: Sequence[View]) -> list[str]:
    """Return a Markdown table of the scores of views, and of how many points are not shown."""
    at = np.searchsorted(scores.ids, [view.row for view in views])
    lines = [("score", *(f"{view.name}, row {view.row}" for view in views))]
    for name in names:
        values = (f"{value:.4g}" for value in scores.items[name][at])
        lines.append((f"{metric(name).title}, {scores.unit_of(name)}", *values))
    absent = (str(np.count_nonzero(~v.prediction.in_view)) for v in views if v.prediction)
    return piped([*lines, ("pixels without a point", *absent)])

"""Scores of one panorama: distances along rays, points and predicted normals.

What compares neighbours on an image plane, or needs the empty room's planar depth, is left out:
surfaces, boundaries, pairs, derived normals, relief, shape, objects and hidden surfaces.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import align
from metrics.measures.depth import DepthPair, depth_scores, scale_log2
from metrics.measures.surfaces.normals import angular_errors_degrees, normal_scores
from metrics.measures.surfaces.points import point_map_scores, ray_error_degrees
from metrics.scoring.images.geometry import alignments_scored, fitted_geometry, scored_alignment
from metrics.scoring.images.image_scores import breaks_rules
from metrics.scoring.metric_names import FLAT, SKILLED, metric
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.rules import refuse_pixels
from metrics.submissions.truths import TrueView
from scenegen.camera import pixel_directions

Array = NDArray[Any]


def score_panorama(
    predicted: PredictedView, truth: TrueView, penalise: bool = False
) -> dict[str, float]:
    """Return every score of what is predicted for a panorama, by name.

    With `penalise`, an image with a scored pixel that breaks `submissions.rules` has the worst
    value of every score. Else it raises PredictionError.
    """
    broken = penalise and breaks_rules(predicted, truth)
    for name, values in () if broken else predicted.columns:
        if values is not None:
            refuse_pixels(PredictionError, f"predicted {name}", name, values, truth.mask)
    mask, true = truth.mask, truth.depth[truth.mask].astype(np.float64)
    height, width = mask.shape
    rays = pixel_directions(height, width, truth.lens)[mask]
    if broken:
        pair, points = DepthPair(true, true), rays * true[:, None]
    else:
        geometry = fitted_geometry(predicted, truth.depth, truth.lens, mask)
        pair, points = DepthPair(geometry.depth[mask], true), geometry.points
    on_rays = predicted.kind != "points"
    scores = depth_scores(pair) | point_map_scores(points, rays * true[:, None])
    alignment = scored_alignment(predicted.kind, predicted.alignment)
    for after in alignments_scored(predicted.kind, predicted.alignment):
        scores |= depth_scores(pair, after, aligned=after == alignment and on_rays)
    scores["scale_log2"] = scale_log2(pair)
    if not on_rays:
        scores["ray_error_degrees"] = ray_error_degrees(points, rays)
    if predicted.normal is not None:
        normal = truth.normal if broken else predicted.normal
        scores |= normal_scores(angular_errors_degrees(normal, truth.normal, mask))
    if broken:
        scores = {name: metric(name).worst(float(true.max())) for name in scores}
    return scores


def baselines_of(truth: TrueView) -> dict[str, float]:
    """Return the scores of the same distance everywhere, which is fitted to the truth."""
    true = truth.depth[truth.mask].astype(np.float64)
    scores = depth_scores(DepthPair(align(np.ones_like(true), true, "scale_shift"), true))
    return {FLAT + name: value for name, value in scores.items() if FLAT in SKILLED.get(name, ())}

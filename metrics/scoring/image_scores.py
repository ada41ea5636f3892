"""All scores of one image: predicted depth and normals against the true ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment
from metrics.measures.chamfer_hausdorff import (
    NearestDistances,
    chamfer,
    hausdorff,
    nearest_distances,
    point_scores,
)
from metrics.measures.depth import align, compare_depth, depth_scores, mse_depth
from metrics.measures.empty_room import empty_room
from metrics.measures.image_search import nearest_distances_on_image
from metrics.measures.normals import angular_errors_degrees, normal_scores, normals_from_depth
from metrics.measures.objects import counted_objects, object_means, single_objects
from metrics.measures.relief import relief_scores
from metrics.scoring.geometry import alignments_scored, planar_depth
from metrics.scoring.metric_names import OF_EMPTY_ROOM, OTHER_SCENE
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.rules import Against, broken_rules, refuse_pixels
from metrics.submissions.truths import TrueView
from scenegen.camera import back_project, pixel_directions

Array = NDArray[Any]
NonFinite = Literal["error", "penalise"]
F_SCORE_THRESHOLDS = (0.01, 0.02, 0.05)  # scene units: edges of the room


@dataclass(frozen=True)
class ImageScores:
    """Scores of one image.

    Attributes:
        scores: by name; NaN where the image has no such score, see `metric_names.Metric.lacking`.
        objects: of each object that counts, as `measures.objects.single_objects` gives them.
    """

    scores: dict[str, float]
    objects: dict[str, Array]


@dataclass(frozen=True)
class EmptyRoom:
    """The empty room that the camera of a true view sees.

    Attributes:
        depth: planar, (H, W), scene units.
        scores: those of `metric_names.OF_EMPTY_ROOM`, by name.
    """

    depth: Array
    scores: dict[str, float]


def score_empty_room(truth: TrueView) -> EmptyRoom:
    """Draw and score the empty room of a true view, the floor of all skills."""
    height, width = truth.depth.shape
    depth, _ = empty_room(truth.world_from_camera, truth.fov_y_degrees, height, width)
    nearest = nearest_distances_on_image(depth, truth.depth, truth.fov_y_degrees, truth.mask)
    scores = {"chamfer": chamfer(nearest), "hausdorff": hausdorff(nearest)}
    scores["mse_depth"] = mse_depth(compare_depth(depth, truth.depth, truth.mask))
    scores |= object_means(_single_objects(depth, truth, nearest))
    return EmptyRoom(depth, {name: scores[name] for name in OF_EMPTY_ROOM})


def true_relief(depth: Array, world_from_camera: Array, fov_y_degrees: float) -> Array:
    """Return the relief of a true view of this depth, (H, W), scene units; NaN where no depth."""
    empty, _ = empty_room(world_from_camera, fov_y_degrees, *depth.shape)
    return np.asarray(empty - depth)


def score_prediction(
    predicted: PredictedView,
    truth: TrueView,
    empty: Array,
    other_relief: Array | None = None,
    non_finite: NonFinite = "error",
) -> ImageScores:
    """Return every score of what is predicted for one image; arguments and errors as `score_view`.

    The depth is scored after every alignment that leaves as much open as the method does.
    """
    depth, alignment = planar_depth(predicted, truth.depth)
    return score_view(
        depth,
        predicted.normal,
        truth,
        empty,
        other_relief,
        alignment=alignment,
        alignments=alignments_scored(predicted.kind, predicted.alignment),
        non_finite=non_finite,
    )


def score_view(
    depth: Array,
    normal: Array | None,
    truth: TrueView,
    empty: Array,
    other_relief: Array | None = None,
    *,
    alignment: Alignment = "none",
    alignments: Sequence[Alignment] = (),
    non_finite: NonFinite = "error",
) -> ImageScores:
    """Return every score of one image.

    Surfels are back-projected from depth, in the camera frame, as Pix2Shape does (section "Scene
    Reconstruction"). Names and units are those of `metric_names`.

    Args:
        depth: predicted planar depth, (H, W), scene units.
        normal: predicted normals, (H, W, 3), camera frame; None where the method gives none.
        truth: what it is compared with.
        empty: planar depth of the empty room, (H, W), scene units.
        other_relief: true relief of another scene, (H, W), scene units, NaN where it has none; None
            where there is no other scene.
        alignment: what the method cannot know. The depth is fitted to the truth of the image so
            far before anything is scored; after "disparity_scale_shift" it is already.
        alignments: the alignments after which depth is scored once more.
        non_finite: what to do with scored pixels that break `submissions.rules`. "penalise" scores
            them at the worst: depth as 0 (at the camera), a normal as opposite to the true one. An
            image with such a depth gets the worst scores of relief, -1 and 0.

    Raises PredictionError with the count and the first pixel, unless they are penalised, and
    ValueError on other shapes than the truth's.
    """
    mask = truth.mask
    broken = np.zeros_like(mask)
    if non_finite == "error":
        refuse_pixels(PredictionError, "predicted depth", "depth", depth, mask)
        if normal is not None:
            refuse_pixels(PredictionError, "predicted normals", "normal", normal, mask)
    else:
        broken = _broken("depth", depth, mask)
        depth = np.where(broken, 0.0, depth)
        if normal is not None:
            normal = np.where(_broken("normal", normal, mask)[..., None], -truth.normal, normal)
    if alignment not in ("none", "disparity_scale_shift"):
        fitted = align(compare_depth(depth, truth.depth, mask), alignment).predicted
        depth = np.full(depth.shape, np.nan)
        depth[mask] = fitted
    nearest = nearest_distances_on_image(depth, truth.depth, truth.fov_y_degrees, mask)
    scores = point_scores(nearest, F_SCORE_THRESHOLDS)
    pair = compare_depth(depth, truth.depth, mask)
    plain = depth_scores(pair)
    scores |= plain
    for after in alignments:
        if after == alignment:
            scores |= {f"{name}_after_{after}": value for name, value in plain.items()}
        else:
            scores |= depth_scores(pair, after)
    said = empty - depth
    relief = relief_scores(said[mask], (empty - truth.depth)[mask])
    if broken.any():  # else they would count as relief, at the camera
        worst = {"relief_correlation": -1.0, "relief_iou": 0.0}
        relief = {name: value if np.isnan(value) else worst[name] for name, value in relief.items()}
    objects = _single_objects(depth, truth, nearest)
    scores |= relief | object_means(objects)
    if other_relief is not None:
        both = mask & np.isfinite(other_relief)
        with_other = relief_scores(said[both], other_relief[both]) if both.any() else relief
        # Nothing of the prediction is in a picture where nothing stands out.
        other = {name: 0.0 if np.isnan(value) else value for name, value in with_other.items()}
        scores |= {
            OTHER_SCENE + name: np.nan if np.isnan(relief[name]) else other[name] for name in relief
        }
    counted = counted_objects(truth.object_id)
    if normal is not None:
        angles = angular_errors_degrees(normal, truth.normal, mask)
        scores |= normal_scores(angles)
        scores["object_normal_mean_degrees"] = _mean(angles[counted[mask]])
    # Both derived alike, so that a perfect depth is perfect at creases, too, where planes blend.
    derived, _ = normals_from_depth(depth, truth.fov_y_degrees, mask)
    true_derived, on_surface = normals_from_depth(truth.depth, truth.fov_y_degrees, mask)
    angles = angular_errors_degrees(derived, true_derived, on_surface)
    scores |= {f"derived_{name}": value for name, value in normal_scores(angles).items()}
    # Of objects so thin that no pixel has such a plane, all pixels count.
    smooth = counted & on_surface if (counted & on_surface).any() else counted
    angles = angular_errors_degrees(derived, true_derived, smooth) if smooth.any() else angles[:0]
    return ImageScores(scores | {"derived_object_normal_mean_degrees": _mean(angles)}, objects)


def noise_floors(truth: TrueView) -> dict[str, float]:
    """Return what two samples of the true surface score against each other, by name of the score.

    One sample is at the pixels' centres, the other, in the place of a prediction, at the corners
    between them. A method whose surfels lie on the true surface, but not on the truth's rays,
    scores about this. A corner counts where its four pixels show one object; its depth is that of
    the plane through them, for which 1 / depth is linear across the image. No score where no corner
    counts. Scores that compare depth along the truth's rays have no such floor: it is 0.
    """
    ids, mask = truth.object_id, truth.mask
    height, width = ids.shape
    quads = [(slice(i, height - 1 + i), slice(j, width - 1 + j)) for i, j in np.ndindex(2, 2)]
    whole = np.logical_and.reduce([mask[q] & (ids[q] == ids[quads[0]]) for q in quads])
    if not whole.any():
        return {}
    depth = np.where(mask, truth.depth, 1.0).astype(np.float64)
    corner_depth = 4.0 / np.sum([1.0 / depth[q] for q in quads], axis=0)
    rays = pixel_directions(height, width, truth.fov_y_degrees)
    between = np.sum([rays[q] for q in quads], axis=0) / 4.0
    corners = (corner_depth[..., None] * between)[whole]
    centres = back_project(truth.depth, truth.fov_y_degrees)[mask]
    nearest = nearest_distances(corners, centres)
    objects = object_means(_single_objects(truth.depth, truth, nearest))
    scores = {"chamfer": chamfer(nearest), "hausdorff": hausdorff(nearest), **objects}
    names = ("chamfer", "hausdorff", "object_completeness")
    return {name: scores[name] for name in names if np.isfinite(scores[name])}


def _single_objects(depth: Array, truth: TrueView, nearest: NearestDistances) -> dict[str, Array]:
    mask = truth.mask
    error = np.abs(depth[mask] - truth.depth[mask].astype(np.float64))
    return single_objects(truth.object_id[mask], error, nearest.reverse)


def _mean(angles: Array) -> float:
    return float(angles.mean()) if len(angles) else np.nan


def _broken(name: str, values: Array, surface: Array) -> Array:
    """Return at which pixels (H, W) any rule of a column is broken."""
    wrong = [at for _, at in broken_rules(name, values, Against(surface=surface))]
    return np.asarray(np.logical_or.reduce([np.zeros_like(surface), *wrong]))

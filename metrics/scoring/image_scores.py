"""All scores of one image: predicted depth and normals against the true ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, align_points
from metrics.measures.behind import behind_scores, hidden_from
from metrics.measures.boundaries import boundary_scores
from metrics.measures.chamfer_hausdorff import (
    NearestDistances,
    chamfer,
    hausdorff,
    nearest_distances,
    point_scores,
)
from metrics.measures.depth import compare_depth, depth_scores, mse_depth
from metrics.measures.empty_room import empty_room
from metrics.measures.image_search import nearest_distances_on_image
from metrics.measures.normals import angular_errors_degrees, normal_scores, normals_from_depth
from metrics.measures.objects import counted_objects, object_means, single_objects
from metrics.measures.points import local_point_scores, point_map_scores
from metrics.measures.relief import relief_scores
from metrics.measures.shape import flat_error, inside_objects, one_normal_degrees, shape_scores
from metrics.scoring.geometry import alignments_scored, fitted_depth, planar_depth
from metrics.scoring.metric_names import CUT_OUT, EMPTY_ROOM, OF_EMPTY_ROOM, OTHER_SCENE
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.rules import Against, broken_rules, refuse_pixels
from metrics.submissions.truths import TrueView
from scenegen.camera import (
    back_project,
    pixel_directions,
    transform_points,
    transform_vectors,
)

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
class FirstView:
    """What the first view of a scene sees: depth (H, W), `world_from_camera` (4, 4)."""

    depth: Array
    world_from_camera: Array


@dataclass(frozen=True)
class Reference:
    """What scores need of a true view beside itself, the same for all submissions.

    Attributes:
        empty: planar depth of the empty room that its camera sees, (H, W), scene units.
        normals: derived from its depth, (H, W, 3), and where they are reliable, `smooth`, (H, W).
        inside: the object of each pixel inside one, (H, W), as `shape.inside_objects`.
        hidden: pixels of objects that count and that the first view does not see, (H, W).
        floors: scores of the empty room and of cut-outs, by name; those of OF_TRUTH.
    """

    empty: Array
    normals: Array
    smooth: Array
    inside: Array
    hidden: Array
    floors: dict[str, float]


def reference_of(truth: TrueView, first: FirstView | None = None) -> Reference:
    """Return the reference of a true view; `first` is None where it is the first one itself."""
    height, width = truth.depth.shape
    depth, _ = empty_room(truth.world_from_camera, truth.fov_y_degrees, height, width)
    nearest = nearest_distances_on_image(depth, truth.depth, truth.fov_y_degrees, truth.mask)
    scores = {"chamfer": chamfer(nearest), "hausdorff": hausdorff(nearest)}
    scores["mse_depth"] = mse_depth(compare_depth(depth, truth.depth, truth.mask))
    scores |= object_means(_single_objects(depth, truth, nearest))
    hidden = _hidden(truth, first)
    scores |= behind_scores(
        np.abs(depth - truth.depth)[hidden], nearest.reverse[hidden[truth.mask]]
    )
    floors = {EMPTY_ROOM + name: scores[name] for name in OF_EMPTY_ROOM}
    normals, smooth = normals_from_depth(truth.depth, truth.fov_y_degrees, truth.mask)
    inside = inside_objects(truth.object_id)
    at, derived_at = inside > 0, _smooth_pixels(inside, smooth)
    floors |= {
        f"{CUT_OUT}shape_error": flat_error(truth.depth[at].astype(np.float64), inside[at]),
        f"{CUT_OUT}shape_normal_degrees": one_normal_degrees(truth.normal[at], inside[at]),
        f"{CUT_OUT}derived_shape_normal_degrees": one_normal_degrees(
            normals[derived_at], inside[derived_at]
        ),
    }
    return Reference(depth, normals, smooth, inside, hidden, floors)


def _smooth_pixels(inside: Array, smooth: Array) -> Array:
    """Return the pixels inside objects whose derived normals are scored; all if none is reliable.

    So an image has both scores of normals inside objects or none.
    """
    at = inside > 0
    return at & smooth if (at & smooth).any() else at


def _hidden(truth: TrueView, first: FirstView | None) -> Array:
    counted = counted_objects(truth.object_id)
    if first is None or not counted.any():
        return np.zeros_like(counted)
    points = back_project(truth.depth, truth.fov_y_degrees)[counted]
    hidden = np.zeros_like(counted)
    hidden[counted] = hidden_from(
        transform_points(truth.world_from_camera, points),
        transform_vectors(truth.world_from_camera, truth.normal[counted]),
        first.depth,
        first.world_from_camera,
        truth.fov_y_degrees,
    )
    return hidden


def true_relief(depth: Array, world_from_camera: Array, fov_y_degrees: float) -> Array:
    """Return the relief of a true view of this depth, (H, W), scene units; NaN where no depth."""
    empty, _ = empty_room(world_from_camera, fov_y_degrees, *depth.shape)
    return np.asarray(empty - depth)


def score_prediction(
    predicted: PredictedView,
    truth: TrueView,
    reference: Reference,
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
        reference,
        other_relief,
        points=predicted.geometry if predicted.kind == "points" else None,
        fov_y_degrees=predicted.fov_y_degrees,
        alignment=alignment,
        alignments=alignments_scored(predicted.kind, predicted.alignment),
        non_finite=non_finite,
    )


def score_view(
    depth: Array,
    normal: Array | None,
    truth: TrueView,
    reference: Reference,
    other_relief: Array | None = None,
    *,
    points: Array | None = None,
    fov_y_degrees: float | None = None,
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
        reference: what belongs to that.
        other_relief: true relief of another scene, (H, W), scene units, NaN where it has none; None
            where there is no other scene.
        points: predicted points, (H, W, 3), camera frame; None for those of the depth.
        fov_y_degrees: predicted vertical field of view; None where the method gives none.
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
    depth, normal, broken = _repaired(depth, normal, truth, non_finite)
    depth = fitted_depth(depth, truth.depth, mask, alignment)
    nearest = nearest_distances_on_image(depth, truth.depth, truth.fov_y_degrees, mask)
    scores = point_scores(nearest, F_SCORE_THRESHOLDS)
    pair = compare_depth(depth, truth.depth, mask)
    scores |= depth_scores(pair)
    for after in alignments:
        scores |= depth_scores(pair, after, aligned=after == alignment)
    said = reference.empty - depth
    relief = relief_scores(said[mask], (reference.empty - truth.depth)[mask])
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
    counted, hidden = counted_objects(truth.object_id), reference.hidden
    scores |= boundary_scores(depth, truth.depth, mask)
    scores |= behind_scores(np.abs(depth - truth.depth)[hidden], nearest.reverse[hidden[mask]])
    scores |= _scores_of_points(depth, points, truth, reference, counted, alignment, alignments)
    if fov_y_degrees is not None:
        scores["fov_error_degrees"] = abs(fov_y_degrees - truth.fov_y_degrees)
    scores |= _scores_of_normals(depth, normal, truth, reference, counted)
    return ImageScores(scores, objects)


def _repaired(
    depth: Array, normal: Array | None, truth: TrueView, non_finite: NonFinite
) -> tuple[Array, Array | None, Array]:
    """Return depth and normals without values that break rules, and where such a depth was."""
    mask = truth.mask
    broken = np.zeros_like(mask)
    if non_finite == "error":
        refuse_pixels(PredictionError, "predicted depth", "depth", depth, mask)
        if normal is not None:
            refuse_pixels(PredictionError, "predicted normals", "normal", normal, mask)
        return depth, normal, broken
    broken = _broken("depth", depth, mask)
    if normal is not None:
        normal = np.where(_broken("normal", normal, mask)[..., None], -truth.normal, normal)
    return np.where(broken, 0.0, depth), normal, broken


def _scores_of_normals(
    depth: Array, normal: Array | None, truth: TrueView, reference: Reference, counted: Array
) -> dict[str, float]:
    """Return the scores of predicted normals, and of those of aligned depth."""
    mask, inside, scores = truth.mask, reference.inside > 0, dict[str, float]()
    if normal is not None:
        angles = angular_errors_degrees(normal, truth.normal, mask)
        scores |= normal_scores(angles)
        scores["object_normal_mean_degrees"] = _mean(angles[counted[mask]])
        scores["shape_normal_degrees"] = _mean(angles[inside[mask]])
    # Both derived alike, so that a perfect depth is perfect at creases, too, where planes blend.
    derived, _ = normals_from_depth(depth, truth.fov_y_degrees, mask)
    angles = np.full(mask.shape, np.nan)
    angles[mask] = angular_errors_degrees(derived, reference.normals, mask)
    smooth = reference.smooth
    scores |= {f"derived_{name}": value for name, value in normal_scores(angles[smooth]).items()}
    # Of objects so thin that no pixel has such a plane, all pixels count.
    at = counted & smooth if (counted & smooth).any() else counted
    scores["derived_object_normal_mean_degrees"] = _mean(angles[at])
    at = _smooth_pixels(reference.inside, smooth)
    scores["derived_shape_normal_degrees"] = _mean(angles[at])
    return scores


def _scores_of_points(
    depth: Array,
    points: Array | None,
    truth: TrueView,
    reference: Reference,
    counted: Array,
    alignment: Alignment,
    alignments: Sequence[Alignment],
) -> dict[str, float]:
    """Return the scores of points, over the image and inside objects.

    `depth` was aligned already. Points that are predicted have an alignment of their own, in space.
    """
    mask = truth.mask
    true = back_project(truth.depth, truth.fov_y_degrees)[mask]
    at_depth = back_project(depth, truth.fov_y_degrees)[mask]
    cloud = at_depth
    if points is not None:
        cloud = align_points(np.where(np.isfinite(points), points, 0.0)[mask], true, alignment)
    scores = point_map_scores(cloud, true)
    for after in ("scale", "scale_shift"):
        if after in alignments:
            scores |= point_map_scores(cloud, true, after)
    scores |= local_point_scores(cloud, true, np.where(counted, truth.object_id, 0)[mask])
    inside = reference.inside[mask]
    at = inside > 0
    return scores | shape_scores(at_depth[at], true[at], inside[at])


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

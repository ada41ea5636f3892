"""All scores of one image: predicted geometry and normals against the true ones.

Depth scores compare planar depth. Scores of surfaces compare points: those that are predicted, or
those of the depth on the rays of its pixels. `metric_names` says which score takes which.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, align, weighted_median
from metrics.measures.boundaries import boundary_scores
from metrics.measures.confidence import confidence_scores
from metrics.measures.depth import DepthPair, depth_scores, scale_log2, within_eighth
from metrics.measures.flying import at_half_resolution, flying_points, other_surface
from metrics.measures.hidden.behind import behind_scores, hidden_from
from metrics.measures.hidden.guesses import balls_and_blocks, depth_of_balls, depth_of_blocks
from metrics.measures.objects import counted_objects, object_means, single_objects
from metrics.measures.pairs import (
    Order,
    Triangles,
    ordered_pairs,
    ordinal_scores,
    relative_normal_scores,
    sawa_h,
    triangle_pairs,
)
from metrics.measures.relief import depth_along, empty_room, relief_scores
from metrics.measures.shape import flat_error, inside_objects, one_normal_degrees, shape_scores
from metrics.measures.surfaces.chamfer_hausdorff import (
    NearestDistances,
    chamfer,
    hausdorff,
    nearest_distances,
    paper_scores,
    point_scores,
)
from metrics.measures.surfaces.image_search import nearest_distances_on_image
from metrics.measures.surfaces.normals import (
    angular_errors_degrees,
    normal_scores,
    normals_from_points,
)
from metrics.measures.surfaces.patches import Surface, surface_distances, surface_of
from metrics.measures.surfaces.points import (
    departures,
    local_point_scores,
    point_map_scores,
    ray_error_degrees,
)
from metrics.scoring.images.geometry import (
    Geometry,
    alignments_scored,
    fitted_geometry,
    scored_alignment,
)
from metrics.scoring.metric_names import (
    BALLS,
    BEHIND,
    BLOCKS,
    CUT_OUT,
    EDGE_DISTANCE,
    EMPTY_ROOM,
    FLAT,
    HALF,
    LEANING,
    LIFTED,
    OBJECT_SCORES,
    OTHER_SCENE,
    RAMP,
    RANDOM_ORDER,
    SKILLED,
    metric,
)
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.rules import Against, broken_rules, refuse_pixels
from metrics.submissions.truths import TrueView
from scenegen.camera import (
    Lens,
    back_project,
    pixel_directions,
    transform_points,
    transform_vectors,
)

Array = NDArray[Any]
NonFinite = Literal["error", "penalise"]
F_SCORE_THRESHOLDS = (0.01, 0.02, 0.05)  # scene units: edges of the room
_WITHOUT_SHAPE = [name for name, begins in SKILLED.items() if LIFTED in begins]


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
    """The first view of a scene: depth and ids (H, W), `world_from_camera` (4, 4)."""

    depth: Array
    object_id: Array
    world_from_camera: Array


@dataclass(frozen=True)
class Reference:
    """What scores need of a true view beside itself, the same for all submissions.

    Attributes:
        empty: planar depth of the empty room that its camera sees, (H, W), scene units.
        surface: the true one.
        normals: derived from its depth, (H, W, 3), and where they are reliable, `smooth`, (H, W).
        counted: pixels of objects that count, (H, W).
        inside: the object of each pixel inside one, (H, W), as `shape.inside_objects`.
        hidden: pixels of objects that count and that the first view does not see, (H, W).
        pairs, order: which pixels are compared with each other, as `measures.pairs`.
        other: depth across the nearest occlusion edge, (H, W), as `flying.other_surface`.
        floors: scores of the empty room, of cut-outs and of guesses, by name; those of OF_TRUTH.
    """

    empty: Array
    surface: Surface
    normals: Array
    smooth: Array
    counted: Array
    inside: Array
    hidden: Array
    pairs: list[Triangles]
    order: Order
    other: Array
    floors: dict[str, float]


def reference_of(
    truth: TrueView,
    first: FirstView | None = None,
    row: int = 0,
    floors: dict[str, float] | None = None,
) -> Reference:
    """Return the reference of a true view, `row` of its file.

    Args:
        first: the first view of its scene; None where it is the first one itself.
        floors: those of the reference, where they are known.
    """
    mask, lens = truth.mask, truth.lens
    height, width = truth.depth.shape
    empty, facing = empty_room(truth.world_from_camera, lens, height, width, truth.room_size)
    points = _image(back_project(truth.depth, lens)[mask], mask)
    true_normals = truth.normal[mask].astype(np.float64)
    surface = surface_of(points[mask], true_normals, lens, mask)
    counted = counted_objects(truth.object_id)
    hidden = _hidden(truth, counted, first)
    reference = Reference(
        empty,
        surface,
        *normals_from_points(points, lens, mask),
        counted,
        inside_objects(truth.object_id),
        hidden,
        triangle_pairs(points, mask, row, truth.object_id),
        ordered_pairs(truth.depth, mask, row, truth.object_id),
        other_surface(truth.depth, truth.object_id, mask),
        floors or {},
    )
    if floors is None:
        guesses = _guesses(truth, empty, hidden, first)
        reference.floors.update(_floors(truth, reference, facing, guesses))
    return reference


def _floors(
    truth: TrueView, reference: Reference, facing: Array, guesses: dict[str, Array]
) -> dict[str, float]:
    """Return the scores of guesses that follow from the truth; `facing` has the walls' normals."""
    mask, lens, empty = truth.mask, truth.lens, reference.empty
    room = Geometry(empty, back_project(empty, lens)[mask], True)
    walls, _ = normals_from_points(_image(room.points, mask), lens, mask)
    surface, true = reference.surface, truth.depth[mask].astype(np.float64)
    inside = reference.inside
    at, derived_at = inside > 0, _smooth_pixels(inside, reference.smooth)
    scores = depth_scores(DepthPair(empty[mask], true))
    if truth.room_size is None:  # distances of surfaces are no headline of closed rooms
        seen = surface_of(room.points, walls[mask], surface.lens, mask)
        nearest = surface_distances(seen, surface, _nearest(room, truth, surface), True)
        scores |= {"chamfer": chamfer(nearest), "hausdorff": hausdorff(nearest)}
        scores |= object_means(_single_objects(empty, truth, nearest))
    else:
        error = np.abs(empty - truth.depth)[reference.counted]
        scores["object_depth_error"] = _mean(error)
    scores |= boundary_scores(empty, truth.depth, mask)
    scores |= point_map_scores(room.points, surface.points)
    scores |= relative_normal_scores(_image(room.points, mask), reference.pairs)
    scores |= {
        "shape_error": flat_error((empty - truth.depth)[at], inside[at]),
        "shape_normal_degrees": _mean_angle(facing, truth.normal, at),
        "derived_shape_normal_degrees": _mean_angle(walls, reference.normals, derived_at),
    }
    of_empty = [name for name in scores if EMPTY_ROOM in SKILLED.get(name, ())]
    floors = {EMPTY_ROOM + name: scores[name] for name in of_empty}
    for guess, depth in guesses.items():
        errors = np.abs(depth - truth.depth)[reference.hidden]
        floors[guess + BEHIND] = behind_scores(errors)[BEHIND]
    flat = np.where(truth.object_id == 0, truth.depth, empty).astype(np.float64)
    for number in np.unique(truth.object_id[truth.object_id > 0]).tolist():
        own = truth.object_id == number
        flat[own] = np.median(truth.depth[own])
    flat_pairs = relative_normal_scores(_image(surface.points, mask), reference.pairs)["flat"]
    floors |= {
        f"{CUT_OUT}shape_error": flat_error(truth.depth[at].astype(np.float64), inside[at]),
        f"{CUT_OUT}shape_normal_degrees": one_normal_degrees(truth.normal[at], inside[at]),
        f"{CUT_OUT}derived_shape_normal_degrees": one_normal_degrees(
            reference.normals[derived_at], inside[derived_at]
        ),
        f"{CUT_OUT}boundary_f1": boundary_scores(flat, truth.depth, mask)["boundary_f1"],
        f"{CUT_OUT}relative_normal_degrees": flat_pairs,
        f"{HALF}flying_points": flying_points(
            at_half_resolution(truth.depth, mask), truth.depth, reference.other
        ),
    }
    if truth.room_size is not None:  # of a leaning cut-out, but for each object's shift
        floors[f"{LEANING}shape_error"] = flat_error((empty / 2.0 - truth.depth)[at], inside[at])
    height, width = mask.shape
    rays = pixel_directions(height, width, lens)[mask]
    down = (np.nonzero(mask)[0] + 0.5) / len(mask)
    at = truth.object_id[mask] > 0
    near, weights = room.depth[mask] - true, at / true
    lift = max(weighted_median(near[at], weights[at]), 0.0) if at.any() else 0.0
    guesses_of_depth = {
        LIFTED: room.depth[mask] - lift * at,
        FLAT: align(np.ones_like(down), true, "scale_shift"),
        RAMP: align(2.0 - down, true, "scale_shift"),
    }
    for guess, fitted in guesses_of_depth.items():
        scores = depth_scores(DepthPair(fitted, true))
        scores |= point_map_scores(rays * fitted[:, None], surface.points)
        floors |= {guess + name: value for name, value in scores.items() if name in _WITHOUT_SHAPE}
    return floors


def _guesses(
    truth: TrueView, empty: Array, hidden: Array, first: FirstView | None
) -> dict[str, Array]:
    """Return depth (H, W) of the guesses at hidden pixels, by what begins their scores' names.

    Where nothing is hidden they are not scored, and so not drawn.
    """
    closed = (LEANING,) if truth.room_size is not None else ()
    if first is None or not hidden.any():
        return dict.fromkeys((EMPTY_ROOM, CUT_OUT, BALLS, BLOCKS, *closed), empty)
    flat, leaning = empty.copy(), empty.copy()
    for number in np.unique(truth.object_id[hidden]).tolist():
        own = truth.object_id == number
        flat[own] = np.median(truth.depth[own])
        leaning[own] = flat[own] + (empty[own] - np.median(empty[own])) / 2.0
    camera = truth.world_from_camera, truth.lens
    seen = first.depth, first.object_id, first.world_from_camera, truth.lens
    balls, blocks = balls_and_blocks(*seen)
    return {
        EMPTY_ROOM: empty,
        CUT_OUT: flat,
        BALLS: depth_of_balls(balls, *camera, empty),
        BLOCKS: depth_of_blocks(blocks, *camera, empty),
        **dict.fromkeys(closed, leaning),
    }


def _image(values: Array, mask: Array) -> Array:
    """Return values (N, ...) of the pixels of a mask as an image (H, W, ...), NaN elsewhere."""
    image = np.full((*mask.shape, *values.shape[1:]), np.nan)
    image[mask] = values
    return image


def _nearest(geometry: Geometry, truth: TrueView, surface: Surface) -> NearestDistances:
    """Return the distances both ways between predicted points and those of the true pixels."""
    if not geometry.on_rays:
        return nearest_distances(geometry.points, surface.points)
    return nearest_distances_on_image(geometry.depth, truth.depth, truth.lens, surface.mask)


def _smooth_pixels(inside: Array, smooth: Array) -> Array:
    """Return the pixels inside objects whose derived normals are scored; all if none is reliable.

    So an image has both scores of normals inside objects or none.
    """
    at = inside > 0
    return at & smooth if (at & smooth).any() else at


def _hidden(truth: TrueView, counted: Array, first: FirstView | None) -> Array:
    if first is None or not counted.any():
        return np.zeros_like(counted)
    points = back_project(truth.depth, truth.lens)[counted]
    hidden = np.zeros_like(counted)
    hidden[counted] = hidden_from(
        transform_points(truth.world_from_camera, points),
        transform_vectors(truth.world_from_camera, truth.normal[counted]),
        first.depth,
        first.world_from_camera,
        truth.lens,
    )
    return hidden


def true_relief(
    depth: Array, world_from_camera: Array, lens: Lens | float, room_size: Array | None = None
) -> Array:
    """Return the relief of a true view of this depth, (H, W), scene units; NaN where no depth."""
    height, width = depth.shape
    empty, _ = empty_room(world_from_camera, lens, height, width, room_size)
    return np.asarray(empty - depth)


def score_prediction(
    predicted: PredictedView,
    truth: TrueView,
    reference: Reference,
    other_relief: Array | None = None,
    non_finite: NonFinite = "error",
    edge_distance: Array | None = None,
) -> ImageScores:
    """Return every score of what is predicted for one image, by the names of `metric_names`.

    The geometry is fitted to the truth as far as the method declares, before anything is scored.
    Depth is scored once more after every alignment that leaves as much open as the method does.

    Args:
        truth: what it is compared with.
        reference: what belongs to that.
        other_relief: true relief of another scene, (H, W), scene units, NaN where it has none; None
            where there is no other scene, and the scores against it are NaN.
        non_finite: what to do with an image in which a scored pixel breaks `submissions.rules`.
            "penalise" gives it the worst value of every score, `metric_names.Metric.worst`.
        edge_distance: of the image, (H, W), as `confidence.distance_from_edges`, for methods that
            state their confidence.

    Raises PredictionError with the count and the first pixel, unless they are penalised, and
    ValueError on other shapes than the truth's.
    """
    if non_finite == "penalise" and breaks_rules(predicted, truth):
        return _worst(predicted, truth, reference, other_relief, edge_distance)
    for name, values in predicted.columns:
        if values is not None:
            refuse_pixels(PredictionError, f"predicted {name}", name, values, truth.mask)
    mask, lens = truth.mask, truth.lens
    alignment = scored_alignment(predicted.kind, predicted.alignment)
    alignments = alignments_scored(predicted.kind, predicted.alignment)
    geometry = fitted_geometry(predicted, truth.depth, lens, mask)
    # Both derived alike, so that a perfect depth is perfect at creases, too, where planes blend.
    derived, _ = normals_from_points(_image(geometry.points, mask), lens, mask)
    surface = surface_of(geometry.points, derived[mask], reference.surface.lens, mask)
    closest = _nearest(geometry, truth, reference.surface)
    nearest = surface_distances(surface, reference.surface, closest, geometry.on_rays)
    scores = point_scores(nearest, F_SCORE_THRESHOLDS) | paper_scores(closest)
    pair = DepthPair(geometry.depth[mask], truth.depth[mask].astype(np.float64))
    scores |= depth_scores(pair)
    for after in alignments:
        scores |= depth_scores(pair, after, aligned=after == alignment and geometry.on_rays)
    objects = _single_objects(geometry.depth, truth, nearest)
    scores |= object_means(objects)
    scores |= _scores_of_relief(geometry, truth, reference, other_relief)
    scores |= boundary_scores(geometry.depth, truth.depth, mask)
    scores |= _scores_of_points(geometry, truth, reference, nearest, alignments)
    image = _image(geometry.points, mask)
    scores |= scores_of_pairs(
        pair, scores["boundary_f1"], geometry.depth, image, reference.pairs, reference.order
    )
    scores["flying_points"] = flying_points(geometry.depth, truth.depth, reference.other)
    scores["scale_log2"] = scale_log2(pair)
    if predicted.fov_y_degrees is not None:
        scores["fov_bias_degrees"] = predicted.fov_y_degrees - truth.lens.fov_y_degrees
        scores["fov_error_degrees"] = abs(scores["fov_bias_degrees"])
    if predicted.confidence is not None:
        scores |= scores_of_confidence(pair, predicted.confidence[mask], edge_distance, mask)
    scores |= _scores_of_normals(derived, predicted.normal, truth, reference)
    return ImageScores(scores, objects)


def scores_of_pairs(
    pair: DepthPair,
    boundary_f1: float,
    depth: Array,
    points: Array,
    pairs: list[Triangles],
    order: Order,
) -> dict[str, float]:
    """Return the scores of pairs of pixels, and SAWA-H, of aligned depth (H, W) and its points."""
    normals, ordinal = relative_normal_scores(points, pairs), ordinal_scores(depth, order)
    fits: tuple[Alignment, ...] = ("disparity_scale_shift", "scale_shift")
    of_disparity, of_depth = (within_eighth(pair, fit) for fit in fits)
    unordered = 1.0 - ordinal["anywhere"]
    scores = {"relative_normal_degrees": normals["relative_normal_degrees"]}
    scores |= {name: value for name, value in ordinal.items() if name != "anywhere"}
    hybrid = sawa_h(unordered, of_disparity, of_depth, boundary_f1, normals["anywhere"])
    return scores | {"sawa_h": hybrid}


def scores_of_confidence(
    pair: DepthPair, confidence: Array, edge_distance: Array | None, mask: Array
) -> dict[str, float]:
    """Return the scores of confidences (N,), and those of a random order and of `edge_distance`."""
    errors = np.abs(pair.predicted - pair.true) / pair.true
    scores = confidence_scores(errors, confidence)
    scores[f"{RANDOM_ORDER}ause_abs_rel"] = scores["ause_abs_rel"] + scores["aurg_abs_rel"]
    if edge_distance is not None:
        by_edges = confidence_scores(errors, edge_distance[mask])["ause_abs_rel"]
        scores[f"{EDGE_DISTANCE}ause_abs_rel"] = by_edges
    return scores


def breaks_rules(predicted: PredictedView, truth: TrueView) -> bool:
    """Return whether a scored pixel breaks `submissions.rules`."""
    against = Against(surface=truth.mask)
    return any(
        True
        for name, values in predicted.columns
        if values is not None
        for _ in broken_rules(name, values, against)
    )


def _worst(
    predicted: PredictedView,
    truth: TrueView,
    reference: Reference,
    other_relief: Array | None,
    edge_distance: Array | None,
) -> ImageScores:
    """Return the worst value of each score that the truth would have in this submission."""
    perfect: Array = np.where(truth.mask, truth.depth, 1.0)
    if predicted.kind == "points":
        perfect = back_project(perfect, truth.lens)
    elif predicted.kind == "disparity":
        perfect = 1.0 / perfect
    normal = None if predicted.normal is None else truth.normal
    sure = None if predicted.confidence is None else np.zeros(truth.mask.shape)
    instead = replace(predicted, geometry=perfect, normal=normal, confidence=sure)
    best = score_prediction(instead, truth, reference, other_relief, "error", edge_distance)
    farthest = float(truth.depth[truth.mask].max(initial=0.0))
    scores = {
        name: value if np.isnan(value) else metric(name).worst(farthest)
        for name, value in best.scores.items()
    }
    objects = {
        name: np.full(column.shape, metric(name).worst(farthest))
        if name in OBJECT_SCORES
        else column
        for name, column in best.objects.items()
    }
    return ImageScores(scores, objects)


def _scores_of_relief(
    geometry: Geometry, truth: TrueView, reference: Reference, other_relief: Array | None
) -> dict[str, float]:
    """Return the scores of relief, which is how far points stand before the empty room.

    That is along the line from the camera to the point, which is the ray of its pixel for depth.
    """
    mask = truth.mask
    room = reference.empty[mask]
    if not geometry.on_rays:
        ahead = geometry.points[:, 2] < 0.0
        lines = geometry.points[ahead] / -geometry.points[ahead, 2:]
        room[ahead] = depth_along(lines, truth.world_from_camera, truth.room_size)
    said = room - geometry.depth[mask]
    relief = relief_scores(said, (reference.empty - truth.depth)[mask])
    if other_relief is None:
        return relief | {OTHER_SCENE + name: np.nan for name in relief}
    other = other_relief[mask]
    both = np.isfinite(other)
    with_other = relief_scores(said[both], other[both]) if both.any() else relief
    # Nothing of the prediction is in a picture where nothing stands out.
    others = {name: 0.0 if np.isnan(value) else value for name, value in with_other.items()}
    return relief | {
        OTHER_SCENE + name: np.nan if np.isnan(relief[name]) else others[name] for name in relief
    }


def _scores_of_normals(
    derived: Array, normal: Array | None, truth: TrueView, reference: Reference
) -> dict[str, float]:
    """Return the scores of predicted normals, and of those derived from the aligned points."""
    mask, inside, scores = truth.mask, reference.inside > 0, dict[str, float]()
    counted = reference.counted
    if normal is not None:
        angles = angular_errors_degrees(normal, truth.normal, mask)
        scores |= normal_scores(angles)
        scores["object_normal_mean_degrees"] = _mean(angles[counted[mask]])
        scores["shape_normal_degrees"] = _mean(angles[inside[mask]])
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
    geometry: Geometry,
    truth: TrueView,
    reference: Reference,
    nearest: NearestDistances,
    alignments: tuple[Alignment, ...],
) -> dict[str, float]:
    """Return the scores of points of the same pixels: over the image, inside objects, behind."""
    mask, points, true = truth.mask, geometry.points, reference.surface.points
    scores = point_map_scores(points, true)
    if not geometry.on_rays:
        height, width = mask.shape
        rays = pixel_directions(height, width, truth.lens)[mask]
        scores["ray_error_degrees"] = ray_error_degrees(points, rays)
    for after in ("scale", "scale_shift"):
        if after in alignments:
            scores |= point_map_scores(points, true, after)
    ids = np.where(reference.counted, truth.object_id, 0)[mask]
    scores |= local_point_scores(points, true, ids)
    height, width = mask.shape
    rays = pixel_directions(height, width, truth.lens)[mask]
    apart = departures(points, truth.depth[mask], rays, geometry.on_rays)
    inside = reference.inside[mask]
    at = inside > 0
    scores |= shape_scores(apart[at], points[at], true[at], inside[at])
    at = reference.hidden[mask]
    return scores | behind_scores(np.sqrt(np.square(apart[at]).sum(axis=-1)), nearest.reverse[at])


def _single_objects(depth: Array, truth: TrueView, nearest: NearestDistances) -> dict[str, Array]:
    mask = truth.mask
    error = np.abs(depth[mask] - truth.depth[mask].astype(np.float64))
    return single_objects(truth.object_id[mask], error, nearest.reverse)


def _mean_angle(a: Array, b: Array, at: Array) -> float:
    """Return the mean angle of normals (H, W, 3) at some pixels, degrees; NaN without any."""
    return float(angular_errors_degrees(a, b, at).mean()) if at.any() else np.nan


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else np.nan

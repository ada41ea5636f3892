"""All scores of one image: predicted depth and normals against the true ones."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.measures.chamfer_hausdorff import chamfer, nearest_distances, point_scores
from metrics.measures.depth import Alignment, compare_depth, depth_scores
from metrics.measures.image_search import nearest_distances_on_image
from metrics.measures.normals import angular_errors_degrees, normal_scores, normals_from_depth
from metrics.submissions.problems import PredictionError
from metrics.submissions.rules import depth_faults, normal_faults, refuse_faults
from metrics.submissions.truths import TrueView
from scenegen.camera import back_project, pixel_directions

Array = NDArray[Any]
NonFinite = Literal["error", "penalise"]
F_SCORE_THRESHOLDS = (0.01, 0.02, 0.05)  # scene units: edges of the room
ALIGNMENTS: tuple[Alignment, ...] = ("none", "scale", "scale_shift")


def score_view(
    depth: Array,
    normal: Array | None,
    truth: TrueView,
    *,
    alignments: Sequence[Alignment] = ALIGNMENTS,
    non_finite: NonFinite = "error",
) -> dict[str, float]:
    """Return every score of one image by name.

    Surfels are back-projected from depth, in the camera frame, as Pix2Shape does (section "Scene
    Reconstruction"). Names and units are those of `metric_names`.

    Args:
        depth: predicted planar depth, (H, W), scene units.
        normal: predicted normals, (H, W, 3), camera frame; None where the method gives none.
        truth: what it is compared with.
        alignments: the alignments after which depth is scored; points are never aligned.
        non_finite: what to do with scored pixels that break `submissions.rules`. "penalise" scores
            them at the worst: depth as 0 (at the camera), a normal as opposite to the true one.

    Raises PredictionError with the count and the first pixel, unless they are penalised, and
    ValueError on other shapes than the truth's.
    """
    mask = truth.mask
    faults = depth_faults(depth, mask)
    if non_finite == "error":
        refuse_faults(faults, PredictionError, "predicted depth")
    depth = np.where(_any(faults, mask), 0.0, depth)
    if normal is not None:
        faults = normal_faults(normal, mask)
        if non_finite == "error":
            refuse_faults(faults, PredictionError, "predicted normals")
        normal = np.where(_any(faults, mask)[..., None], -truth.normal, normal)
    nearest = nearest_distances_on_image(depth, truth.depth, truth.fov_y_degrees, mask)
    scores = point_scores(nearest, F_SCORE_THRESHOLDS)
    pair = compare_depth(depth, truth.depth, mask)
    for alignment in alignments:
        scores |= depth_scores(pair, alignment)
    if normal is not None:
        scores |= normal_scores(angular_errors_degrees(normal, truth.normal, mask))
    # Both derived alike, so that a perfect depth is perfect at creases, too, where planes blend.
    derived, _ = normals_from_depth(depth, truth.fov_y_degrees, mask)
    true_derived, on_surface = normals_from_depth(truth.depth, truth.fov_y_degrees, mask)
    angles = angular_errors_degrees(derived, true_derived, on_surface)
    return scores | {f"derived_{name}": value for name, value in normal_scores(angles).items()}


def chamfer_floor(truth: TrueView) -> float:
    """Return the Chamfer distance between two samples of the true surface, in scene units.

    One sample is at the pixels' centres, the other at the corners between them. A method whose
    surfels lie on the true surface, but not on the truth's rays, scores about this. A corner counts
    where its four pixels show one object; its depth is that of the plane through them, for which
    1 / depth is linear across the image. NaN where no corner counts.
    """
    ids, mask = truth.object_id, truth.mask
    height, width = ids.shape
    quads = [(slice(i, height - 1 + i), slice(j, width - 1 + j)) for i, j in np.ndindex(2, 2)]
    whole = np.logical_and.reduce([mask[q] & (ids[q] == ids[quads[0]]) for q in quads])
    if not whole.any():
        return float("nan")
    depth = np.where(mask, truth.depth, 1.0).astype(np.float64)
    corner_depth = 4.0 / np.sum([1.0 / depth[q] for q in quads], axis=0)
    rays = pixel_directions(height, width, truth.fov_y_degrees)
    between = np.sum([rays[q] for q in quads], axis=0) / 4.0
    corners = (corner_depth[..., None] * between)[whole]
    centres = back_project(truth.depth, truth.fov_y_degrees)[mask]
    return chamfer(nearest_distances(corners, centres))


def _any(faults: Mapping[str, Array], mask: Array) -> Array:
    """Return at which pixels (H, W) any rule is broken."""
    return np.asarray(np.logical_or.reduce([np.zeros_like(mask), *faults.values()]))

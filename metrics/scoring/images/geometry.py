"""Depth and points of any kind of predicted geometry, as every score takes them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, align, align_points, depth_of_disparity
from metrics.submissions.reader import PredictedView
from scenegen.camera import Lens, as_lens, pixel_directions

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
WIDER: tuple[Alignment, ...] = (
    "scale", "scale_shift", "scale_l1", "scale_shift_l1", "disparity_scale_shift",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Geometry:
    """What is predicted for one image after the declared alignment, as scores take it.

    Attributes:
        depth: planar depth, (H, W), scene units: -z of the points; in panoramas, their distance;
            NaN outside of the mask.
        points: camera frame, scene units, (N, 3), of the N pixels of the mask.
        on_rays: whether the points lie on the rays of their pixels, as those of depth do.
    """

    depth: Array
    points: Array
    on_rays: bool


def fitted_geometry(
    predicted: PredictedView, true_depth: Array, lens: Lens | float, mask: Mask
) -> Geometry:
    """Return a prediction after its declared alignment to the true depth (H, W) of the mask.

    Points are fitted in space, by `measures.alignment.align_points`, and all else in depth. Where
    nothing is left open, nothing changes. What is predicted must be finite inside the mask.
    """
    height, width = true_depth.shape
    rays = pixel_directions(height, width, lens)[mask]
    true = true_depth[mask].astype(np.float64)
    depth = np.full(true_depth.shape, np.nan)
    if predicted.kind == "points":
        points = predicted.geometry[mask].astype(np.float64)
        if len(true):
            points = align_points(points, rays * true[:, None], predicted.alignment)
        depth[mask] = _depth_of(points, lens)
        return Geometry(depth, points, False)
    values = predicted.geometry[mask].astype(np.float64)
    if predicted.kind == "disparity" and len(true):
        values = depth_of_disparity(values, true)
    elif len(true):
        values = align(values, true, predicted.alignment)
    depth[mask] = values
    return Geometry(depth, rays * values[:, None], True)


def _depth_of(points: Array, lens: Lens | float) -> Array:
    away = -points[..., 2] if as_lens(lens).is_flat else np.sqrt(np.square(points).sum(axis=-1))
    return np.asarray(away)


def depth_as_scored(predicted: PredictedView, true_depth: Array, lens: Lens | float) -> Array:
    """Return depth (H, W) as scores see it, for pictures; no value needs to be finite."""
    return _depth_of(points_as_scored(predicted, true_depth, lens), lens)


def points_as_scored(predicted: PredictedView, true_depth: Array, lens: Lens | float) -> Array:
    """Return points (H, W, 3) as scores see them, NaN where one of both is not finite."""
    known = np.isfinite(true_depth)
    if predicted.kind == "layers":
        predicted = replace(predicted, kind="depth", geometry=predicted.geometry[..., 0])
    finite = np.isfinite(predicted.geometry)
    known &= finite.all(axis=-1) if predicted.kind == "points" else finite
    image = np.full((*known.shape, 3), np.nan)
    image[known] = fitted_geometry(predicted, true_depth, lens, known).points
    return image


def scored_alignment(kind: str, alignment: Alignment) -> Alignment:
    """Return the alignment under which a kind of geometry is scored, from the declared one."""
    return "disparity_scale_shift" if kind == "disparity" else alignment


def alignments_scored(kind: str, alignment: Alignment) -> tuple[Alignment, ...]:
    """Return the alignments after which depth is scored once more.

    They leave at least as much open as the method does: to tell more than it can know would score
    something that it does not predict.
    """
    if kind == "disparity":
        return ("disparity_scale_shift",)
    if alignment == "scale_shift":
        return ("scale_shift", "scale_shift_l1")
    return WIDER if alignment != "median_scale" else (alignment, *WIDER)

"""Scores of one image whose truth was measured, under each of some protocols."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.protocols import (
    DECLARED,
    Protocol,
    ProtocolError,
    depth_under,
    scored_pixels,
)
from metrics.measured.reader import MeasuredView
from metrics.measures.alignment import Alignment, align_points
from metrics.measures.boundaries import boundary_scores
from metrics.measures.depth import DepthPair, depth_scores, scale_log2
from metrics.measures.pairs import (
    ordered_pairs,
    ordinal_scores,
    relative_normal_scores,
    triangle_pairs,
)
from metrics.measures.surfaces.normals import angular_errors_degrees, normal_scores
from metrics.measures.surfaces.points import point_map_scores
from metrics.scoring.images.geometry import alignments_scored, scored_alignment
from metrics.scoring.images.image_scores import scores_of_confidence, scores_of_pairs
from metrics.scoring.metric_names import FLAT, RAMP, SKILLED, metric
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.rules import Against, broken_rules, refuse_pixels

Array = NDArray[Any]
_DEPTH_SCORES = tuple(depth_scores(DepthPair(np.ones(1), np.ones(1))))
_GUESSED = [name for name in _DEPTH_SCORES if FLAT in SKILLED.get(name, ())]
_OF_GUESSES = [guess + name for guess in (FLAT, RAMP) for name in _GUESSED]
PIXELS = "pixels"  # how many pixels of an image a protocol scores


def suits(protocol: Protocol, kind: str, declared: Alignment) -> bool:
    """Return whether a protocol leaves open at least what a method cannot know."""
    allowed = {declared, scored_alignment(kind, declared), *alignments_scored(kind, declared)}
    allowed -= {"scale_shift"} if kind == "disparity" else set()  # which is that of its disparity
    allowed |= {"median_scale"} if "scale" in allowed else set()
    return protocol.alignment is None or protocol.alignment in allowed


def require_suited(protocol: Protocol, kind: str, declared: Alignment) -> None:
    """Raise ProtocolError unless `suits`."""
    if not suits(protocol, kind, declared):
        found = f"{kind} under alignment {declared}, which cannot be scored under"
        expected = f"a protocol that leaves as much open, not {protocol.alignment}"
        raise ProtocolError(protocol.name, f"{found} it", expected)


def scores_of_view(
    predicted: PredictedView,
    truth: MeasuredView,
    protocols: Sequence[Protocol],
    dense: bool,
    penalise: bool = False,
    row: int = 0,
    edge_distance: Array | None = None,
) -> dict[tuple[str, str], float]:
    """Return the scores of an image by name of protocol and of score, and its PIXELS.

    Args:
        predicted: padded as its file has it.
        dense: whether boundaries are scored.
        penalise: give an image with a scored pixel that breaks `submissions.rules` the worst value
            of every score.
        row: of the truth.
        edge_distance: as for `image_scores.score_prediction`.

    Raises PredictionError for such a pixel, and ProtocolError where a single protocol scores none;
    of several, its scores are NaN there.
    """
    geometry, normal, broken = _usable(predicted, truth, penalise)
    depth = -geometry[..., 2] if predicted.kind == "points" else geometry
    found: dict[tuple[str, str], float] = {}
    for protocol in protocols:
        try:
            mask = scored_pixels(protocol, truth.depth)
        except ProtocolError as error:
            if len(protocols) == 1:
                raise error.inside(f"protocol {protocol.name}") from error
            found |= {(protocol.name, name): np.nan for name in (*_DEPTH_SCORES, *_OF_GUESSES)}
            found[protocol.name, PIXELS] = 0
            continue
        true = truth.depth[mask].astype(np.float64)
        of_points = protocol is DECLARED and truth.rays is not None
        rays = truth.rays[mask] if of_points and truth.rays is not None else None
        points = None
        if rays is not None and predicted.kind == "points":
            points = align_points(
                geometry[mask].astype(np.float64), rays * true[:, None], predicted.alignment
            )
            pair = DepthPair(-points[:, 2], true)
        else:
            pair = depth_under(protocol, predicted.kind, predicted.alignment, depth[mask], true)
            points = None if rays is None else rays * pair.predicted[:, None]
        scores = depth_scores(pair) | {"scale_log2": scale_log2(pair)}
        if rays is not None and points is not None:
            scores |= point_map_scores(points, rays * true[:, None])
            for after in ("scale", "scale_shift"):
                if after in alignments_scored(predicted.kind, predicted.alignment):
                    scores |= point_map_scores(points, rays * true[:, None], after)
        if protocol is DECLARED:
            scores |= _further(predicted, normal, truth, pair, points, dense, row)
        if predicted.confidence is not None:
            height, width = mask.shape
            sure = predicted.confidence[:height, :width][mask]
            scores |= scores_of_confidence(pair, sure, edge_distance, mask)
        flat = scores.pop("flat", None)
        if broken:
            farthest = float(true.max(initial=0.0))
            scores = {name: metric(name).worst(farthest) for name in scores}
        alignment = protocol.alignment or scored_alignment(predicted.kind, predicted.alignment)
        scores |= _guesses(replace(protocol, alignment=alignment), mask, true)
        if flat is not None:
            scores[f"{FLAT}relative_normal_degrees"] = flat
        found |= {(protocol.name, name): value for name, value in scores.items()}
        found[protocol.name, PIXELS] = len(true)
    return found


def _guesses(protocol: Protocol, mask: Array, true: Array) -> dict[str, float]:
    """Return the headline of guesses that see no picture, under a protocol with its alignment.

    One has the same depth everywhere, the other comes nearer evenly from the upper to the lower
    edge, to half its depth. Where nothing is fitted to the truth, they are, by scale and shift;
    where L1 fits, least squares do, as exact lines in L1 take several times as long.
    """
    squares: dict[str | None, Alignment] = {
        "none": "scale_shift", "scale_l1": "scale", "scale_shift_l1": "scale_shift",
    }  # fmt: skip
    if protocol.alignment in squares:
        protocol = replace(protocol, alignment=squares[protocol.alignment])
    disparity = protocol.alignment == "disparity_scale_shift"
    down = (np.nonzero(mask)[0] + 0.5) / len(mask)
    ramp = 1.0 + down if disparity else 2.0 - down
    scores = dict[str, float]()
    for guess, values in ((FLAT, np.ones_like(down)), (RAMP, ramp)):
        kind = "disparity" if disparity else "depth"
        fitted = depth_scores(depth_under(protocol, kind, "none", values, true))
        scores |= {guess + name: fitted[name] for name in _GUESSED}
    return scores


def depth_as_declared(predicted: PredictedView, truth: MeasuredView) -> Array:
    """Return planar depth (H, W) under "declared", for pictures; NaN where one of both is none."""
    rays = np.full((*truth.depth.shape, 3), -1.0) if truth.rays is None else truth.rays
    return np.asarray(-points_as_declared(predicted, truth.depth, rays)[..., 2])


def points_as_declared(predicted: PredictedView, true_depth: Array, rays: Array) -> Array:
    """Return points (H, W, 3) under "declared", for pictures; NaN where one of both is none."""
    height, width = true_depth.shape
    values, points = predicted.geometry[:height, :width], np.full(rays.shape, np.nan)
    known = np.isfinite(true_depth) & np.isfinite(values.reshape(height, width, -1)).all(axis=-1)
    if known.any():
        true = true_depth[known].astype(np.float64)
        if predicted.kind == "points":
            there, where = values[known].astype(np.float64), rays[known] * true[:, None]
            points[known] = align_points(there, where, predicted.alignment)
        else:
            pair = depth_under(DECLARED, predicted.kind, predicted.alignment, values[known], true)
            points[known] = rays[known] * pair.predicted[:, None]
    return points


def _usable(
    predicted: PredictedView, truth: MeasuredView, penalise: bool
) -> tuple[Array, Array | None, bool]:
    """Return geometry and normals in the size of the truth, and whether they broke a rule.

    Then the truth stands in their place, to tell which scores there are. Raises PredictionError.
    """
    height, width = truth.depth.shape
    geometry = predicted.geometry[:height, :width]
    normal = None if predicted.normal is None else predicted.normal[:height, :width]
    broken = False
    sure = None if predicted.confidence is None else predicted.confidence[:height, :width]
    for name, values in ((predicted.kind, geometry), ("normal", normal), ("confidence", sure)):
        if values is not None and penalise:
            against = Against(surface=truth.mask)
            broken |= next(broken_rules(name, values, against), None) is not None
        elif values is not None:
            refuse_pixels(PredictionError, f"predicted {name}", name, values, truth.mask)
    if broken:
        geometry = _perfect(truth, predicted.kind)
        normal = None if normal is None else np.full_like(normal, (0.0, 0.0, 1.0))
    return geometry, normal, broken


def _further(
    predicted: PredictedView,
    normal: Array | None,
    truth: MeasuredView,
    pair: DepthPair,
    points: Array | None,
    dense: bool,
    row: int,
) -> dict[str, float]:
    """Return what is scored beside depth: other alignments, boundaries, pairs and normals."""
    scores, mask = dict[str, float](), truth.mask
    own = scored_alignment(predicted.kind, predicted.alignment)
    for after in alignments_scored(predicted.kind, predicted.alignment):
        aligned = after == own and predicted.kind != "points"
        scores |= depth_scores(pair, after, aligned)
    if dense:
        fitted = np.full(truth.depth.shape, np.nan)
        fitted[mask] = pair.predicted
        scores |= boundary_scores(fitted, truth.depth, mask)
        order = ordered_pairs(truth.depth, mask, row)
        if points is not None and truth.rays is not None:
            image = np.full(truth.rays.shape, np.nan)
            image[mask] = truth.rays[mask] * truth.depth[mask, None].astype(np.float64)
            pairs = triangle_pairs(image, mask, row)
            scores["flat"] = relative_normal_scores(image, pairs)["flat"]
            image[mask] = points
            found = scores_of_pairs(pair, scores["boundary_f1"], fitted, image, pairs, order)
            scores |= {n: value for n, value in found.items() if "measured" in metric(n).tasks}
        else:
            scores["ordinal_accuracy"] = ordinal_scores(fitted, order)["ordinal_accuracy"]
    if normal is not None and truth.normal is not None:
        shown = mask & truth.normal.any(axis=-1)
        angles = np.zeros(0)
        if shown.any():
            angles = angular_errors_degrees(normal, truth.normal, shown)
        scores |= normal_scores(angles)
    return scores


def _perfect(truth: MeasuredView, kind: str) -> Array:
    depth = np.where(truth.mask, truth.depth, 1.0).astype(np.float64)
    if kind == "points":
        return np.stack([np.zeros_like(depth), np.zeros_like(depth), -depth], axis=-1)
    return 1.0 / depth if kind == "disparity" else depth

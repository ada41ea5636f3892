"""Scores of layers of one image: predicted surfaces along its rays against all true ones."""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import scale_and_shift
from metrics.measures.hidden import solids
from metrics.measures.surfaces import whole
from metrics.measures.surfaces.chamfer_hausdorff import chamfer, nearest_distances
from metrics.scoring.metric_names import CONSTANT, INFLATED, MIRRORED, SIZED, metric
from metrics.scoring.truth_digests import LAYERS
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.rules import refuse_pixels
from metrics.submissions.truths import TrueView
from scenegen.camera import pixel_directions, pixel_size
from scenegen.common.errors import SceneGenError
from scenegen.files.content import row_digest
from scenegen.rooms.reader import RoomsFile

Array = NDArray[np.float64]
MOST_RAYS = 2**14  # whose points are compared


@dataclass(frozen=True, eq=False)
class TrueLayers:
    """The true layers of the N pixels of an image that are scored.

    Those are the pixels with a depth whose ray meets no object without inside.

    Attributes:
        scored: these pixels, (H, W).
        rays: their directions in the camera frame, (N, 3); z is -1.
        pixel: side of a pixel at depth 1.
        round: as `solids.round_bodies`, (N,).
        depth, object_id, entering: (L, N), as stored.
        digests: of the three as they were read.
    """

    scored: NDArray[np.bool_]
    rays: Array
    pixel: float
    round: Array
    depth: Array
    object_id: NDArray[np.int8]
    entering: NDArray[np.int8]
    digests: tuple[bytes, ...]

    @cached_property
    def spans(self) -> solids.Spans:
        """Where rays are inside of objects."""
        return solids.entered_spans(self.depth, self.entering)

    @cached_property
    def visible(self) -> solids.Spans:
        """The first spans of those rays that begin with them."""
        first = self.spans[0][0] == self.depth[0]
        start, end = (np.where(first, ends[:1], np.inf) for ends in self.spans)
        return start, end

    @property
    def shows_solids(self) -> bool:
        """Whether any ray first meets a solid."""
        return bool(np.isfinite(self.visible[1]).any())

    def iou(self, predicted: solids.Spans) -> float:
        """Return `solid_iou` of spans."""
        return solids.solid_iou(predicted, self.spans, self.stretch)

    @cached_property
    def stretch(self) -> Array:
        """Lengths of the rays' directions, (N,)."""
        return np.asarray(np.sqrt(np.square(self.rays).sum(axis=1)))

    def floors(self) -> dict[str, float]:
        """Return what guesses score that know masks and fronts, by name."""
        names = [f"{begins}solid_iou" for begins in (CONSTANT, SIZED, INFLATED, MIRRORED)]
        if not self.shows_solids:
            return dict.fromkeys(names, np.nan)
        at = (self.object_id[0] > 0) | np.isfinite(self.spans[1][0])
        front, ids, stretch = self.depth[0, at], self.object_id[0, at], self.stretch[at]
        spans = self.spans[0][:, at], self.spans[1][:, at]
        with np.errstate(invalid="ignore"):
            thickness = (self.visible[1] - self.visible[0])[0, at]
        pixels = np.bincount(ids[ids > 0], minlength=128)[np.maximum(ids, 0)]
        units = [np.ones_like(front), np.sqrt(pixels) * self.pixel * front]
        units.append(self.round[at] * self.pixel * front)
        score = partial(solids.solid_iou, true=spans, stretch=stretch)
        scores = solids.shortcuts(front, ids, score, thickness, units)
        return dict(zip(names, scores, strict=True))


def read_true_layers(truth: RoomsFile, row: int, view: TrueView) -> TrueLayers:
    """Return the true layers of a row. Raises FileFormatError."""
    stored = depth, ids, entering = [truth.read(name, row) for name in LAYERS]
    digests = tuple(map(row_digest, stored))
    scored = view.mask & ~((ids > 0) & (entering == 0)).any(axis=-1)
    layers = depth[scored].T.astype(np.float64), ids[scored].T, entering[scored].T
    height, width = scored.shape
    rays = pixel_directions(height, width, view.lens)[scored]
    pixel, bodies = pixel_size(len(scored), view.lens), solids.round_bodies(view.object_id)
    return TrueLayers(scored, rays, pixel, bodies[scored], *layers, digests)


def true_points(truth: RoomsFile, row: int) -> list[NDArray[Any]] | None:
    """Return two draws of points of a row's objects, camera frame; None without their meshes."""
    from scenegen.objects.catalogue import objects_of
    from scenegen.objects.scene_mesh import world_from_object

    try:
        objects = objects_of(truth.spec)
    except SceneGenError:  # meshes of a folder
        return None
    room, meshes = truth[row], []
    for item in room.scene.objects:
        pose = world_from_object(item.position, item.rotation, item.scale)
        corners = objects.shape(item.shape).triangles.reshape(-1, 3)
        meshes.append(corners @ pose[:3, :3].T + pose[:3, 3] - room.world_from_camera[:3, 3])
    if not meshes:
        return None
    triangles = (np.concatenate(meshes) @ room.world_from_camera[:3, :3]).reshape(-1, 3, 3)
    return [whole.drawn_points(triangles, row, draw) for draw in whole.DRAWS[1:]]


def score_layers(
    predicted: PredictedView, truth: TrueLayers, surfaces: list[NDArray[Any]] | None = None
) -> dict[str, float]:
    """Return every score of predicted layers (H, W, L), fitted to the visible surfaces of objects.

    `surfaces` are `true_points`. Scores are NaN where no solid is visible. Raises PredictionError
    where a scored pixel breaks `submissions.rules`.
    """
    refuse_pixels(PredictionError, "predicted layers", "layers", predicted.geometry, truth.scored)
    layers = fitted_layers(predicted, truth)[truth.scored].T
    points = predicted.surface_points
    if points is not None:
        where = "predicted points"
        refuse_pixels(PredictionError, where, "surface_points", points, truth.scored)
        scale, shift = _fit(predicted, truth)
        depth = np.where(points[:, 2:] < 0, -points[:, 2:], np.inf)
        points = points * (scale + shift / depth)
    layers = layers[: max(2, np.isfinite(layers).any(axis=1).sum())]
    of_objects = truth.object_id > 0
    spans = solids.paired_spans(layers)
    scores = {
        "solid_iou": truth.iou(spans),
        "back_depth_error": solids.back_depth_error(spans, truth.visible),
        **solids.layer_recalls(layers, truth.depth, of_objects),
        "hidden_object_recall": solids.hidden_object_recall(
            spans, truth.spans, truth.depth, truth.object_id
        ),
    }
    scores |= whole.surface_scores(points, surfaces)
    fronts_and_backs = np.stack(spans, axis=1).reshape(-1, layers.shape[1])
    for name, which in (("seen_chamfer", np.s_[:1]), ("unseen_chamfer", np.s_[1:])):
        true = _points(truth, np.where(of_objects, truth.depth, np.inf)[which])
        found = _points(truth, fronts_and_backs[which])
        found = found if len(found) else _points(truth, layers[:1])
        both = len(true) and len(found)
        distance = chamfer(nearest_distances(found, true)) if both else np.inf
        scores[name] = min(distance, metric(name).worst())
    return scores if truth.shows_solids else dict.fromkeys(scores, np.nan)


def fitted_layers(predicted: PredictedView, truth: TrueLayers) -> Array:
    """Return layers (H, W, L) after the declared alignment of the first to visible objects."""
    scale, shift = _fit(predicted, truth)
    return np.asarray(scale * predicted.geometry + shift)


def _fit(predicted: PredictedView, truth: TrueLayers) -> tuple[float, float]:
    """Return the scale and the shift of depth that the declared alignment allows."""
    first = predicted.geometry[truth.scored, 0]
    seen = np.isfinite(first) & (truth.object_id[0] > 0)
    return scale_and_shift(first[seen], truth.depth[0, seen], predicted.alignment)


def worst_of_layers(
    predicted: PredictedView, truth: TrueLayers, surfaces: list[NDArray[Any]] | None = None
) -> dict[str, float]:
    """Return the worst value of each score that an image has."""
    points = None if predicted.surface_points is None else np.full((1, 3), -1.0)
    empty = np.full((*truth.scored.shape, 2), np.nan)
    nothing = replace(predicted, geometry=empty, alignment="none", surface_points=points)
    scores = score_layers(nothing, truth, surfaces)
    return {x: value if np.isnan(value) else metric(x).worst() for x, value in scores.items()}


def _points(truth: TrueLayers, depth: Array) -> Array:
    """Return the points of layers (K, N) that are finite, of every second, third, ... ray."""
    some = np.s_[:: max(1, -(-len(truth.rays) // MOST_RAYS))]
    layer, ray = np.nonzero(np.isfinite(depth[:, some]))
    return np.asarray(truth.rays[some][ray] * depth[:, some][layer, ray, None])

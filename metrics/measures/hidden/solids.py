"""Scores of solids: how far rays are inside of objects, where they leave, and hidden surfaces.

Layers are planar depths of the surfaces along N rays, in order, (L, N); NaN behind the last one.
Spans are where rays enter and leave solids, (S, N) each; both infinite behind the last one.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Spans = tuple[Array, Array]
NEAR = 0.02  # scene units: within which a layer counts as found
SHARES = np.linspace(0.0, 1.0, 12)[1:]  # quantiles of thickness that shortcuts try
HIDDEN = (2, 3, 4)  # layers that have a recall of their own
SEEN_SHARE = 0.01  # of the rays that meet an object; objects that fewer meet first are hidden
LEAST_RAYS = 16  # that meet an object


def paired_spans(layers: Array) -> Spans:
    """Return the spans of predicted layers: 1 to 2, 3 to 4, ...; one that is left over is none."""
    pairs = len(layers) // 2
    start, end = layers[: 2 * pairs : 2], layers[1 : 2 * pairs : 2]
    there = np.isfinite(end)
    return np.where(there, start, np.inf), np.where(there, end, np.inf)


def entered_spans(depth: Array, entering: Array) -> Spans:
    """Return the spans in which rays are inside any object.

    Args:
        depth: of all layers, (L, N).
        entering: 1 where the ray enters an object, -1 where it leaves, else 0, (L, N).
    """
    entered = np.flatnonzero((entering != 0).any(axis=0))
    inside = np.cumsum(entering[:, entered], axis=0, dtype=np.int8) > 0
    # What is not left within the layers ends at the last one.
    inside[-1] = False
    before = np.concatenate([np.zeros_like(inside[:1]), inside[:-1]])
    most = int((inside & ~before).sum(axis=0).max(initial=1))
    known = np.fmax.accumulate(depth[:, entered], axis=0)

    def at(mask: Array) -> Array:
        values = np.full((max(most, 1), depth.shape[1]), np.inf)
        number = np.cumsum(mask, axis=0) - 1
        values[number[mask], entered[np.nonzero(mask)[1]]] = known[mask]
        return values

    return at(inside & ~before), at(before & ~inside)


def overlap(a: Spans, b: Spans) -> Array:
    """Return the length of each ray that is in both, (N,)."""
    total = np.zeros(a[0].shape[1])
    with np.errstate(invalid="ignore"):
        for start, end in zip(*a, strict=True):
            for other, last in zip(*b, strict=True):
                total += np.fmax(np.minimum(end, last) - np.maximum(start, other), 0.0)
    return total


def length(spans: Spans) -> Array:
    """Return the length of each ray that is in spans, (N,)."""
    there = np.isfinite(spans[1])
    return np.asarray(np.where(there, spans[1] - np.where(there, spans[0], 0.0), 0.0).sum(axis=0))


def solid_iou(predicted: Spans, true: Spans, stretch: Array) -> float:
    """Return the length inside both over that inside either, of all rays; NaN where none is.

    `stretch`, (N,), is the length of each ray's direction, whose planar depth is 1.
    """
    enters = np.isfinite(true[1][0])
    enters |= np.isfinite(predicted[1]).any(axis=0)
    (a, b), stretch = ((x[:, enters], y[:, enters]) for x, y in (predicted, true)), stretch[enters]
    both = float((overlap(a, b) * stretch).sum())
    either = float(((length(a) + length(b)) * stretch).sum()) - both
    return both / either if either > 0.0 else np.nan


def back_depth_error(predicted: Spans, true: Spans) -> float:
    """Return the mean error of where rays leave the first solid, of rays that enter one.

    The error of rays without a predicted solid is the true thickness.
    """
    enters = np.isfinite(true[1][0])
    front, back = true[0][0][enters], true[1][0][enters]
    found = predicted[1][0][enters] if len(predicted[1]) else np.full(len(back), np.inf)
    errors = np.abs(np.where(np.isfinite(found), found, front) - back)
    return float(errors.mean()) if len(errors) else np.nan


def layer_recalls(predicted: Array, true: Array, of_objects: Array) -> dict[str, float]:
    """Return the fraction of true layers behind the first whose predicted layer is within NEAR.

    Layers with the same number are compared. `of_objects` tells which are surfaces of objects,
    (L, N); the others do not count.
    """
    both = min(len(predicted), len(true))
    found = np.zeros(true.shape, bool)
    with np.errstate(invalid="ignore"):
        found[:both] = np.abs(predicted[:both] - true[:both]) <= NEAR
    scores = {f"layer_recall_{NEAR:g}": _share(found[1:], of_objects[1:])}
    for number in HIDDEN:
        here = np.s_[number - 1 : number]
        scores[f"layer_{number}_recall_{NEAR:g}"] = _share(found[here], of_objects[here])
    return scores


def hidden_object_recall(predicted: Spans, true: Spans, depth: Array, object_id: Array) -> float:
    """Return the fraction of hidden objects that are predicted; NaN where none is hidden.

    Such an object begins a true span on at least LEAST_RAYS rays, and is the first layer of less
    than SEEN_SHARE of the rays that meet it. It counts as predicted if half of those rays have a
    predicted span whose IoU with the first true span that the object begins is above 0.5.

    Args:
        predicted, true: spans of N rays.
        depth, object_id: of all layers, (L, N).
    """
    recalled = []
    for number in np.unique(object_id[object_id > 0]).tolist():
        of_object = object_id == number
        first = np.where(of_object, depth, np.inf).min(axis=0)
        begins = np.isfinite(first) & (true[0] == first)
        rays = begins.any(axis=0)
        if rays.sum() < LEAST_RAYS or of_object[0].sum() >= SEEN_SHARE * np.isfinite(first).sum():
            continue
        start, end = first[rays], true[1].T[begins.T]
        a, b = predicted[0][:, rays], predicted[1][:, rays]
        with np.errstate(invalid="ignore"):
            both = np.minimum(b, end) - np.maximum(a, start)
            either = np.maximum(b, end) - np.minimum(a, start)
        recalled.append((both > 0.5 * either).any(axis=0).mean() >= 0.5)
    return float(np.mean(recalled)) if recalled else np.nan


def _share(found: Array, counted: Array) -> float:
    return float(found[counted].mean()) if counted.any() else np.nan


def round_bodies(object_id: Array) -> Array:
    """Return the thickness of bodies that are round over the masks of ids above 0, pixels, (H, W).

    That is 2 sqrt(e (2 r - e)), where e is the distance of a pixel from the border of its mask, and
    r the largest one in the mask.
    """
    from scipy.ndimage import distance_transform_edt, find_objects

    thickness = np.zeros(object_id.shape)
    for k, place in enumerate(find_objects(np.maximum(object_id, 0)), start=1):
        if place is not None:
            own = object_id[place] == k
            inner = distance_transform_edt(np.pad(own, 1))[1:-1, 1:-1]
            body = 2.0 * np.sqrt(inner * (2.0 * inner.max() - inner))
            thickness[place] = np.where(own, body, thickness[place])
    return thickness


def shortcuts(
    front: Array,
    object_id: Array,
    score: Callable[[Spans], float],
    thickness: Array,
    units: Sequence[Array],
) -> list[float]:
    """Return the `solid_iou` of guesses that know each object's mask and front, and no shape.

    They are thicknesses proportional to each of the units, (N,), and the mirrored front.

    Args:
        front: true depth of the first layer, (N,).
        object_id: whose it is; above 0 for objects, (N,).
        score: of spans.
        thickness: true length of the first span in planar depth, (N,); NaN where there is none.
        units: what a thickness may be proportional to, (N,) each.
    """
    objects = object_id > 0
    mirror = np.full(len(front), np.nan)
    for number in np.unique(object_id[objects]).tolist():
        own = object_id == number
        mirror[own] = 2.0 * (front[own].max() - front[own])

    def best(unit: Array) -> float:
        """Return the score of the best factor of a thickness, which the truth chooses."""
        with np.errstate(invalid="ignore", divide="ignore"):
            factors = (thickness / unit)[objects]
        factors = factors[np.isfinite(factors)]
        if not len(factors):
            return 0.0
        return max(score(_slab(front, objects, f * unit)) for f in np.quantile(factors, SHARES))

    mirrored = score(_slab(front, objects, mirror))
    return [*map(best, units), mirrored]


def _slab(front: Array, objects: Array, thickness: Array) -> Spans:
    there = objects & np.isfinite(thickness)
    start = np.where(there, front, np.inf)
    return start[None], np.where(there, front + np.where(there, thickness, 0.0), np.inf)[None]

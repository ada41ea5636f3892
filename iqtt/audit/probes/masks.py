"""2D rules for questions about rooms that are given the true mask of each object.

Each rule compares masks of the reference with those of an option, and knows which object differs.
None knows depth or how cameras moved. So they are stronger than rules on pixels, and bound what can
be reached without 3D.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.proofs.rooms import with_carried
from iqtt.audit.table import AuditTable
from iqtt.perspective.columns import RoomTruth
from scenegen.common.errors import SceneGenError
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
LEAST = 4  # pixels of a mask that is compared
RULES = (
    *("same place", "size", "IoU of masks", "IoU of centred masks", "equal ids"),
    *("order from left to right", "order from top to bottom", "order of distances"),
    *("map of the two nearest", "affine map of centres", "affine map of feet"),
    "homography of feet",
)


def costs_of_masks(table: AuditTable, rows: Array) -> Array:
    """Return `mask_costs` of rows of a table about rooms, (N, K, len(RULES)); 0 without scenes.

    Rays are cast again from the scenes.
    """
    costs = np.zeros((len(rows), table.images - 1, len(RULES)))
    for i, row in enumerate(rows.tolist()):
        with suppress(SceneGenError):
            truth = table.questions.truth(row)
            assert isinstance(truth, RoomTruth)
            inside = truth.scenes[0].interior
            if inside is None:
                continue
            batch = pack(table.spec.interior(), truth.scenes)
            ids = launch_fields(batch, ["object_id"])()["object_id"]
            moving = with_carried(inside.stands_on, truth.in_play)
            costs[i] = mask_costs(ids, truth.in_play, sorted(moving))
    return costs


def mask_costs(ids: Array, in_play: int, moving: Sequence[int]) -> Array:
    """Return how much each option differs from the reference by RULES, (K, len(RULES)).

    Args:
        ids: objects that the reference and K options show, (1 + K, H, W), from 1.
        in_play: number of the object that differs.
        moving: numbers of this object and of what it carries, which no map is fitted to.
    """
    ids = np.maximum(ids, 0)  # the room, and what is outside
    most = max(int(ids.max()), *moving) + 1
    measured = [_measured(image, most) for image in ids]
    (area, centres, feet), *options = measured
    costs = np.zeros((len(options), len(RULES)))
    for k, (size, middles, ends) in enumerate(options):
        seen = (area >= LEAST) & (size >= LEAST)
        seen[[0, *moving]] = False
        fixed = np.flatnonzero(seen)
        here, there, foot, end = (x[in_play] for x in (centres, middles, feet, ends))
        masks = ids[0] == in_play, ids[1 + k] == in_play
        costs[k] = (
            math.dist(here, there),
            abs(math.log(max(area[in_play], 1) / max(size[in_play], 1))),
            -_iou(*masks),
            -_iou(*map(_centred, masks)),
            -np.mean(ids[0] == ids[1 + k]),
            _inversions(centres[fixed, 0] - here[0], middles[fixed, 0] - there[0]),
            _inversions(feet[fixed, 1] - foot[1], ends[fixed, 1] - end[1]),
            -_agreement(centres[fixed] - here, middles[fixed] - there),
            math.dist(_local_map(centres[fixed], middles[fixed], here), there),
            math.dist(_affine(centres[fixed], middles[fixed], here), there),
            math.dist(_affine(feet[fixed], ends[fixed], foot), end),
            math.dist(_homography(feet[fixed], ends[fixed], foot), end),
        )
    return costs


def _measured(image: Array, most: int) -> tuple[Array, Array, Array]:
    """Return pixels, centre and foot of each object's mask: (N,), (N, 2), (N, 2)."""
    rows, columns = np.indices(image.shape)
    flat = image.ravel()
    area = np.bincount(flat, minlength=most).astype(float)
    some = np.maximum(area, 1)
    x, y = (np.bincount(flat, v.ravel(), most) / some for v in (columns, rows))
    lowest = np.zeros(most)
    np.maximum.at(lowest, flat, rows.ravel())
    return area, np.stack([x, y], axis=1), np.stack([x, lowest], axis=1)


def _iou(a: Array, b: Array) -> float:
    return float((a & b).sum() / max((a | b).sum(), 1))


def _centred(mask: Array) -> Array:
    """Return a mask moved to the middle of its image; what leaves it comes in on the other side."""
    y, x = (int(v.mean()) if len(v) else 0 for v in np.nonzero(mask))
    return np.roll(mask, (mask.shape[0] // 2 - y, mask.shape[1] // 2 - x), (0, 1))


def _inversions(before: Array, after: Array) -> float:
    """Return the share of other objects that are on the other side of the object in play."""
    return float(np.mean(before * after < 0)) if len(before) else 0.0


def _agreement(before: Array, after: Array) -> float:
    """Return the rank correlation of the distances to other objects."""
    if len(before) < 3:
        return 0.0
    first, second = (np.argsort(np.argsort(np.linalg.norm(x, axis=1))) for x in (before, after))
    return float(np.corrcoef(first, second)[0, 1])


def _local_map(source: Array, target: Array, point: Array) -> Array:
    """Return where a point is if it moves as the two objects next to it do."""
    near = np.argsort(np.linalg.norm(source - point, axis=1))[:2]
    return point + (target[near] - source[near]).mean(axis=0) if len(near) else point


def _affine(source: Array, target: Array, point: Array) -> Array:
    """Return a point moved by the affine map of least squares; a translation for fewer than 3."""
    if len(source) < 3:
        return point + (target - source).mean(axis=0) if len(source) else point
    ones = np.ones((len(source), 1))
    fit = np.linalg.lstsq(np.hstack([source, ones]), target, rcond=1e-6)[0]
    return np.asarray(np.append(point, 1) @ fit)


def _homography(source: Array, target: Array, point: Array) -> Array:
    """Return a point moved by the homography of least algebraic error; affine for fewer than 5."""
    if len(source) < 5:
        return _affine(source, target, point)
    middle, scale = source.mean(axis=0), max(float(np.ptp(source)), 1.0)
    (x, y), (u, v) = ((s - middle).T / scale for s in (source, target))
    one, none = np.ones_like(x), np.zeros_like(x)
    rows = np.concatenate([
        np.stack([x, y, one, none, none, none, -u * x, -u * y, -u], axis=1),
        np.stack([none, none, none, x, y, one, -v * x, -v * y, -v], axis=1),
    ])  # fmt: skip
    fit = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    moved = fit @ np.append((point - middle) / scale, 1)
    return np.asarray(moved[:2] / (moved[2] or 1e-9) * scale + middle)

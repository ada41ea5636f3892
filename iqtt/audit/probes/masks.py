"""2D rules for questions about rooms that are given the true mask of each object.

Each rule compares masks of the reference with those of an option, and knows which objects differ.
None knows depth or how cameras moved. So they are stronger than rules on pixels, and bound what can
be reached without 3D.
"""

import itertools
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
            assert truth.scenes[0].interior
            batch = pack(table.spec.interior(), truth.scenes)
            ids = launch_fields(batch, ["object_id"])()["object_id"]
            moving = with_carried(truth.scenes[0].interior.stands_on, truth.in_play)
            costs[i] = mask_costs(ids, np.array(truth.in_play), np.array(sorted(moving)))
    return costs


def mask_costs(ids: Array, in_play: Array, moving: Array) -> Array:
    """Return how much each option differs from the reference by RULES, (K, len(RULES)).

    Args:
        ids: objects that the reference and K options show, (1 + K, H, W), from 1.
        in_play: numbers of the objects that differ.
        moving: numbers of these, and of what they carry, which no map is fitted to.
    """
    ids = np.maximum(ids, 0)  # the room, and what is outside
    most = max(int(ids.max()), *in_play) + 1
    measured = [_measured(image, most) for image in ids]
    (area, centres, feet), *options = measured
    costs = np.zeros((len(options), len(RULES)))
    for k, (size, middles, ends) in enumerate(options):
        seen = (area >= LEAST) & (size >= LEAST)
        seen[[0, *moving]] = False
        fixed = np.flatnonzero(seen)
        here, there, foot, end = (x[in_play] for x in (centres, middles, feet, ends))
        shown = [(ids[0] == n, ids[1 + k] == n) for n in in_play]
        costs[k] = (
            np.linalg.norm(here - there, axis=1).sum(),
            np.abs(np.log(area[in_play] / size[in_play])).sum(),
            -sum(_iou(a, b) for a, b in shown),
            -sum(_iou(_centred(a), _centred(b)) for a, b in shown),
            -np.mean(ids[0] == ids[1 + k]),
            _inversions(centres[:, 0], middles[:, 0], in_play, fixed),
            _inversions(feet[:, 1], ends[:, 1], in_play, fixed),
            -_agreement(centres, middles, in_play, fixed),
            _off(_local_map(centres, middles, in_play, fixed), there),
            _off(_affine(centres[fixed], middles[fixed], here), there),
            _off(_affine(feet[fixed], ends[fixed], foot), end),
            _off(_homography(feet[fixed], ends[fixed], foot), end),
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


def _inversions(before: Array, after: Array, in_play: Array, fixed: Array) -> float:
    """Return the share of pairs with an object in play whose order along an axis differs."""
    pairs = [(a, b) for a in in_play for b in fixed]
    pairs += [*itertools.combinations(in_play, 2)]
    changed = [(before[a] - before[b]) * (after[a] - after[b]) < 0 for a, b in pairs]
    return float(np.mean(changed)) if pairs else 0.0


def _agreement(before: Array, after: Array, in_play: Array, fixed: Array) -> float:
    """Return the rank correlation of the distances from objects in play to the others."""
    total = 0.0
    for n in in_play if len(fixed) > 2 else ():
        first, second = (
            np.argsort(np.argsort(np.linalg.norm(centres[fixed] - centres[n], axis=1)))
            for centres in (before, after)
        )
        total += np.corrcoef(first, second)[0, 1]
    return total


def _off(mapped: Array, there: Array) -> float:
    return float(np.linalg.norm(mapped - there, axis=1).sum())


def _local_map(before: Array, after: Array, in_play: Array, fixed: Array) -> Array:
    """Return where objects in play are if they move as the two objects next to each do."""
    found = before[in_play].copy()
    for i, n in enumerate(in_play if len(fixed) else ()):
        near = np.argsort(np.linalg.norm(before[fixed] - before[n], axis=1))[:2]
        found[i] += (after[fixed][near] - before[fixed][near]).mean(axis=0)
    return found


def _affine(source: Array, target: Array, points: Array) -> Array:
    """Return points moved by the affine map of least squares; a translation for fewer than 3."""
    if len(source) < 3:
        return points + (target - source).mean(axis=0) if len(source) else points
    ones = np.ones((len(source), 1))
    fit = np.linalg.lstsq(np.hstack([source, ones]), target, rcond=1e-6)[0]
    return np.asarray(np.hstack([points, np.ones((len(points), 1))]) @ fit)


def _homography(source: Array, target: Array, points: Array) -> Array:
    """Return points moved by the homography of least algebraic error; affine for fewer than 5."""
    if len(source) < 5:
        return _affine(source, target, points)
    middle, scale = source.mean(axis=0), max(float(np.ptp(source)), 1.0)
    (x, y), (u, v) = ((s - middle).T / scale for s in (source, target))
    one, none = np.ones_like(x), np.zeros_like(x)
    rows = np.concatenate([
        np.stack([x, y, one, none, none, none, -u * x, -u * y, -u], axis=1),
        np.stack([none, none, none, x, y, one, -v * x, -v * y, -v], axis=1),
    ])  # fmt: skip
    turned = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    moved = np.hstack([(points - middle) / scale, np.ones((len(points), 1))]) @ turned.T
    depth = np.where(np.abs(moved[:, 2:]) < 1e-9, 1e-9, moved[:, 2:])
    return np.asarray(moved[:, :2] / depth * scale + middle)

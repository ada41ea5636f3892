"""Rotations of the lattice by the directions of outlines: edges run along three axes."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from scenegen.common.rotations import rotation_matrix

Array = NDArray[Any]
ROTATIONS = 24_000  # of the first grid
COARSE = 200  # pixels of outlines that they are judged by
KEPT = 60  # rotations that are refined, with their twins
REFINED = 40  # of them that are refined to the end
CAP = 0.04  # squared sine beyond which an error counts no more
KERNEL = (0.0625, 0.25, 0.375, 0.25, 0.0625)  # smooths labels
TANGENT = 0.15  # cosine below which either face of an axis may show


def outline_pixels(labels: Array, half: float) -> Array:
    """Return x, y, tangent x, tangent y and label seen against the background (0 for inner
    outlines) of the pixels of outlines, (B, 5) float64.

    Args:
        half: tangent of half the vertical field of view.
    """
    height, width = labels.shape
    padded = np.pad(labels, 4)
    masks = np.stack([_smooth((padded == k).astype(np.float64)) for k in range(4)])
    dy, dx = np.gradient(masks, axis=(1, 2))
    xx, yy, xy = (_smooth(t.sum(axis=0)) for t in (dx * dx, dy * dy, dx * dy))
    xx, yy, xy = (t[4:-4, 4:-4] for t in (xx, yy, xy))
    strength = np.hypot(xx - yy, 2 * xy)
    coherent = strength > 0.9 * (xx + yy)
    edge = np.zeros(labels.shape, bool)
    other = np.zeros(labels.shape, np.int8)
    for axis in (0, 1):
        first = labels[:-1] if axis == 0 else labels[:, :-1]
        second = labels[1:] if axis == 0 else labels[:, 1:]
        differ = first != second
        front, back = (edge[:-1], edge[1:]) if axis == 0 else (edge[:, :-1], edge[:, 1:])
        front |= differ
        back |= differ
        bare = differ & ((first == 0) | (second == 0))
        label = np.where(bare, np.maximum(first, second), 0)
        near = (other[:-1], other[1:]) if axis == 0 else (other[:, :-1], other[:, 1:])
        for part in near:
            np.maximum(part, label, out=part)
    rows, columns = np.nonzero(edge & coherent & (strength > 1e-6))
    normal = 0.5 * np.arctan2(2 * xy, xx - yy)[rows, columns]
    x = (2 * (columns + 0.5) - width) / height * half
    y = -(2 * (rows + 0.5) - height) / height * half
    # The normal is (cos, sin) in rows that run downwards; the tangent is across it.
    return np.stack(
        [x, y, np.sin(normal), np.cos(normal), other[rows, columns].astype(float)], axis=1
    )


def likely_poses(outlines: Array, most: int, rng: np.random.Generator) -> list[Array]:
    """Return at most `most` orthogonal matrices, best first: columns are the outward normals, in
    the camera's frame, of the faces with labels 1, 2 and 3. Their determinant may be -1.
    """
    if len(outlines) < 12:
        return []
    grid = _rotations(rng.standard_normal((ROTATIONS, 4)))
    part = outlines[rng.permutation(len(outlines))[:COARSE]]
    costs = _costs(grid, part)
    chosen = grid[np.argsort(costs, kind="stable")[:KEPT]]
    twins = chosen.copy()
    twins[:, 2] *= -1  # depth reversed
    chosen = np.concatenate([chosen, twins])
    for angle in (0.06, 0.03, 0.015, 0.008, 0.004, 0.002):
        if angle < 0.01:
            chosen = chosen[np.argsort(_costs(chosen, outlines), kind="stable")[:REFINED]]
        for _ in range(4):
            turns = _rotations(
                np.concatenate([np.ones((12, 1)), rng.standard_normal((12, 3)) * angle / 2], axis=1)
            )
            turns[0] = np.eye(3)
            tried = (turns[:, None] @ chosen).reshape(-1, 3, 3)
            best = _costs(tried, part if angle > 0.01 else outlines).reshape(12, -1).argmin(axis=0)
            chosen = tried.reshape(12, -1, 3, 3)[best, np.arange(len(chosen))]
    costs = _costs(chosen, outlines)
    poses: list[Array] = []
    for i in np.argsort(costs, kind="stable"):
        pose = chosen[i] * np.where(chosen[i][2] < 0, -1.0, 1.0)
        if costs[i] > costs.min() + 0.25 * CAP or len(poses) >= most:
            break
        # Traces of the products of unlike rotations are small.
        if all((pose * p).sum() < 3 - 0.002 for p in poses):
            poses.append(pose)
    for pose in poses[:4]:
        tangent = np.flatnonzero(pose[2] < TANGENT)
        poses.extend(pose * np.where(np.arange(3) == axis, -1.0, 1.0) for axis in tangent)
    return poses


def _rotations(quaternions: Array) -> Array:
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.ascontiguousarray(rotation_matrix((quaternions / lengths).T))


def _smooth(image: Array) -> Array:
    for axis in (0, 1):
        image = convolve1d(image, KERNEL, axis, mode="constant")
    return image


@njit(cache=True)
def _costs(poses: Array, outlines: Array) -> Array:
    """Return the mean capped squared sine between outlines and the nearest allowed axis, (P,)."""
    result = np.empty(len(poses))
    for p in range(len(poses)):
        total = 0.0
        for b in range(len(outlines)):
            x, y, tx, ty = outlines[b, 0], outlines[b, 1], outlines[b, 2], outlines[b, 3]
            own = int(outlines[b, 4]) - 1
            least = CAP
            for a in range(3):
                if a == own:
                    continue  # an outline of a face never runs along its normal
                dx = poses[p, 0, a] + x * poses[p, 2, a]
                dy = poses[p, 1, a] + y * poses[p, 2, a]
                cross = dx * ty - dy * tx
                least = min(least, cross * cross / (dx * dx + dy * dy + 1e-9))
            total += least
        result[p] = total / len(outlines)
    return result

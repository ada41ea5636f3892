"""Bring predicted images to the size of the truth.

The truth of a pixel is that of one ray through its centre, so a prediction is sampled at that
point. Inside surfaces it is interpolated there; across an edge it is not, as that would put points
between the two surfaces.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
# Share of the range of an image (2nd to 98th percentile of 1 / depth or of disparity) by which
# four neighbours differ across an edge.
EDGE = 0.05


def nearest(values: Array, height: int, width: int) -> Array:
    """Return the values (h, w, ...) of the pixel that each centre of an image (H, W) lies in."""
    rows, columns = (
        np.minimum(((np.arange(to) + 0.5) * of / to).astype(np.int64), of - 1)
        for of, to in zip(values.shape[:2], (height, width), strict=True)
    )
    return np.asarray(values[np.ix_(rows, columns)])


def resampled(kind: str, geometry: Array, height: int, width: int) -> Array:
    """Return depth or disparity (h, w), or points (h, w, 3), at the centres of pixels of (H, W).

    Bilinear in what is linear across the picture of a plane: disparity, or 1 / depth where all of
    the image lies in front of the camera, and of points x / z and y / z as well. The nearest pixel
    where the four neighbours differ by more than `EDGE`, or one of them is not finite.
    """
    if geometry.shape[:2] == (height, width):
        return geometry
    layers = geometry if kind == "points" else geometry[..., None]
    sign = -1.0 if kind == "points" else 1.0  # of depth in the last layer
    depth = sign * layers[..., -1]
    with np.errstate(all="ignore"):
        in_front = kind != "disparity" and not (depth <= 0.0).any()
        if in_front:
            layers = np.dstack([layers[..., :-1] / depth[..., None], 1.0 / depth])
        corners, weights = _corners(depth.shape, (height, width))
        four = np.stack([layers[..., -1][at] for at in corners])
        finite = layers[..., -1][np.isfinite(layers[..., -1])]
        low, high = np.percentile(finite, (2, 98)) if finite.size else (0.0, 0.0)
        smooth = np.ptp(four, axis=0) <= EDGE * (high - low)
        mixed = np.sum([layers[at] * w for at, w in zip(corners, weights, strict=True)], axis=0)
        if in_front:
            mixed = np.dstack([mixed[..., :-1], np.full(smooth.shape, sign)]) / mixed[..., -1:]
        mixed = mixed if kind == "points" else mixed[..., 0]
    return np.where(
        smooth if mixed.ndim == 2 else smooth[..., None], mixed, nearest(geometry, height, width)
    )


def _corners(size: tuple[int, ...], to: tuple[int, int]) -> tuple[list[Any], list[Array]]:
    """Return the indices of the four pixels around each centre, and their weights (H, W, 1)."""
    firsts, parts = [], []
    for n, m in zip(size, to, strict=True):
        place = np.clip((np.arange(m) + 0.5) * n / m - 0.5, 0.0, n - 1.0)
        first = np.minimum(place.astype(np.int64), max(n - 2, 0))
        firsts.append(first)
        parts.append(place - first)
    corners, weights = [], []
    for i, j in np.ndindex(2, 2):
        rows = np.minimum(firsts[0] + i, size[0] - 1)
        columns = np.minimum(firsts[1] + j, size[1] - 1)
        corners.append(np.ix_(rows, columns))
        across = parts[1] if j else 1.0 - parts[1]
        down = parts[0] if i else 1.0 - parts[0]
        weights.append((down[:, None] * across[None])[..., None])
    return corners, weights


def filled(geometry: Array, valid: NDArray[np.bool_]) -> Array:
    """Return an image (H, W, ...) with the value of the nearest valid pixel where it has none."""
    from scipy.ndimage import distance_transform_edt

    if valid.all() or not valid.any():
        return geometry
    at = distance_transform_edt(~valid, return_distances=False, return_indices=True)
    return np.asarray(geometry[tuple(at)])

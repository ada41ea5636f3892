"""How strongly small patterns show in pictures, wherever they are.

The patterns are the middles of clusters of whitened windows (Coates, Ng & Lee, "An Analysis of
Single-Layer Networks in Unsupervised Feature Learning", 2011), found in the pictures themselves.
Each picture gets the largest, least and mean response to each pattern and its deviation. So trees
see marks, blur and noise, which the whole thumbnails hide among the shapes.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.threads import one_thread

Array = NDArray[Any]
PATTERNS, SIDE = 24, 3  # how many, and pixels a side
WINDOWS = 20_000  # of all pictures that patterns are found in
LEAST_CONTRAST = 1e-3  # standard deviation of a window that is not flat
_BLOCK = 64  # pictures at a time: bounds the memory


def pattern_responses(pictures: Array) -> Array:
    """Return four numbers for each pattern, (N, K, H, W) float32 to (N, K, 4 PATTERNS)."""
    flat = pictures.reshape(-1, *pictures.shape[2:])
    numbers = []
    with one_thread():
        filters = _filters(flat)
        for start in range(0, len(flat), _BLOCK):
            response = _windows(flat[start : start + _BLOCK]) @ filters
            parts = [summary(response, axis=1) for summary in (np.max, np.min, np.mean, np.std)]
            numbers.append(np.concatenate(parts, axis=1))
    return np.concatenate(numbers).reshape(*pictures.shape[:2], -1)


def _filters(pictures: Array) -> Array:
    """Return a filter for each pattern, (SIDE * SIDE, PATTERNS), whose weights sum to 0."""
    from sklearn.cluster import MiniBatchKMeans
    from sklearn.decomposition import PCA

    rng = item_rng(0, 0, Purpose.ANSWERS)
    each = -(-WINDOWS // len(pictures))
    windows = np.concatenate(
        [
            rng.choice(_windows(pictures[start : start + _BLOCK]), each, axis=1)
            for start in range(0, len(pictures), _BLOCK)
        ]
    ).reshape(-1, SIDE * SIDE)
    windows = windows[windows.std(axis=1) > LEAST_CONTRAST]
    if len(windows) < PATTERNS:
        return np.zeros((SIDE * SIDE, PATTERNS), np.float32)
    windows = windows - windows.mean(axis=1, keepdims=True)
    white = PCA(SIDE * SIDE - 1, whiten=True, svd_solver="covariance_eigh", random_state=0)
    apart = white.fit_transform(windows)
    apart /= np.linalg.norm(apart, axis=1, keepdims=True)
    clusters = MiniBatchKMeans(PATTERNS, n_init=1, random_state=0).fit(apart)
    scales = np.sqrt(white.explained_variance_)
    filters = (white.components_.T / scales) @ clusters.cluster_centers_.T
    return np.asarray((filters - filters.mean(axis=0)).astype(np.float32))


def _windows(pictures: Array) -> Array:
    """Return all windows of pictures, (N, H, W) to (N, windows, SIDE * SIDE)."""
    windows = np.lib.stride_tricks.sliding_window_view(pictures, (SIDE, SIDE), (1, 2))
    return windows.reshape(len(pictures), -1, SIDE * SIDE)

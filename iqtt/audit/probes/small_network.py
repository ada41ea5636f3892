"""A small convolutional network in numpy that looks at the pictures of a question's answers.

Two layers of convolutions with stride 2 and rectifiers, then the mean and the largest value of each
of 16 channels. An answer's score is linear in these, in how they differ from the mean of the
answers, and in the squares of that; the scores of a question's answers go through a softmax. It is
trained by Adam (Kingma & Ba 2015) on the logarithmic loss. So it finds small marks in pictures,
wherever they are, which the trees, on whole thumbnails and statistics, may miss.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.probes.trees import one_thread
from scenegen.common.random.seeding import Purpose, item_rng

Array = NDArray[Any]
CHANNELS, SIDE, STRIDE = (8, 16), 3, 2  # of the convolutions
EPOCHS, BATCH, STEP = 6, 32, 3e-3


class SmallNetwork:
    """The network, for grey pictures; the same input gives the same bits."""

    def __init__(self) -> None:
        rng = item_rng(0, 0, Purpose.ANSWERS)
        self._rng = rng
        inputs = SIDE * SIDE * np.array([1, CHANNELS[0]])
        self._weights = [
            rng.normal(0, np.sqrt(2 / n), (n, c)).astype(np.float32)
            for n, c in zip(inputs, CHANNELS, strict=True)
        ]
        self._weights += [np.zeros(c, np.float32) for c in CHANNELS]
        self._weights.append(rng.normal(0, 0.01, 6 * CHANNELS[1]).astype(np.float32))

    def fit(self, pictures: Array, right: Array) -> "SmallNetwork":
        """Learn from (N, K, H, W) float32 pictures about 0..1 which answers are right, (N,)."""
        first = [np.zeros_like(w) for w in self._weights]
        second = [np.zeros_like(w) for w in self._weights]
        step = 0
        with one_thread():
            for _ in range(EPOCHS):
                order = self._rng.permutation(len(right))
                for rows in np.split(order, range(BATCH, len(order), BATCH)):
                    step += 1
                    slopes = self._gradients(pictures[rows], right[rows])
                    size = np.float32(STEP * np.sqrt(1 - 0.999**step) / (1 - 0.9**step))
                    for i, slope in enumerate(slopes):
                        first[i] += 0.1 * (slope - first[i])
                        second[i] += 0.001 * (slope**2 - second[i])
                        self._weights[i] -= size * first[i] / (np.sqrt(second[i]) + 1e-8)
        return self

    def scores(self, pictures: Array) -> Array:
        """Return a score of each answer, (N, K, H, W) to (N, K); the highest is chosen."""
        with one_thread():
            parts = [
                self._forward(pictures[i : i + BATCH])[0] for i in range(0, len(pictures), BATCH)
            ]
        return np.concatenate([np.zeros((0, pictures.shape[1])), *parts])

    def _forward(self, pictures: Array) -> tuple[Array, list[Array]]:
        """Return the scores, (N, K), and what the gradients need."""
        w1, w2, b1, b2, last = self._weights
        count, answers = pictures.shape[:2]
        patches1 = _patches(pictures.reshape(count * answers, *pictures.shape[2:], 1))
        layer1 = np.maximum(patches1 @ w1 + b1, 0)
        patches2 = _patches(layer1)
        layer2 = np.maximum(patches2 @ w2 + b2, 0)
        flat = layer2.reshape(count, answers, -1, CHANNELS[1])
        seen = np.concatenate([flat.mean(axis=2), flat.max(axis=2)], axis=2)
        differs = seen - seen.mean(axis=1, keepdims=True)
        scores = np.concatenate([seen, differs, differs**2], axis=2) @ last
        return scores, [patches1, layer1, patches2, layer2, seen, differs]

    def _gradients(self, pictures: Array, right: Array) -> list[Array]:
        _, w2, _, _, last = self._weights
        scores, kept = self._forward(pictures)
        patches1, layer1, patches2, layer2, seen, differs = kept
        share = np.exp(scores - scores.max(axis=1, keepdims=True))
        share /= share.sum(axis=1, keepdims=True)
        share[np.arange(len(right)), right] -= 1
        slope = (share / len(right)).astype(np.float32)[..., None]
        of_last = (np.concatenate([seen, differs, differs**2], axis=2) * slope).sum(axis=(0, 1))
        plain, apart, squared = np.split(last, 3)
        to_differs = slope * (apart + 2 * differs * squared)
        to_seen = slope * plain + to_differs - to_differs.mean(axis=1, keepdims=True)
        to_mean, to_max = np.split(to_seen.reshape(-1, 1, 2 * CHANNELS[1]), 2, axis=2)
        flat = layer2.reshape(len(layer2), -1, CHANNELS[1])
        to_flat = to_mean / flat.shape[1] * np.ones_like(flat)
        where = flat.argmax(axis=1)[:, None]
        np.put_along_axis(
            to_flat, where, np.take_along_axis(to_flat, where, axis=1) + to_max, axis=1
        )
        to_layer2 = to_flat.reshape(layer2.shape) * (layer2 > 0)
        to_patches2 = to_layer2 @ w2.T
        to_layer1 = _unpatched(to_patches2, layer1.shape) * (layer1 > 0)
        return [
            np.tensordot(patches1, to_layer1, ((0, 1, 2), (0, 1, 2))),
            np.tensordot(patches2, to_layer2, ((0, 1, 2), (0, 1, 2))),
            to_layer1.sum(axis=(0, 1, 2)),
            to_layer2.sum(axis=(0, 1, 2)),
            of_last,
        ]


def _patches(images: Array) -> Array:
    """Return the windows that a convolution sees, (N, H, W, C) to (N, h, w, SIDE * SIDE * C)."""
    windows = np.lib.stride_tricks.sliding_window_view(images, (SIDE, SIDE), (1, 2))
    windows = windows[:, ::STRIDE, ::STRIDE].transpose(0, 1, 2, 4, 5, 3)
    return np.ascontiguousarray(windows).reshape(*windows.shape[:3], -1)


def _unpatched(slopes: Array, shape: tuple[int, ...]) -> Array:
    """Return the slopes of images whose windows have these: the transpose of `_patches`."""
    result = np.zeros(shape, np.float32)
    height, width = slopes.shape[1:3]
    parts = slopes.reshape(*slopes.shape[:3], SIDE, SIDE, shape[3])
    for i in range(SIDE):
        for j in range(SIDE):
            rows = slice(i, i + STRIDE * height, STRIDE)
            columns = slice(j, j + STRIDE * width, STRIDE)
            result[:, rows, columns] += parts[:, :, :, i, j]
    return result

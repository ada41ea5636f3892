"""Numbers that say something of an image: size, place, light, outline; none knows its shape."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
THUMBNAIL = 16  # pixels a side
LEVELS = 4  # of each channel, in a colour histogram
SAME = 1 / 512  # how far a channel of floating-point images may be off the background's


@dataclass(frozen=True, eq=False)
class Statistics:
    """What was measured of the images of Q questions: the reference, then three answers.

    Attributes:
        area: of the silhouette, as a share of the image, (Q, 4).
        extent: diagonal of the silhouette's bounding box, pixels, (Q, 4).
        offset: from the image's middle to that box's, pixels, (Q, 4).
        image_brightness: mean of all pixels and channels, (Q, 4).
        brightness: the same of the silhouette's pixels, (Q, 4).
        mean_color: of the silhouette's pixels, (Q, 4, 3).
        contrast: standard deviation of these pixels' grey, (Q, 4).
        colors: share of the silhouette's pixels in each box of colours, (Q, 4, LEVELS**3).
        moments: what `_moments` says of the silhouette, (Q, 4, 4).
        thumbnails: grey, (Q, 4, THUMBNAIL**2) float32.
        pixel_distance: root mean square between the images of a question, (Q, 4, 4).
    """

    area: Array
    extent: Array
    offset: Array
    image_brightness: Array
    brightness: Array
    mean_color: Array
    contrast: Array
    colors: Array
    moments: Array
    thumbnails: Array
    pixel_distance: Array

    def __len__(self) -> int:
        return len(self.area)

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """Put the questions of one or more together."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def take(self, rows: Array) -> Self:
        """Return some questions' alone; rows as numbers, or (Q,) bool."""
        return type(self)(*(getattr(self, field.name)[rows] for field in fields(self)))


def silhouettes(images: Array, background: Array) -> NDArray[np.bool_]:
    """Return which pixels are not the background, (Q, 4, H, W).

    Args:
        images: (Q, 4, H, W, 3), as stored.
        background: (3,), as stored.
    """
    if images.dtype == np.uint8:
        differs = images != background
    else:
        differs = ~(np.abs(images - background) <= SAME)  # NaN differs
    return np.asarray(differs[..., 0] | differs[..., 1] | differs[..., 2])


def measure(images: Array, shown: NDArray[np.bool_]) -> Statistics:
    """Measure the images of Q questions.

    Args:
        images: (Q, 4, H, W, 3), as stored; values that are not finite count as 0.
        shown: their silhouettes, (Q, 4, H, W).
    """
    questions, height, width = len(images), *images.shape[2:4]
    radiance = decode_image(images)
    if images.dtype != np.uint8:
        radiance = np.nan_to_num(radiance, nan=0.0, posinf=0.0, neginf=0.0).clip(0, 1)
    flat = radiance.reshape(questions, 4, height * width * 3)
    pixel_distance = np.zeros((questions, 4, 4))
    for a, b in itertools.combinations(range(4), 2):
        apart = np.linalg.norm(flat[:, a] - flat[:, b], axis=1) / math.sqrt(flat.shape[2])
        pixel_distance[:, a, b] = pixel_distance[:, b, a] = apart
    radiance = radiance.reshape(-1, height, width, 3)
    mask = shown.reshape(-1, height, width)
    grey = radiance @ np.full(3, 1 / 3, np.float32)
    pixels = np.maximum(np.count_nonzero(mask, axis=(1, 2)), 1)
    weight = mask.reshape(-1, 1, height * width).astype(np.float32)
    mean_color = (weight @ radiance.reshape(-1, height * width, 3))[:, 0] / pixels[:, None]
    brightness = mean_color.mean(axis=1)
    deviation = (grey - brightness[:, None, None]) * mask
    thumbnails = _averages(height) @ grey @ _averages(width).T
    extent, offset = _boxes(mask)
    found = {
        "area": mask.mean(axis=(1, 2)),
        "extent": extent,
        "offset": offset,
        "image_brightness": grey.mean(axis=(1, 2)),
        "brightness": brightness,
        "mean_color": mean_color,
        "contrast": np.sqrt((deviation**2).sum(axis=(1, 2)) / pixels),
        "colors": _color_shares(radiance, mask),
        "moments": _moments(mask),
        "thumbnails": thumbnails.reshape(-1, THUMBNAIL**2).astype(np.float32),
    }
    grouped = {name: v.reshape(questions, 4, *v.shape[1:]) for name, v in found.items()}
    return Statistics(pixel_distance=pixel_distance, **grouped)


def _averages(side: int) -> Array:
    """Return weights that shrink `side` pixels to THUMBNAIL averages, (THUMBNAIL, side) float32."""
    edges = np.linspace(0, side, THUMBNAIL + 1)
    pixel = np.arange(side)
    covered = np.minimum(edges[1:, None], pixel + 1) - np.maximum(edges[:-1, None], pixel)
    return (covered.clip(0) * THUMBNAIL / side).astype(np.float32)


def _boxes(mask: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the diagonal of each silhouette's box, and how far its middle is off the image's."""
    spans, offsets = [], []
    for axis in (1, 2):
        line = np.asarray(mask.any(axis=3 - axis))
        side = line.shape[1]
        first, last = line.argmax(axis=1), side - line[:, ::-1].argmax(axis=1)
        empty = ~line.any(axis=1)
        spans.append(np.where(empty, 0, last - first))
        offsets.append(np.where(empty, 0, (first + last - side) / 2))
    return np.hypot(*spans), np.hypot(*offsets)


def _color_shares(radiance: Array, mask: NDArray[np.bool_]) -> Array:
    """Return the share of each silhouette's pixels in each box of colours, (N, LEVELS**3)."""
    level = np.minimum((radiance[mask] * LEVELS).astype(np.int64), LEVELS - 1)
    boxes = LEVELS**3
    code = level @ np.array([LEVELS**2, LEVELS, 1]) + boxes * np.nonzero(mask)[0]
    counts = np.bincount(code, minlength=boxes * len(mask)).reshape(-1, boxes)
    return np.asarray(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1))


def _moments(mask: NDArray[np.bool_]) -> Array:
    """Return four lengths, as shares of the image's shorter side, that turning an image keeps.

    They are the silhouette's spreads (standard deviations) along its two axes and, of its third
    moments, the third and fourth of Hu's invariants ("Visual pattern recognition by moment
    invariants", 1962), not normalised for size, sixth roots; mirroring keeps them too. (N, 4).
    """
    height, width = mask.shape[1:]
    short = min(height, width)
    y, x = ((np.arange(n) + 0.5 - n / 2) / short for n in (height, width))
    powers = np.arange(4)
    # (N, 4, 4): sums of y^p x^q over each silhouette.
    sums = (y ** powers[:, None]) @ mask.astype(np.float64) @ (x[:, None] ** powers)
    m = np.moveaxis(sums / np.maximum(sums[:, :1, :1], 1), 0, 2)
    v, u = m[1, 0], m[0, 1]  # the middle
    yy, xy, xx = m[2, 0] - v * v, m[1, 1] - v * u, m[0, 2] - u * u
    yyy = m[3, 0] - 3 * v * m[2, 0] + 2 * v**3
    xxx = m[0, 3] - 3 * u * m[0, 2] + 2 * u**3
    yyx = m[2, 1] - 2 * v * m[1, 1] - u * m[2, 0] + 2 * v * v * u
    yxx = m[1, 2] - 2 * u * m[1, 1] - v * m[0, 2] + 2 * u * u * v
    middle, half = (yy + xx) / 2, np.hypot((yy - xx) / 2, xy)
    third = (xxx - 3 * yyx) ** 2 + (3 * yxx - yyy) ** 2
    fourth = (xxx + yyx) ** 2 + (yxx + yyy) ** 2
    spreads = np.sqrt(np.maximum([middle + half, middle - half], 0))
    return np.stack([*spreads, *np.power([third, fourth], 1 / 6)], axis=1)

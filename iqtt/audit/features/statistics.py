"""Numbers that describe images (size, place, light, outline) and shapes; probes look at these."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.features.outlines import DISTANCES, FEATURES, moments, outlines
from iqtt.files.layout import NO_CUBE
from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
THUMBNAIL = 32  # pixels a side
LEVELS = 4  # levels of each channel in a colour histogram
SAME = 1 / 512  # how far a channel of a floating-point image may differ from the background's
SHAPE_STATISTICS = ("contacts of cubes", "spread of cubes", "shape in other questions")


def statistics_record(images: int) -> np.dtype[np.void]:
    """Return the type of one question's statistics: of so many images, the reference first."""
    columns: list[tuple[str, str, tuple[int, ...]]] = [
        ("area", "f8", ()),  # of the silhouette, as a share of the image
        ("extent", "f8", ()),  # diagonal of the silhouette's bounding box, pixels
        ("offset", "f8", ()),  # from the middle of the image to the middle of that box, pixels
        ("image_brightness", "f4", ()),  # mean of all pixels and channels
        ("brightness", "f8", ()),  # mean of the silhouette's pixels and channels
        ("mean_color", "f8", (3,)),  # mean of the silhouette's pixels
        ("contrast", "f8", ()),  # standard deviation of the grey of the silhouette's pixels
        ("colors", "f8", (LEVELS**3,)),  # colour histogram of the silhouette's pixels, shares
        ("moments", "f8", (4,)),  # two of `outlines.moments` of each of second and third order
        ("thumbnails", "f4", (THUMBNAIL**2,)),  # small grey images
        ("pixel_distance", "f8", (images,)),  # root mean square differences of the images
        ("outline", "f4", (len(FEATURES),)),  # as `outlines.outlines` gives them
        ("outline_distance", "f4", (images, len(DISTANCES))),
    ]
    return np.dtype([(name, kind, (images, *more)) for name, kind, more in columns])


def border(pixels: Array) -> Array:
    """Return the pixels on the border of images, (Q, I, H, W, ...) to (Q, I, B, ...)."""
    sides = (pixels[:, :, 0], pixels[:, :, -1], pixels[:, :, 1:-1, 0], pixels[:, :, 1:-1, -1])
    return np.concatenate(sides, axis=2)


def border_color(images: Array) -> Array:
    """Return the most frequent colour on the images' borders, (3,); zero if there is no image."""
    colors = border(images).reshape(-1, 3)
    if not len(colors):
        return np.zeros(3, images.dtype)
    distinct, counts = np.unique(colors, axis=0, return_counts=True)
    return np.asarray(distinct[counts.argmax()])


def silhouettes(images: Array, background: Array) -> NDArray[np.bool_]:
    """Return which pixels differ from the background, (Q, I, H, W).

    Args:
        images: (Q, I, H, W, 3), as stored.
        background: (3,), as stored.
    """
    if images.dtype == np.uint8:
        differs = images != background
    else:
        differs = ~(np.abs(images - background) <= SAME)  # NaN differs
    return np.asarray(differs[..., 0] | differs[..., 1] | differs[..., 2])


def measure(images: Array, shown: NDArray[np.bool_]) -> Array:
    """Return the statistics of the images of Q questions, (Q,), as `statistics_record` has them.

    Args:
        images: (Q, I, H, W, 3), as stored; values that are not finite count as 0.
        shown: silhouettes, (Q, I, H, W).
    """
    questions, count, height, width = images.shape[:4]
    radiance = decode_image(images)
    if images.dtype != np.uint8:
        radiance = np.nan_to_num(radiance, nan=0.0, posinf=0.0, neginf=0.0).clip(0, 1)
    flat = radiance.reshape(questions, count, height * width * 3)
    result = np.zeros(questions, statistics_record(count))
    result["outline"], result["outline_distance"] = outlines(shown)
    for a, b in itertools.combinations(range(count), 2):
        apart = np.linalg.norm(flat[:, a] - flat[:, b], axis=1) / math.sqrt(flat.shape[2])
        result["pixel_distance"][:, a, b] = result["pixel_distance"][:, b, a] = apart
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
    columns = {
        "area": mask.mean(axis=(1, 2)),
        "extent": extent,
        "offset": offset,
        "image_brightness": grey.mean(axis=(1, 2)),
        "brightness": brightness,
        "mean_color": mean_color,
        "contrast": np.sqrt((deviation**2).sum(axis=(1, 2)) / pixels),
        "colors": _color_shares(radiance, mask),
        "moments": moments(mask)[1][:, [0, 1, 3, 2]],
        "thumbnails": thumbnails,
    }
    for name, values in columns.items():
        result[name] = values.reshape(result[name].shape)
    return result


def _averages(side: int) -> Array:
    """Return weights that average `side` pixels to THUMBNAIL ones, (THUMBNAIL, side) float32."""
    edges = np.linspace(0, side, THUMBNAIL + 1)
    pixel = np.arange(side)
    covered = np.minimum(edges[1:, None], pixel + 1) - np.maximum(edges[:-1, None], pixel)
    return (covered.clip(0) * THUMBNAIL / side).astype(np.float32)


def _boxes(mask: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the diagonal of each silhouette's box, and its middle's distance from the image's."""
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
    """Return the colour histogram of each silhouette's pixels, shares, (N, LEVELS**3)."""
    level = np.minimum((radiance[mask] * LEVELS).astype(np.int64), LEVELS - 1)
    boxes = LEVELS**3
    code = level @ np.array([LEVELS**2, LEVELS, 1]) + boxes * np.nonzero(mask)[0]
    counts = np.bincount(code, minlength=boxes * len(mask)).reshape(-1, boxes)
    return np.asarray(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1))


def shape_statistics(
    cubes: Sequence[Array], class_names: Sequence[Array], whole: Sequence[Array]
) -> list[Array]:
    """Return for each table the SHAPE_STATISTICS of its answers, (Q, K, 3); NaN unless whole.

    They are the number of pairs of cubes that share a face; the cubes' mean squared distance from
    their middle; and how many answers of other questions, in all tables, show the shape or its
    mirror image. The references of other questions are not counted: a right answer comes with one,
    so they would tell which answers of other questions are right.

    Args:
        cubes: for each table its cubes, (Q, 1 + K, most, 3), as stored.
        class_names, whole: for each table, as in `proofs.shapes.Shapes`.
    """
    everything = np.concatenate([names[:, 1:].reshape(-1) for names in class_names])
    names, times = np.unique(everything, return_counts=True)
    results = []
    for stored, its_names, good in zip(cubes, class_names, whole, strict=True):
        answers = stored[:, 1:]
        used = (answers != NO_CUBE).all(axis=3)
        contacts, spread = np.zeros((2, *used.shape[:2]))
        # One cube of each shape at a time, so that memory stays small.
        for i in range(used.shape[2]):
            apart = np.abs(answers - answers[:, :, i : i + 1].astype(np.int16))
            both = used & used[:, :, i : i + 1]
            contacts += np.count_nonzero(both & (apart.sum(axis=3) == 1), axis=2) / 2
            spread += ((apart**2).sum(axis=3) * both).sum(axis=2)
        spread /= 2 * np.maximum(used.sum(axis=2), 1) ** 2
        here = (its_names[:, 1:, None] == its_names[:, None, 1:]).sum(axis=2)
        elsewhere = times[np.searchsorted(names, its_names[:, 1:])] - here
        numbers = np.stack([contacts, spread, elsewhere], axis=2)
        results.append(np.where(good[:, None, None], numbers, np.nan))
    return results

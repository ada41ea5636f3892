"""Hints on points that leave the camera's rays, and on why: axes, frame or field of view."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, align_points
from metrics.measures.surfaces.points import pixels_off_rays
from metrics.submissions.hints.frames import AXES, frame_text
from metrics.submissions.hints.samples import Sample
from metrics.submissions.problems import HINT, Problem

Array = NDArray[Any]
Remedy = Callable[[Array, Sample], Array]
BETTER = 0.5  # fraction of the error that may remain after a remedy
SHARE = 0.6  # fraction of the images in which a remedy must help so much
OFF_PIXELS = 0.5  # by which points may leave their rays without a word
OTHER_FOCAL = 1.05  # least factor between two focal lengths that differ


def point_hints(samples: Sequence[Sample], alignment: Alignment) -> list[Problem]:
    """Return how far points leave the rays of their pixels, and which mistake explains it."""
    with np.errstate(all="ignore"):  # whatever comes out not finite satisfies no rule
        return _point_hints([s for s in samples if s.points is not None], alignment)


def _point_hints(samples: Sequence[Sample], alignment: Alignment) -> list[Problem]:
    if not samples:
        return []
    off = np.array([_off(s, alignment) for s in samples])
    found = []
    if np.median(off) > OFF_PIXELS:
        found.append(f"points leave the rays of their pixels by {np.median(off):.1f} pixels")
    spreads = np.array([_apart(t, np.median(t, axis=0)) for t in (s.true_points for s in samples)])
    given = np.array([_error(s, _points(s), alignment) for s in samples])
    best, text = np.inf, ""
    for words, remedy in _remedies(samples):
        errors = np.array([_error(s, remedy(_points(s), s), alignment) for s in samples])
        good = (errors <= BETTER * given) & (errors <= BETTER * spreads)
        if good.mean() >= SHARE and np.median(errors) < best:
            best, text = float(np.median(errors)), words
    if text:
        distances = (
            f"{np.median(given):.3g} from the ground truth as given, {best:.3g} after the fix"
        )
        found.append(f"looks like {text} ({distances})")
    expected = "points in the camera frame (x right, y up, z towards the viewer), on its rays"
    return [Problem("points", HINT, expected, words) for words in found]


def _remedies(samples: Sequence[Sample]) -> Iterator[tuple[str, Remedy]]:
    for k, matrix in enumerate(AXES):
        if k:
            yield frame_text(matrix, False), partial(_turned, matrix)
        yield frame_text(matrix, True), partial(_from_world, matrix)
    factors = [float(_focal(_points(s), s)) for s in samples]
    factor = float(np.median(factors))
    if factor > 0.0 and max(factor, 1.0 / factor) >= OTHER_FOCAL:
        angle = np.degrees(
            2.0 * np.arctan(np.tan(np.radians(samples[0].fov_y_degrees) / 2.0) / factor)
        )
        yield (
            f"another field of view, {angle:.1f} degrees instead of {samples[0].fov_y_degrees:.1f}",
            lambda p, _: p * np.array([factor, factor, 1.0]),
        )


def _turned(matrix: Array, points: Array, _: Sample) -> Array:
    return np.asarray(points @ matrix.T)


def _from_world(matrix: Array, points: Array, sample: Sample) -> Array:
    return np.asarray((points @ matrix.T - sample.position) @ sample.camera_from_world.T)


def _focal(points: Array, sample: Sample) -> float:
    """Return by what x and y have to be multiplied to lie on the rays at their own depth."""
    sides = -points[:, 2:] * sample.rays[sample.mask][:, :2]
    return float((points[:, :2] * sides).sum() / np.square(points[:, :2]).sum())


def _points(sample: Sample) -> Array:
    assert sample.points is not None
    return sample.points[sample.mask]


def _off(sample: Sample, alignment: Alignment) -> float:
    """Return the median distance from the rays in pixels, after the declared alignment."""
    points = align_points(_points(sample), sample.true_points, alignment)
    return float(np.median(pixels_off_rays(points, sample.rays[sample.mask], sample.pitch)))


def _error(sample: Sample, points: Array, alignment: Alignment) -> float:
    """Return the median distance from the true points after the declared alignment."""
    if not np.isfinite(points).all():
        return float("nan")
    return _apart(align_points(points, sample.true_points, alignment), sample.true_points)


def _apart(points: Array, true: Array) -> float:
    return float(np.median(np.linalg.norm(points - true, axis=-1)))

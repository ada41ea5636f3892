"""Hints on depth that is another quantity, or has another scale or image orientation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.submissions.hints.samples import Sample
from metrics.submissions.problems import HINT, Problem

Array = NDArray[Any]
Remedy = Callable[[Sample], Array]
BETTER = 0.5  # fraction of the error that may remain after a remedy
SHARE = 0.6  # fraction of the images in which a remedy must help so much
CORRELATED = 0.6  # least correlation with the truth of depth in another scale
SWAPPED = 0.8  # least correlation with 1 / truth of disparity
SAME_SCALE = 1.5  # factor within which two scales count as the same
FEWEST = 3  # images that can share a scale
OTHER_UNIT = 10.0  # least factor that looks like another unit of length
SLOPE = 0.2  # by which the slopes of distances may differ from 1
MOST_CONDITION = 1e6  # of the equations for the slopes
ALONG_RAY = "looks like distance along the ray, not planar depth"
IMAGES = (255.0, 65535.0)  # largest values of images of 8 and 16 bits
SCALE = "looks like another scale"
UNITS = {1000.0: "millimetres instead of metres", 100.0: "centimetres instead of metres"}
# Factors that a hint names only where they fit within EXACT.
FACTORS = {3.2808: "feet instead of metres", 39.37: "inches instead of metres"}
EXACT = 0.03
USUAL_FOCAL = 300.0  # pixels: a network trained at this focal length is often scaled by it


def depth_hints(samples: Sequence[Sample], alignment: str, kind: str = "depth") -> list[Problem]:
    """Return hints on depth from sampled images; `alignment` is what the submission claims."""
    with np.errstate(all="ignore"):  # whatever comes out not finite satisfies no rule
        usable = [_Image.of(sample) for sample in samples]
        images = [image for image in usable if image is not None]
        if not images:
            return []
        shape = _swapped(images) or _shape(images) or _along_rays(images)
        found = [shape, _scale(images, alignment)]
    expected = "planar depth, -z in the camera frame, scene units, row 0 on top"
    return [Problem(kind, HINT, expected, text) for text in found if text]


def disparity_hints(samples: Sequence[Sample]) -> list[Problem]:
    """Return a hint where declared disparity follows the true depth, and not its inverse."""
    with np.errstate(all="ignore"):
        images = [image for sample in samples if (image := _Image.of(sample)) is not None]
        if not images or np.mean([i.correlation(i.true) >= SWAPPED for i in images]) < SHARE:
            return []
    found = "looks like depth: large where the ground truth is far"
    return [Problem("disparity", HINT, "1 / depth, large where the surface is near", found)]


@dataclass(frozen=True, eq=False)
class _Image:
    """The pixels of a sample that can be compared.

    Attributes:
        predicted, true: depth, (N,).
        spread: median distance of the truth from its median, which is what a constant scores.
        scale: median of predicted / true.
    """

    sample: Sample
    predicted: Array
    true: Array
    spread: float
    scale: float

    @staticmethod
    def of(sample: Sample) -> "_Image | None":
        """Return the pixels of a sample; None where the truth is flat, so that none can differ."""
        predicted, true = sample.depth[sample.mask], sample.true_depth[sample.mask]
        spread = _error(true, np.median(true))
        scale = float(np.median(predicted / true))
        return _Image(sample, predicted, true, spread, scale) if spread > 0.0 else None

    def correlation(self, quantity: Array) -> float:
        """Return the correlation of the prediction with values (N,); 0 where one is constant."""
        a, b = _centred(self.predicted), _centred(quantity)
        below = float(np.sqrt((a * a).sum() * (b * b).sum()))
        return float((a * b).sum()) / below if below > 0.0 else 0.0


def _swapped(images: Sequence[_Image]) -> str | None:
    """Return what the predictions look like where near and far are swapped."""
    if np.mean([image.correlation(1.0 / image.true) >= SWAPPED for image in images]) < SHARE:
        return None
    if np.mean([np.median(image.predicted) < 0.0 for image in images]) > SHARE:
        return "looks like z in the camera frame, which is negative in front of it"
    return "looks like disparity (1/depth): large where the ground truth is near"


def _shape(images: Sequence[_Image]) -> str | None:
    """Return the remedy that explains the predictions in any scale, if there is one."""
    rivals = _simple_errors(images)
    best, found = np.inf, None
    for text, remedy in _REMEDIES.items():
        mended = [_mended(image.sample, remedy) for image in images]
        scale = np.median(np.concatenate([m / i.true for m, i in zip(mended, images, strict=True)]))
        errors = np.array([_error(m / scale, i.true) for m, i in zip(mended, images, strict=True)])
        spreads = np.array([image.spread for image in images])
        good = (errors <= BETTER * rivals) & (errors <= BETTER * spreads)
        error = float(np.median(errors / spreads))
        if good.mean() >= SHARE and error < best and rivals.any():
            best, found = error, text
    return found


def _along_rays(images: Sequence[_Image]) -> str | None:
    """Return that predictions are distances, where only noise hides it.

    The logarithm of a distance is that of the planar depth plus that of the ray's length at depth
    1. Each image may have a scale of its own. Noise of the predictions biases neither slope.
    """
    known, said = [], []
    for image in images:
        if (image.predicted <= 0.0).any():
            return None
        logs = np.log([image.true, image.sample.stretch[image.sample.mask], image.predicted])
        *two, last = logs - logs.mean(axis=1, keepdims=True)
        known.append(np.stack(two, axis=1))
        said.append(last)
    table, target = np.concatenate(known), np.concatenate(said)
    square = table.T @ table
    if np.linalg.cond(square) > MOST_CONDITION:
        return None
    slopes = np.linalg.solve(square, table.T @ target)
    rest = target - table @ slopes
    errors = np.sqrt(np.diag(np.linalg.inv(square)) * (rest @ rest) / len(rest))
    if (np.abs(slopes - 1.0) > SLOPE).any() or (errors > SLOPE / 4.0).any():
        return None
    return ALONG_RAY


def _mended(sample: Sample, remedy: Remedy) -> Array:
    """Return the values (N,) of a remedy where both depths are finite; infinite for NaN."""
    values = remedy(sample)[sample.mask]
    return np.where(np.isfinite(values), values, np.inf)


def _simple_errors(images: Sequence[_Image]) -> Array:
    """Return for each image the least error: as given, or after one scale or line for all."""
    predicted = np.concatenate([image.predicted for image in images])
    true = np.concatenate([image.true for image in images])
    scaled = predicted / np.median(predicted / true)
    centred = _centred(predicted)
    square = float((centred * centred).sum())
    slope = float((centred * (true - true.mean())).sum()) / square if square > 0.0 else 0.0
    line = slope * centred + true.mean()
    ends = np.cumsum([len(image.true) for image in images])[:-1]
    parts = [np.split(values, ends) for values in (predicted, scaled, line)]
    rows = zip(images, *parts, strict=True)
    return np.array(
        [np.nanmin([_error(one, image.true) for one in found]) for image, *found in rows]
    )


def _scale(images: Sequence[_Image], alignment: str) -> str | None:
    """Return what the scale looks like, such as normalised or another unit, unless aligned away."""
    if alignment == "scale_shift":
        return None
    scales = np.array([image.scale for image in images])
    scale = float(np.median(scales))
    if not scale > 0.0 or 1.0 / SAME_SCALE <= scale <= SAME_SCALE:
        return None
    follows = np.mean([image.correlation(image.true) >= CORRELATED for image in images]) >= SHARE
    low = min(float(image.predicted.min()) for image in images)
    high = max(float(image.predicted.max()) for image in images)
    normalised = low >= -1e-6 and 0.9 <= high <= 1.0 + 1e-6
    if normalised and follows and (alignment == "none" or low < 0.1):
        return "looks normalised to 0..1"
    for most in IMAGES:
        ends = [(float(i.predicted.min()), float(i.predicted.max())) for i in images]
        if (
            follows
            and np.mean([a < 0.1 * most and 0.9 * most < b <= most for a, b in ends]) > SHARE
        ):
            return f"looks like a depth image scaled to 0..{most:g} in each image"
    errors = [_error(image.predicted / scale, image.true) for image in images]
    near = np.mean([e <= 1.2 * i.spread for e, i in zip(errors, images, strict=True)]) >= SHARE
    alike = np.mean(np.abs(np.log(scales / scale)) <= 0.1) >= SHARE
    same = alike and len(images) >= FEWEST
    other_unit = near and not 1.0 / OTHER_UNIT < scale < OTHER_UNIT
    if alignment != "none" or not (other_unit or (follows and same)):
        return None
    unit = next((u for f, u in UNITS.items() if f / 2.0 < scale < 2.0 * f), "another unit")
    exact = next((u for f, u in FACTORS.items() if abs(np.log(scale / f)) < EXACT), "")
    by_focal = scales * USUAL_FOCAL * np.array([image.sample.pitch for image in images])
    if not exact and (np.abs(np.log(by_focal)) < EXACT).all():
        exact = f"multiplied by focal length / {USUAL_FOCAL:g}"
    unit = exact or unit
    guess = f" ({unit}?)" if other_unit or exact else ""
    rounded = float(f"{scale:.3g}")
    return f"{SCALE}: {rounded:,g} times the ground truth{guess}"


def _error(a: Array, b: Any) -> float:
    return float(np.median(np.abs(a - b)))


def _centred(values: Array) -> Array:
    """Return values (N,) minus their mean, scaled so that squares do not vanish or overflow."""
    centred = values - values.mean()
    size = float(np.abs(centred).max())
    # What is left of a constant by rounding is no signal.
    if not size > 1e-9 * float(np.abs(values).max()):
        return np.zeros_like(values)
    return np.asarray(centred / size)


def _transposed(sample: Sample) -> Array:
    square = sample.depth.shape[0] == sample.depth.shape[1]
    return sample.depth.T if square else np.full_like(sample.depth, np.nan)


_REMEDIES: dict[str, Remedy] = {
    ALONG_RAY: lambda s: s.depth / s.stretch,
    "looks upside down": lambda s: s.depth[::-1],
    "looks mirrored, left and right swapped": lambda s: s.depth[:, ::-1],
    "looks rotated by 180 degrees": lambda s: s.depth[::-1, ::-1],
    "looks transposed, rows and columns swapped": _transposed,
}

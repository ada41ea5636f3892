"""Alignments: what the truth decides for a prediction before it is scored.

Many methods predict depth up to an unknown scale, scale and shift, or disparity up to both. `align`
fits what an alignment leaves open to the true depth of one image. In the formulas, p is a predicted
depth, t the true one, s a scale of at least 0, and b a shift; sums are over the scored pixels. A
scale is never negative, or a prediction that swaps near and far would count as depth.

- none: p as it is.
- median_scale: s p, s = median(t) / median(p). Source: Zhou et al. 2017 (Unsupervised Learning of
  Depth and Ego-Motion).
- scale: s p that minimises sum (s p - t)^2.
- scale_shift: s p + b that minimises sum (s p + b - t)^2. Source: Ranftl et al. 2020 (MiDaS), here
  applied to depth where they align disparity.
- scale_l1, scale_shift_l1: s p and s p + b that minimise sum |s p + b - t| / t, exactly. Source:
  Wang et al. 2025 (MoGe), section 3.2 and its appendix.
- disparity_scale_shift: 1 / max(s d + b, 1 / max(t)), where s d + b minimises
  sum (s d + b - 1 / t)^2, and d is the disparity, 1 / p. Source: Ranftl et al. 2020, section 5.
  Another `cap` may take the place of max(t).
"""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from metrics.measures.checks import MeasureError

Array = NDArray[np.float64]
Alignment = Literal[
    "none",
    "median_scale",
    "scale",
    "scale_shift",
    "scale_l1",
    "scale_shift_l1",
    "disparity_scale_shift",
]
SMALLEST_SHARE = 1e-4  # of the largest depth: less is raised to this before it is inverted
STEPS = 200  # of the search of `l1_scale_shift`, which takes about ten
MANY = 2**16  # points, of which a line is fitted to SOME first
SOME = 8192
NEAR = 0.05, 0.2  # fractions of them near that line, on whose sides the line of all may run


def align(p: Array, t: Array, alignment: Alignment, cap: float | None = None) -> Array:
    """Return predicted depth (N,) after an alignment to the true depth (N,), both finite.

    `cap` is that of `depth_of_disparity`.

    Where the formula gives a negative scale or none (p is 0 throughout, or constant where a shift
    is fitted, too), the scale is 0, the optimum under s >= 0. Raises MeasureError on another
    alignment.
    """
    if alignment == "none":
        return p
    if alignment == "median_scale":
        return _ratio(float(np.median(t)), float(np.median(p))) * p
    # Squares of unit-sized numbers do not vanish, and a constant is 1 and centres to 0 exactly.
    unit = p / (float(np.abs(p).max()) or 1.0)
    scale, shift = 1.0, 0.0
    if alignment == "scale_shift":
        return _least_squares_line(unit, t)
    if alignment == "disparity_scale_shift":
        return depth_of_disparity(1.0 / np.maximum(unit, SMALLEST_SHARE), t, cap)
    if alignment == "scale":
        scale = _ratio(float(unit @ t), float(unit @ unit))
    elif alignment == "scale_l1":
        scale = l1_scale(unit, t, 1.0 / t)
    elif alignment == "scale_shift_l1":
        scale, shift = l1_scale_shift(unit, t, 1.0 / t)
    else:
        raise MeasureError("alignment", alignment, f"one of {', '.join(get_args(Alignment))}")
    return np.asarray(scale * unit + shift)


def scale_and_shift(p: Array, t: Array, alignment: Alignment) -> tuple[float, float]:
    """Return the scale and the shift by which `align` maps p to t, under none, scale, scale_shift.

    Without points, nothing changes.
    """
    if alignment == "none" or not len(p):
        return 1.0, 0.0
    if alignment == "scale":
        return _ratio(float(p @ t), float(p @ p)), 0.0
    if alignment != "scale_shift":
        raise MeasureError("alignment of layers", alignment, "none, scale or scale_shift")
    centred = p - p.mean()
    scale = _ratio(float(centred @ (t - t.mean())), float(centred @ centred))
    return scale, float(t.mean() - scale * p.mean())


def depth_of_disparity(d: Array, t: Array, cap: float | None = None) -> Array:
    """Return depth (N,) of disparity (N,), known up to scale and shift, fitted to the true depth.

    As `disparity_scale_shift`; no depth exceeds `cap`, by default the largest true one.
    """
    target = 1.0 / t
    fitted = _least_squares_line(d / (float(np.abs(d).max()) or 1.0), target)
    return np.asarray(1.0 / np.maximum(fitted, target.min() if cap is None else 1.0 / cap))


def align_points(p: Array, t: Array, alignment: Alignment) -> Array:
    """Return predicted points (N, 3) after an alignment in least squares to the true ones, (N, 3).

    Under "scale" that is s p, under "scale_shift" s p + b with b of three numbers. Raises
    MeasureError on other alignments than these and "none".
    """
    if alignment == "none":
        return p
    if alignment not in ("scale", "scale_shift"):
        raise MeasureError("alignment of points", alignment, "none, scale or scale_shift")
    unit = p / (float(np.abs(p).max()) or 1.0)
    if alignment == "scale":
        return np.asarray(_ratio(float(np.vdot(unit, t)), float(np.vdot(unit, unit))) * unit)
    middle = t.mean(axis=0)
    centred, target = unit - unit.mean(axis=0), t - middle
    ratio = _ratio(float(np.vdot(centred, target)), float(np.vdot(centred, centred)))
    return np.asarray(ratio * centred + middle)


def l1_scale(p: Array, t: Array, weights: Array) -> float:
    """Return the scale s >= 0 that minimises sum w |s p - t|, exactly.

    The sum is convex, and linear between its break points t / p: a weighted median of these.
    """
    some = p != 0.0
    if not some.any():
        return 0.0
    p, t, weights = p[some], t[some], weights[some]
    with np.errstate(over="ignore"):  # a point that hardly weighs
        return max(float(weighted_median(t / p, weights * np.abs(p))), 0.0)


def l1_scale_shift(p: Array, t: Array, weights: Array) -> tuple[float, float]:
    """Return the scale s >= 0 and the shift b that minimise sum w |s p + b - t|, exactly.

    For each s the best b is a weighted median of t - s p, found by sorting. What is left is convex
    and piecewise linear in s. Two tangents whose slopes differ in sign enclose the optimum; the
    next s is where they meet, until the sum there lies on both tangents. If the enclosed range does
    not shrink by half, the next s is its middle.
    """
    found = _l1_of_many(p, t, weights) if len(p) > MANY else None
    if found is not None:
        return found
    total, rounding = float(weights.sum()), 1e-13 * float(weights @ np.abs(p))

    def tangent(s: float) -> tuple[float, float, float]:
        """Return the sum, a slope of it, and the shift, all at this scale."""
        rest = t - s * p
        b = float(weighted_median(rest, weights))
        signs = np.sign(b - rest)
        pulls = weights * signs
        at = signs == 0.0
        # Of the points on the line, the signs may be any in [-1, 1]: those that balance the others.
        balance = -float(pulls.sum()) / float(weights[at].sum())
        slope = float(pulls @ p) + balance * float(weights[at] @ p[at])
        slope = slope if abs(slope) > rounding else 0.0
        return float(weights @ np.abs(b - rest)), slope, b

    low, value, slope, shift = 0.0, *tangent(0.0)
    best = (value, low, shift)
    if slope >= 0.0:
        return low, shift
    at_low = (value, slope)
    centred = p - weights @ p / total
    spread = float(weights @ (centred * centred))
    step = max(float(weights @ (centred * t)) / spread if spread > 0.0 else 0.0, 1e-12)
    high = step
    while True:
        value, slope, shift = tangent(high)
        best = min(best, (value, high, shift))
        if slope >= 0.0:
            break
        low, at_low = high, (value, slope)
        high *= 2.0
    at_high = (value, slope)
    halve = False
    for _ in range(STEPS):
        if at_high[1] == 0.0:
            return high, shift
        meet = (at_low[0] - at_high[0] + at_high[1] * high - at_low[1] * low) / (
            at_high[1] - at_low[1]
        )
        bound = at_low[0] + at_low[1] * (meet - low)
        if best[0] <= bound + 1e-13 * abs(best[0]) or not low < meet < high:
            break
        s = 0.5 * (low + high) if halve else meet
        value, slope, shift = tangent(s)
        best = min(best, (value, s, shift))
        width = high - low
        if slope < 0.0:
            low, at_low = s, (value, slope)
        else:
            high, at_high = s, (value, slope)
        halve = not halve and high - low > 0.5 * width
    return best[1], best[2]


def _l1_of_many(p: Array, t: Array, weights: Array) -> tuple[float, float] | None:
    """Return what `l1_scale_shift` returns, from fewer points; None where that is not sure.

    Points far to one side of the line of some points are taken together as their weighted mean.
    Their sum is then never larger than it was, and as large where all of them are on one side. So
    an optimum that leaves them there is one of all points.
    """
    some = slice(None, None, len(p) // SOME)
    line = l1_scale_shift(p[some], t[some], weights[some])
    found = (_l1_from_near(p, t, weights, line, fraction) for fraction in NEAR)
    return next((line for line in found if line is not None), None)


def _l1_from_near(
    p: Array, t: Array, weights: Array, line: tuple[float, float], fraction: float
) -> tuple[float, float] | None:
    scale, shift = line
    rest = scale * p + shift - t
    size = np.abs(rest)
    count = int(fraction * len(p))
    near = size <= np.partition(size, count)[count]
    sides = ~near & (rest > 0.0), ~near & (rest < 0.0)
    points = [values[near] for values in (p, t, weights)]
    for side in sides:
        if side.any():
            weight = float(weights @ side)
            means = (float((weights * values) @ side) / weight for values in (p, t))
            points = [np.append(a, b) for a, b in zip(points, (*means, weight), strict=True)]
    if len(points[0]) > MANY:
        return None
    scale, shift = l1_scale_shift(*points)
    rest = scale * p + shift - t
    kept = (rest[sides[0]] >= 0.0).all() and (rest[sides[1]] <= 0.0).all()
    return (scale, shift) if kept else None


def weighted_median(values: Array, weights: Array) -> float:
    """Return the smallest value up to which half of all weight lies.

    Of many values, those far below and far above that of some are each taken as one value.
    """
    if len(values) > MANY:
        some = slice(None, None, len(values) // SOME)
        order = np.argsort(values[some])
        reached = np.cumsum(weights[some][order])
        ends = np.searchsorted(reached, [0.45 * reached[-1], 0.55 * reached[-1]])
        low, high = values[some][order[ends]]
        below, above = values < low, values > high
        before, after, half = weights @ below, weights @ above, 0.5 * float(weights.sum())
        if before < half and after < half:
            near = ~(below | above)
            values = np.concatenate([[-np.inf], values[near], [np.inf]])
            weights = np.concatenate([[before], weights[near], [after]])
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(reached, 0.5 * reached[-1])]])


def _least_squares_line(p: Array, t: Array) -> Array:
    """Return s p + b, s >= 0, nearest to t in least squares."""
    centred, target = p - p.mean(), t - t.mean()
    ratio = _ratio(float(centred @ target), float(centred @ centred))
    return np.asarray(ratio * centred + t.mean())


def _ratio(above: float, below: float) -> float:
    return max(above / below, 0.0) if below > 0.0 else 0.0

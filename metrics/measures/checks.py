"""What every measure refuses: arrays of the wrong kind, values that are not finite, no values."""

from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenegen.camera import Lens, as_lens
from scenegen.common.errors import SceneGenError

# The squares of larger magnitudes overflow within a sum; no scene or prediction comes near.
LARGEST_MAGNITUDE = 1e100


class MeasureError(SceneGenError):
    """Arrays or parameters that cannot be scored."""


class NonFiniteError(MeasureError):
    """A NaN, an infinity or an absurdly large magnitude where a number is scored."""


class NoDirectionError(MeasureError):
    """A vector of length 0 where a direction is scored."""


class EmptyError(MeasureError):
    """Nothing to score: an empty cloud, an empty mask, no questions."""


def require(ok: bool, where: str, found: object, expected: str) -> None:
    """Raise MeasureError with these fields unless `ok`."""
    if not ok:
        raise MeasureError(where, found, expected)


def require_some(count: float, where: str) -> None:
    """Raise EmptyError where there is nothing to score."""
    if count < 1:
        raise EmptyError(where, "none", "at least one")


def as_float64(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """Return real numbers as a float64 array; masked ones become NaN.

    Raises MeasureError on booleans, complex numbers, text and ragged input.
    """
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise MeasureError(what, error, "an array of numbers") from error
    require(array.dtype.kind in "fiu", what, f"dtype {array.dtype}", "real numbers")
    array = array.astype(np.float64, copy=False)
    if _is_masked(values):
        array = np.where(np.ma.getmaskarray(values), np.nan, array)
    return array


def _is_masked(values: ArrayLike) -> TypeGuard[np.ma.MaskedArray[Any, Any]]:
    return isinstance(values, np.ma.MaskedArray)


def require_finite(
    values: NDArray[np.float64], what: str, mask: NDArray[np.bool_] | None = None
) -> None:
    """Raise NonFiniteError, with the count and the first index, unless all values are finite.

    `mask` covers the leading axes of `values`; what lies outside it is not looked at. The index
    in the message is (row, column, ...) in `values`.
    """
    good = np.abs(values) <= LARGEST_MAGNITUDE  # False for NaN too
    if mask is not None:
        good |= ~mask.reshape(mask.shape + (1,) * (values.ndim - mask.ndim))
    if good.all():
        return
    first = tuple(int(i) for i in np.unravel_index(int(np.argmin(good)), good.shape))
    raise NonFiniteError(
        what,
        f"{np.count_nonzero(~good)} of {good.size} values not finite or beyond"
        f" {LARGEST_MAGNITUDE:g}, the first is {values[first]} at index {first}",
        "finite numbers",
    )


def require_mask(mask: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return the mask if it is boolean, has this shape and contains a pixel; else raise."""
    inside = np.asarray(mask)
    ok = inside.dtype == np.bool_ and inside.shape == shape
    require(ok, "mask", f"{inside.dtype} {inside.shape}", f"bool {shape}")
    require_some(int(np.count_nonzero(inside)), "mask")
    return inside


def require_depth_pair(
    predicted_depth: ArrayLike, true_depth: ArrayLike, mask: NDArray[np.bool_] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return predicted and true depth, both of one shape and finite inside the mask, and the mask.

    The mask is the truth's: the given one, or the pixels where the truth is finite.
    """
    predicted = as_float64(predicted_depth, "predicted depth")
    true = as_float64(true_depth, "true depth")
    same = predicted.shape == true.shape
    require(same, "predicted depth", f"shape {predicted.shape}", f"the truth's {true.shape}")
    inside = require_mask(np.isfinite(true) if mask is None else mask, true.shape)
    require_finite(predicted, "predicted depth", inside)
    require_finite(true, "true depth", inside)
    return predicted, true, inside


def require_fov(lens: Lens | float) -> None:
    """Raise MeasureError unless this is a vertical field of view of a pinhole camera, degrees."""
    fov_y_degrees = as_lens(lens).fov_y_degrees
    require(0.0 < fov_y_degrees < 180.0, "fov_y_degrees", fov_y_degrees, "between 0 and 180")

"""What every metric refuses: numbers that are not numbers, and nothing at all."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Squares of larger magnitudes overflow within a sum; no scene or prediction comes near.
LARGEST_MAGNITUDE = 1e100


class NonFiniteError(ValueError):
    """A NaN, an infinity or an absurdly large magnitude where a number is scored."""


class NoDirectionError(ValueError):
    """A vector of length 0 where a direction is scored."""


class EmptyError(ValueError):
    """Nothing to score: an empty cloud, an empty mask, no questions."""


def as_float64(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """Real numbers as a float64 array; booleans, complex, text and ragged input are ValueErrors."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{what}: not an array of numbers ({error})") from error
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{what}: expected real numbers, got dtype {array.dtype}")
    return array.astype(np.float64, copy=False)


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
    count = int(np.count_nonzero(~good))
    first = tuple(int(i) for i in np.unravel_index(int(np.argmin(good)), good.shape))
    raise NonFiniteError(
        f"{what}: {count} of {good.size} values are not finite or exceed "
        f"{LARGEST_MAGNITUDE:g}; the first is {values[first]} at index {first}"
    )


def require_mask(mask: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """The mask, if it is boolean, has this shape and holds a pixel."""
    inside = np.asarray(mask)
    if inside.dtype != np.bool_ or inside.shape != shape:
        raise ValueError(f"expected a boolean mask {shape}, got {inside.dtype} {inside.shape}")
    if not inside.any():
        raise EmptyError("the mask holds no pixel")
    return inside


def require_depth_pair(
    predicted_depth: ArrayLike, true_depth: ArrayLike, mask: NDArray[np.bool_] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Predicted and true depth of one shape, finite inside the mask, and the mask.

    The mask is the truth's: as given, or where the truth is finite.
    """
    predicted = as_float64(predicted_depth, "predicted depth")
    true = as_float64(true_depth, "true depth")
    if predicted.shape != true.shape:
        raise ValueError(f"predicted depth has shape {predicted.shape}, the truth {true.shape}")
    inside = require_mask(np.isfinite(true) if mask is None else mask, true.shape)
    require_finite(predicted, "predicted depth", inside)
    require_finite(true, "true depth", inside)
    return predicted, true, inside


def require_fov(fov_y_degrees: float) -> None:
    """Raise ValueError unless this is a field of view of a pinhole camera."""
    if not 0.0 < fov_y_degrees < 180.0:
        raise ValueError(f"fov_y_degrees must lie between 0 and 180, got {fov_y_degrees}")

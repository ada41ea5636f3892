"""What the pixels of one predicted image must be: the writer and `validate` ask for the same."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.checks import LARGEST_MAGNITUDE

Array = NDArray[Any]
Mask = NDArray[np.bool_]

EXPECTED = {
    "finite": "finite numbers wherever the truth shows a surface",
    "length": "normals of a length above 0 wherever the truth shows a surface",
}
GOT = {"finite": "NaN, infinite or huge", "length": "length 0"}


def depth_faults(depth: Array, mask: Mask) -> dict[str, Mask]:
    """Rules that a predicted depth (H, W) breaks, and at which pixels (H, W).

    The mask tells where the truth shows a surface; elsewhere anything goes.
    """
    return _broken({"finite": ~_finite(depth) & mask})


def normal_faults(normal: Array, mask: Mask) -> dict[str, Mask]:
    """Rules that predicted normals (H, W, 3) break, and at which pixels (H, W)."""
    good = _finite(normal).all(axis=-1)
    return _broken({"finite": ~good & mask, "length": good & ~normal.any(axis=-1) & mask})


def faces_away(depth: Array, mask: Mask) -> bool:
    """Whether more than half of a depth map (H, W) is not in front of the camera: not above 0.

    Every value that is not NaN has a score, so this breaks no rule, but it is the mark of a sign
    mistake.
    """
    return 2 * int(np.count_nonzero(depth[mask] <= 0.0)) > int(np.count_nonzero(mask))


def _finite(values: Array) -> Mask:
    return np.asarray(np.abs(values.astype(np.float64)) <= LARGEST_MAGNITUDE)


def _broken(faults: dict[str, Mask]) -> dict[str, Mask]:
    return {rule: at for rule, at in faults.items() if at.any()}

"""Relief: how far a surface stands before the empty room, along the viewing axis.

The relief of a pixel is the planar depth of the empty room minus that of the surface, in scene
units. It is 0 on floor and walls, and above 0 on objects. Both scores look at shape and place of
what stands out: a prediction that is the empty room, moved, tilted or scaled, has nothing there.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require_depth_pair, require_finite

RELIEF_ABOVE = 0.05  # scene units: pixels with more than this stand out
# Scene units. A predicted relief that varies less counts as if it varied so much: without this,
# rounding to half precision, or noise of any size, could be taken for relief.
LEAST_SPREAD = 1e-3


def relief_scores(
    predicted_depth: ArrayLike,
    true_depth: ArrayLike,
    empty_depth: ArrayLike,
    mask: NDArray[np.bool_] | None = None,
) -> dict[str, float]:
    """Return `relief_correlation` and `relief_iou` of planar depth images (H, W) of one camera.

    With p and t the predicted and the true relief of the scored pixels:

    - relief_correlation: cov(p, t) / (max(std(p), least) std(t)), in [-1, 1], where least is
      LEAST_SPREAD, or std(t) where that is smaller. This is Pearson's correlation for every
      prediction with as much relief, and goes to 0 as the relief of a prediction does.
    - relief_iou: pixels where p and t both exceed RELIEF_ABOVE, divided by those where either does.

    Both are NaN where t exceeds RELIEF_ABOVE nowhere: nothing stands out that could be found. The
    mask is that of the truth; raises as `checks.require_depth_pair`.
    """
    predicted, true, inside = require_depth_pair(predicted_depth, true_depth, mask)
    empty = as_float64(empty_depth, "depth of the empty room")
    require_finite(empty, "depth of the empty room", inside)
    p, t = ((empty - depth)[inside] for depth in (predicted, true))
    truly = t > RELIEF_ABOVE
    if not truly.any():
        return {"relief_correlation": np.nan, "relief_iou": np.nan}
    said = p > RELIEF_ABOVE
    p, t = p - p.mean(), t - t.mean()
    spread = float(t.std())
    least = max(float(p.std()), min(LEAST_SPREAD, spread))
    # A picture that is one surface all over has no spread.
    correlation = float((p * t).mean()) / (least * spread) if spread > 0.0 else 0.0
    return {
        "relief_correlation": min(max(correlation, -1.0), 1.0),
        "relief_iou": float((said & truly).sum() / (said | truly).sum()),
    }

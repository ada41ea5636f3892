"""The places within a pixel at which its colour is sampled, for `--spp` above 1.

Ground truth does not depend on them: it comes from the ray through the pixel's centre alone.
"""

import numpy as np
from numpy.typing import NDArray

SAMPLE_STEPS = (0.7548776662466927, 0.5698402909980532)  # of M. Roberts' R2 sequence


def sample_positions(spp: int) -> NDArray[np.float64]:
    """Return the positions of a pixel's colour samples, (spp, 2), in pixels from its corner.

    They are the centre, if their number is odd, and pairs that mirror each other in the centre, so
    that the colour is never shifted against the depth. The pairs follow a low-discrepancy sequence.
    """
    pairs = (0.5 + np.arange(1, spp // 2 + 1)[:, None] * np.array(SAMPLE_STEPS)) % 1.0
    mirrored = np.stack([pairs, 1.0 - pairs], axis=1).reshape(-1, 2)
    return np.concatenate([np.full((spp % 2, 2), 0.5), mirrored])

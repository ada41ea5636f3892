"""Hints on normals in another frame, of another direction, or in another encoding."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.submissions.hints.samples import Sample
from metrics.submissions.problems import HINT, Problem

Array = NDArray[Any]
BETTER = 0.5  # fraction of the mean angle that may remain after a remedy
SHARE = 0.6  # fraction of the images in which a remedy must help so much
CLOSE_DEGREES = 30.0  # largest mean angle after a remedy


def normal_hints(samples: Sequence[Sample]) -> list[Problem]:
    """Return a hint on the remedy that explains the predicted normals, if there is one."""
    with np.errstate(all="ignore"):  # whatever comes out not finite satisfies no rule
        pairs = [(s, s.normal) for s in samples if s.normal is not None]
        as_given = np.array([_mean_angle(s, normal) for s, normal in pairs])
        best, found = CLOSE_DEGREES, None
        for text, remedy in _REMEDIES.items():
            angles = np.array([_mean_angle(s, remedy(normal, s)) for s, normal in pairs])
            good = (angles <= BETTER * as_given) & (angles <= CLOSE_DEGREES)
            if good.size and good.mean() >= SHARE and np.nanmedian(angles) < best:
                best, found = float(np.nanmedian(angles)), text
    expected = "vectors in the camera frame (x right, y up, z towards the viewer) facing the viewer"
    return [] if found is None else [Problem("normal", HINT, expected, found)]


def _mean_angle(sample: Sample, normal: Array) -> float:
    """Return the mean angle to the true normals, in degrees; NaN where few can be compared."""
    mask = sample.mask & sample.true_normal.any(axis=-1)
    p, t = normal[mask], sample.true_normal[mask]
    p = p / np.abs(p).max(axis=-1, keepdims=True)
    cosine = (p * t).sum(axis=-1) / np.linalg.norm(p, axis=-1)
    angles = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    angles = angles[np.isfinite(angles)]
    return float(angles.mean()) if 2 * len(angles) > np.count_nonzero(mask) else float("nan")


def _signs(x: float, y: float, z: float) -> Callable[[Array, Sample], Array]:
    return lambda normal, _: normal * np.array([x, y, z])


def _decoded(most: float) -> Callable[[Array, Sample], Array]:
    return lambda normal, _: 2.0 * normal / most - 1.0


_REMEDIES: dict[str, Callable[[Array, Sample], Array]] = {
    "looks flipped: facing away from the viewer": _signs(-1, -1, -1),
    "looks like the world frame, not the camera frame": lambda n, s: n @ s.camera_from_world.T,
    "looks like y down and z forward (OpenCV): both axes flipped": _signs(1, -1, -1),
    "looks like the y axis flipped: y down": _signs(1, -1, 1),
    "looks like the z axis flipped": _signs(1, 1, -1),
    "looks like the x axis flipped": _signs(-1, 1, 1),
    "looks like x and y flipped": _signs(-1, -1, 1),
    "looks like x and z flipped": _signs(-1, 1, -1),
    "looks like x and z swapped (BGR for RGB)": lambda n, _: n[..., ::-1],
    "looks encoded as a picture, 0..1 for -1..1": _decoded(1.0),
    "looks encoded as a picture, 0..255 for -1..1": _decoded(255.0),
}

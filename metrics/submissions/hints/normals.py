"""Hints on normals in another frame, of another direction, or in another encoding."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.submissions.hints.frames import AXES, frame_text
from metrics.submissions.hints.samples import Sample
from metrics.submissions.problems import HINT, Problem

Array = NDArray[Any]
BETTER = 0.5  # fraction of the mean angle that may remain after a remedy
SHARE = 0.6  # fraction of the images in which a remedy must help so much
CLOSE_DEGREES = 30.0  # largest mean angle after a remedy
SIMPLER = 0.9  # fraction of its angle that a remedy must reach to win over a simpler one
ONE_SIGN = 0.98  # fraction of the values of a coded axis that have its sign
CODES = {1.0: "an image, 0..1 for -1..1", 255.0: "an image, 0..255 for -1..1"}


def normal_hints(samples: Sequence[Sample]) -> list[Problem]:
    """Return a hint on the remedy that explains the predicted normals, if there is one."""
    pairs = [(s, s.normal) for s in samples if s.normal is not None]
    if not pairs:
        return []
    with np.errstate(all="ignore"):  # whatever comes out not finite satisfies no rule
        given = np.array([_angles(s, normal, of_world=False)[0] for s, normal in pairs])
        best, found = np.inf, None
        for text, decoded in _decoded([normal for _, normal in pairs]):
            for of_world in (False, True):
                angles = np.array(
                    [_angles(s, n, of_world) for (s, _), n in zip(pairs, decoded, strict=True)]
                )
                good = (angles <= BETTER * given[:, None]) & (angles <= CLOSE_DEGREES)
                medians = np.where(good.mean(axis=0) >= SHARE, np.median(angles, axis=0), np.inf)
                # The first of AXES is the simplest, then those of one code alone.
                k = 0 if medians[0] <= medians.min() / SIMPLER else int(medians.argmin())
                if medians[k] < SIMPLER * best:
                    best = float(medians[k])
                    frame = frame_text(AXES[k], of_world) if k or of_world else ""
                    found = ", and like ".join(filter(None, (text, frame)))
    if found is None:
        return []
    numbers = f"{np.median(given):.0f} degrees as given, {best:.0f} after the fix"
    expected = "vectors in the camera frame (x right, y up, z towards the viewer) facing the viewer"
    return [Problem("normal", HINT, expected, f"looks like {found} ({numbers})")]


def _decoded(normals: Sequence[Array]) -> Iterator[tuple[str, list[Array]]]:
    """Yield normals as they are, and decoded where each axis has one sign; with what they were."""
    yield "", list(normals)
    together = np.concatenate([n.reshape(-1, 3) for n in normals])
    together = together[np.isfinite(together).all(axis=-1)]
    positive = (together >= 0.0).mean(axis=0) if len(together) else np.full(3, 0.5)
    if (np.maximum(positive, 1.0 - positive) >= ONE_SIGN).all():
        for most, text in CODES.items():
            yield text, [2.0 * np.abs(n) / most - 1.0 for n in normals]


def _angles(sample: Sample, normal: Array, of_world: bool) -> Array:
    """Return the mean angle to the true normals, degrees, for each of AXES, (48,).

    NaN where few can be compared.
    """
    mask = sample.mask & sample.true_normal.any(axis=-1)
    p, t = normal[mask], sample.true_normal[mask]
    p = p / np.abs(p).max(axis=-1, keepdims=True)
    p = p / np.linalg.norm(p, axis=-1, keepdims=True)
    known = np.isfinite(p).all(axis=-1)
    if 2 * np.count_nonzero(known) <= len(p):
        return np.full(len(AXES), np.nan)
    p, t = p[known], t[known]
    if of_world:
        t = t @ sample.camera_from_world
    cosines = np.einsum("aij,nj,ni->an", AXES, p, t, optimize=True)
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))).mean(axis=1))

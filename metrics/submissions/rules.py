"""What the values of a submission must be: writers, the reader and `validate` ask for the same."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import ABSTAINED, MOST_CANDIDATES
from metrics.measures.checks import LARGEST_MAGNITUDE
from metrics.submissions.problems import Problem, first_ids
from scenegen.common.errors import SceneGenError

Array = NDArray[Any]
Ids = NDArray[np.int64]
Mask = NDArray[np.bool_]

# Of depths and normals: what single precision holds. All scores of such values are finite, and so
# are the squares that intervals need of them.
LARGEST = float(np.finfo(np.float32).max)
EXPECTED = {
    "finite": "finite numbers wherever the truth shows a surface",
    "length": "normals of a length above 0 wherever the truth shows a surface",
}
FOUND = {"finite": "NaN, infinite or huge", "length": "length 0"}


def depth_faults(depth: Array, mask: Mask) -> dict[str, Mask]:
    """Return which rules a predicted depth (H, W) breaks, and at which pixels (H, W).

    The mask tells where the truth shows a surface; elsewhere any value is allowed.
    """
    return _broken({"finite": ~_finite(depth) & mask})


def normal_faults(normal: Array, mask: Mask) -> dict[str, Mask]:
    """Return which rules predicted normals (H, W, 3) break, and at which pixels (H, W)."""
    good = _finite(normal).all(axis=-1)
    return _broken({"finite": ~good & mask, "length": good & ~normal.any(axis=-1) & mask})


def refuse_faults(faults: Mapping[str, Mask], kind: type[SceneGenError], where: str) -> None:
    """Raise an error of this kind with the first of the faults, if there are any."""
    for rule, at in faults.items():
        first = tuple(np.argwhere(at)[0].tolist())
        found = f"{FOUND[rule]} at {np.count_nonzero(at)} pixels, the first at {first}"
        raise kind(where, found, EXPECTED[rule])


def faces_away(depth: Array, mask: Mask) -> bool:
    """Return whether more than half of a depth map (H, W) is at or behind the camera.

    Such values can be scored, so this breaks no rule, but it is the mark of a wrong sign.
    """
    return 2 * int(np.count_nonzero(depth[mask] <= 0.0)) > int(np.count_nonzero(mask))


def id_problems(ids: Ids, name: str) -> list[Problem]:
    """Return which ids (M,) are negative or come twice, and whether there are none."""
    if len(ids) == 0:
        return [Problem(name, "count", "at least one", "no rows")]
    problems = []
    negative = np.unique(ids[ids < 0])
    if len(negative):
        found = f"{len(negative)} negative"
        problems.append(Problem(name, "range", "0 or more", found, first_ids(negative)))
    values, counts = np.unique(ids, return_counts=True)
    twice = values[counts > 1]
    if len(twice):
        found = f"{len(twice)} given more than once"
        problems.append(Problem(name, "unique", "each once", found, first_ids(twice)))
    return problems


def answer_problems(
    answers: Array, ids: Ids, name: str = "answer", candidates: int = MOST_CANDIDATES
) -> list[Problem]:
    """Return which answers (M,) are neither -1 nor one of 0 to `candidates` - 1."""
    wrong = (answers < ABSTAINED) | (answers >= candidates)
    if not wrong.any():
        return []
    found = f"{np.count_nonzero(wrong)} outside -1 to {candidates - 1}, such as {answers[wrong][0]}"
    expected = f"{', '.join(map(str, range(candidates)))}, or -1"
    return [Problem(name, "range", expected, found, first_ids(ids[wrong]))]


def score_problems(scores: Array, ids: Ids) -> list[Problem]:
    """Return which scores (M, A) are not finite numbers."""
    wrong = ~_finite(scores, LARGEST_MAGNITUDE).all(axis=1)
    if not wrong.any():
        return []
    found = f"NaN, infinite or huge at {np.count_nonzero(wrong)} questions"
    return [Problem("scores", "finite", "finite numbers", found, first_ids(ids[wrong]))]


def agreement_problems(answers: Ids, from_scores: Ids, ids: Ids) -> list[Problem]:
    """Return where answers (M,) are not those of the highest scores."""
    differs = answers != from_scores
    if not differs.any():
        return []
    found = f"other than scores say at {np.count_nonzero(differs)} questions"
    expected = "the highest of scores, -1 where it is tied"
    return [Problem("answer", "agreement", expected, found, first_ids(ids[differs]))]


def as_doubles(values: Array) -> NDArray[np.float64]:
    """Return stored floats in double precision; NaN of any kind stays NaN, without a warning."""
    with np.errstate(invalid="ignore", over="ignore"):
        return values.astype(np.float64)


def _finite(values: Array, largest: float = LARGEST) -> Mask:
    return np.asarray(np.abs(as_doubles(values)) <= largest)


def _broken(faults: dict[str, Mask]) -> dict[str, Mask]:
    return {rule: at for rule, at in faults.items() if at.any()}

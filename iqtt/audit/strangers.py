"""Audit questions of other people, told as lists of cubes and rotations.

    {"questions": [{"reference": {"cubes": [[0, 0, 0], [1, 0, 0]], "rotation": [[1, 0, 0], ...]},
                    "answers": [{"cubes": ..., "rotation": ...}, ...], "key": 0}],
     "camera_distance": 12.0}

A cube at integer c fills [c, c + 1]. A rotation takes the shape to the camera's axes: x right, y
up, z towards the viewer; without one the shape is seen as it lies. `key` is the right answer, from
0. Without `camera_distance`, in cube edges from the middle of the shape, rays are parallel.
"""

import itertools
import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from iqtt.audit.congruence import MIRROR_X, congruent_rows
from iqtt.audit.proofs.shapes import whole_and_count
from scenegen.common.errors import FileFormatError

Array = NDArray[Any]
SIDE = 192  # rays along each side of a picture
SAME = 1e-3  # share of pixels that may differ in pictures that count as equal
CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))  # of a cube
SHIFT = 1e-6  # moves rays off the edges of cubes that lie along the axes
MOST_BYTES = 256 * 2**20
RULES = {
    "hidden cube": "every cube of a shape shows in its picture",
    "no right answer": "an answer shows the reference's shape",
    "more than one right answer": "only one answer shows the reference's shape",
    "achiral mirror image": "a mirror image is another shape than the reference",
    "wrong key": "the key names the right answer",
    "unlike cube counts": "all shapes have as many cubes",
    "equal pictures": "no two pictures are equal",
    "more than one piece": "the cubes of a shape touch face to face",
}


@dataclass(frozen=True)
class Strangers:
    """What is wrong with questions of other people.

    Attributes:
        faults: for each question, the names of RULES that it breaks, each with a detail.
        key_counts: how often each answer is the right one.
        key_p_value: probability of keys at least as uneven by chance; exact by simulation.
    """

    faults: tuple[dict[str, str], ...]
    key_counts: dict[int, int]
    key_p_value: float

    @property
    def passed(self) -> bool:
        """Whether no question breaks a rule."""
        return not any(self.faults)

    def count(self, rule: str) -> int:
        """Return how many questions break a rule."""
        return sum(rule in faults for faults in self.faults)


def audit_strangers(
    path: str | Path, progress: Callable[[int], Any] = lambda done: None
) -> Strangers:
    """Check the questions of a JSON file.

    Raises OSError, and FileFormatError that names the question and what is wrong with it.
    """
    questions, distance = _read(Path(path))
    faults = []
    for number, question in enumerate(questions):
        faults.append(_faults(f"{path}: question {number}", question, distance))
        progress(1)
    keys = [question["key"] for question in questions if "key" in question]
    counts = Counter(keys)
    most = max((len(question["answers"]) for question in questions), default=0)
    table = [counts[k] for k in range(most)]
    p_value = float(stats.chisquare(table).pvalue) if sum(table) else 1.0
    return Strangers(tuple(faults), {k: counts[k] for k in range(most)}, p_value)


def report(found: Strangers) -> str:
    """Return what was found as lines of text."""
    total = len(found.faults)
    lines = [f"{total} questions", ""]
    for rule, expected in RULES.items():
        count = found.count(rule)
        first = next((i for i, faults in enumerate(found.faults) if rule in faults), None)
        example = "" if first is None else f"; question {first}: {found.faults[first][rule]}"
        mark = "ok  " if count == 0 else "FAIL"
        lines.append(f"  {mark} {rule}: {count} ({count / max(1, total):.1%}){example}")
        lines += [] if count == 0 else [f"       expected: {expected}"]
    keys = ", ".join(f"{key}: {count}" for key, count in found.key_counts.items())
    lines += ["", f"  keys {keys}; p = {found.key_p_value:.3g} if keys are even"]
    return "\n".join(lines)


def as_json(found: Strangers) -> str:
    """Return what was found, question by question."""
    value = {
        "questions": len(found.faults),
        "passed": found.passed,
        "counts": {rule: found.count(rule) for rule in RULES},
        "key_counts": found.key_counts,
        "key_p_value": found.key_p_value,
        "faults": found.faults,
    }
    return json.dumps(value, indent=1) + "\n"


def _read(path: Path) -> tuple[list[dict[str, Any]], float]:
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(path, f"{path.stat().st_size} bytes", f"at most {MOST_BYTES}")
    try:
        value = json.loads(path.read_bytes())
    except ValueError as error:
        raise FileFormatError(path, f"no JSON: {error}", "JSON") from error
    value = {"questions": value} if isinstance(value, list) else value
    if not isinstance(value, dict) or not isinstance(value.get("questions"), list):
        raise FileFormatError(path, "no list of questions", "a list, or an object with `questions`")
    if not value["questions"]:
        raise FileFormatError(path, "no questions", "at least one")
    distance = value.get("camera_distance", np.inf)
    if isinstance(distance, bool) or not isinstance(distance, int | float) or not distance > 0:
        raise FileFormatError(f"{path}: camera_distance", distance, "a number above 0")
    questions = []
    for number, question in enumerate(value["questions"]):
        questions.append(_question(f"{path}: question {number}", question))
    return questions, float(distance)


def _question(place: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict) or not {"reference", "answers"} <= value.keys():
        raise FileFormatError(place, "no reference or no answers", "both")
    if not isinstance(value["answers"], list) or len(value["answers"]) < 2:
        raise FileFormatError(f"{place}: answers", "fewer than two", "two or more")
    question: dict[str, Any] = {
        "reference": _view(f"{place}: reference", value["reference"]),
        "answers": [_view(f"{place}: answer {k}", a) for k, a in enumerate(value["answers"])],
    }
    key = value.get("key")
    if key is not None:
        if not isinstance(key, int) or not 0 <= key < len(value["answers"]):
            raise FileFormatError(f"{place}: key", f"{key!r:.40}", "the number of an answer from 0")
        question["key"] = key
    return question


def _view(place: str, value: Any) -> tuple[Array, Array]:
    """Return the cubes (n, 3) and the rotation (3, 3) of a picture."""
    if not isinstance(value, Mapping) or "cubes" not in value:
        raise FileFormatError(place, "no cubes", "an object with `cubes`")
    try:
        cubes = np.array(value["cubes"])
        rotation = np.array(value.get("rotation", np.eye(3)), np.float64)
    except (ValueError, TypeError) as error:
        raise FileFormatError(place, f"{error}"[:100], "lists of numbers") from error
    whole = cubes.dtype.kind in "iu" and cubes.ndim == 2 and cubes.shape[1:] == (3,)
    if not whole or not 1 <= len(cubes) <= 100 or np.abs(cubes).max() > 100:
        raise FileFormatError(f"{place}: cubes", "another list", "1 to 100 triples of integers")
    if len(np.unique(cubes, axis=0)) < len(cubes):
        raise FileFormatError(f"{place}: cubes", "a cube twice", "each once")
    proper = rotation.shape == (3, 3) and bool(np.isfinite(rotation).all())
    proper = proper and np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4)
    if not proper or np.linalg.det(rotation) < 0:
        raise FileFormatError(f"{place}: rotation", "another matrix", "a rotation, 3 x 3")
    return cubes.astype(np.int64), rotation


def _faults(place: str, question: Mapping[str, Any], distance: float) -> dict[str, str]:
    views = [question["reference"], *question["answers"]]
    names = ["the reference", *(f"answer {k}" for k in range(len(views) - 1))]
    faults: dict[str, str] = {}
    counts = [len(cubes) for cubes, _ in views]
    if len(set(counts)) > 1:
        faults["unlike cube counts"] = ", ".join(map(str, counts))
    for (cubes, _), name in zip(views, names, strict=True):
        if not whole_and_count(cubes[None, None])[0][0]:
            faults.setdefault("more than one piece", name)
    _check_key(question, faults)
    pictures = []
    for (cubes, rotation), name in zip(views, names, strict=True):
        try:
            depth, pixels = _depth_and_pixels(cubes, rotation, distance)
        except ValueError as error:
            raise FileFormatError(f"{place}: {name}", str(error), "a camera outside") from error
        hidden = np.flatnonzero(pixels == 0)
        if hidden.size:
            faults.setdefault("hidden cube", f"{name}, cube {cubes[hidden[0]].tolist()}")
        pictures.append(depth)
    for i, first in enumerate(pictures):
        for j in range(i + 1, len(pictures)):
            if _equal(first, pictures[j]):
                faults.setdefault("equal pictures", f"{names[i]} and {names[j]}")
    return faults


def _check_key(question: Mapping[str, Any], faults: dict[str, str]) -> None:
    reference = question["reference"][0]
    right = [k for k, (cubes, _) in enumerate(question["answers"]) if _same(reference, cubes)]
    if not right:
        faults["no right answer"] = "none is the reference turned"
    if len(right) > 1:
        faults["more than one right answer"] = f"answers {right}"
        if _same(reference, reference * MIRROR_X):
            faults["achiral mirror image"] = "a rotation takes the reference to its mirror image"
    if right and question.get("key", right[0]) not in right:
        faults["wrong key"] = f"{question['key']}, where {right} is right"


def _same(a: Array, b: Array) -> bool:
    return len(a) == len(b) and bool(congruent_rows(a[None], b[None])[0])


def _depth_and_pixels(cubes: Array, rotation: Array, distance: float) -> tuple[Array, Array]:
    """Cast rays at a turned shape; return depth (SIDE, SIDE), NaN beside it, and pixels a cube.

    Depth counts from the middle of the shape towards the viewer. Rays meet the unit cubes in the
    shape's own frame, by slabs.
    """
    middle = (cubes.min(axis=0) + cubes.max(axis=0) + 1) / 2
    low = cubes - middle
    radius = float(np.linalg.norm(np.abs(low + 0.5) + 0.5, axis=1).max())
    if distance <= radius:
        raise ValueError(f"a camera at {distance:g} inside the shape")
    place = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1 + SHIFT
    x, y = np.meshgrid(place * radius, -place * radius)
    if np.isinf(distance):
        origins = np.stack([x, y, np.full_like(x, 2 * radius)], axis=-1)
        directions = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    else:
        origins = np.broadcast_to([0.0, 0.0, distance], (SIDE, SIDE, 3))
        wide = distance / np.sqrt(distance**2 - radius**2)  # the sphere's outline fills the picture
        directions = np.stack([x * wide, y * wide, np.full_like(x, -distance)], axis=-1)
    origins, directions = origins @ rotation + SHIFT, directions @ rotation + SHIFT**2
    nearest = np.full((SIDE, SIDE), np.inf)
    owner = np.full((SIDE, SIDE), -1)
    for number, corner in enumerate(low):
        seen = (corner + CORNERS) @ rotation.T
        at = seen[:, :2] / radius
        if np.isfinite(distance):
            at = at * (distance / wide) / (distance - seen[:, 2:])
        # Only rays within the box around the corners' places in the picture can meet the cube.
        column, row = ((at * [1, -1] + 1) / 2 * SIDE).T
        part = np.s_[_span(row), _span(column)]
        ends = (np.stack([corner, corner + 1])[:, None, None] - origins[part]) / directions[part]
        enter, leave = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
        closer = (enter < leave) & (enter < nearest[part])
        nearest[part][closer], owner[part][closer] = enter[closer], number
    hit = owner >= 0
    points = origins[hit] + nearest[hit][:, None] * directions[hit]
    depth = np.full((SIDE, SIDE), np.nan)
    depth[hit] = points @ rotation[2]
    return depth, np.bincount(owner[hit], minlength=len(cubes))


def _span(places: Array) -> slice:
    """Return the pixels from the first place to the last, with one more at each end."""
    return slice(max(int(places.min()) - 1, 0), int(places.max()) + 2)


def _equal(first: Array, other: Array) -> bool:
    seen = np.isfinite(first) & np.isfinite(other)
    differs = np.isfinite(first) != np.isfinite(other)
    differs[seen] = np.abs(first[seen] - other[seen]) > 0.05
    return bool(differs.mean() < SAME)

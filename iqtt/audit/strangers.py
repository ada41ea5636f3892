"""Audit questions of other people, told as lists of cubes and rotations.

    {"questions": [{"reference": {"cubes": [[0, 0, 0], [1, 0, 0]], "rotation": [[1, 0, 0], ...]},
                    "answers": [{"cubes": ..., "rotation": ...}, ...], "key": 0}],
     "camera_distance": 12.0}

A cube at integer c fills [c, c + 1]. A rotation takes the shape to the camera's axes: x right, y
up, z towards the viewer; without one the shape is seen as it lies. `key` is the right answer, from
0. Without `camera_distance`, in cube edges from the middle of the shape, rays are parallel.
"""

import itertools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.congruence import congruent_rows
from iqtt.audit.proofs.shapes import whole_and_count
from scenegen.common.records import check, from_json
from scenegen.files.input_file import describing

Array = NDArray[Any]
SIDE = 192  # rays along each side of a picture
SAME, NEAR = 1e-3, 0.05  # share of pixels by which equal pictures differ; depth of one pixel
SHIFT = 1e-6  # moves rays off the edges of cubes that lie along the axes
MOST_BYTES = 256 * 2**20
AS_IT_LIES = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
RULES = (
    "hidden cube", "no correct option", "more than one correct option", "wrong key",
    "different cube counts", "equal images", "more than one piece",
)  # fmt: skip


@dataclass(frozen=True)
class View:
    """A shape of cubes, and the rotation to the camera's axes."""

    cubes: tuple[tuple[int, int, int], ...]
    rotation: tuple[tuple[float, float, float], ...] = AS_IT_LIES

    def __post_init__(self) -> None:
        few = 1 <= len(self.cubes) <= 100 and np.abs(self.cubes).max() <= 100
        check(few and len(set(self.cubes)) == len(self.cubes), "cubes", "others", "1 to 100, once")
        turn = np.array(self.rotation)
        proper = turn.shape == (3, 3) and np.allclose(turn @ turn.T, np.eye(3), atol=1e-4)
        check(proper and np.linalg.det(turn) > 0, "rotation", "another matrix", "a rotation, 3 x 3")


@dataclass(frozen=True)
class Question:
    """A reference, its answers, and the right one if it is told."""

    reference: View
    answers: tuple[View, ...]
    key: int | None = None

    def __post_init__(self) -> None:
        check(len(self.answers) > 1, "answers", len(self.answers), "two or more")


@dataclass(frozen=True)
class Questions:
    """A file of questions; where its rays are parallel, the camera is far away."""

    questions: tuple[Question, ...]
    camera_distance: float = 1e5


def audit_strangers(path: str | Path, progress: Callable[[int], Any]) -> dict[str, Any]:
    """Check the questions of a JSON file.

    Returns the number of `questions`, whether all `passed`, in how many each of RULES is broken
    (`counts`), how often each answer is right (`key_counts`), and the `faults` of each question.

    Raises OSError, and FileFormatError that names the question and what is wrong with it.
    """
    with describing(str(path)):
        file = from_json(Questions, Path(path).read_bytes(), "questions", MOST_BYTES)
        check(len(file.questions) > 0, "questions", 0, "at least one")
    faults = []
    for number, question in enumerate(file.questions):
        with describing(f"{path}: question {number}"):
            faults.append(_faults(question, file.camera_distance))
        progress(1)
    keys = Counter(question.key for question in file.questions)
    return {
        "questions": len(faults),
        "passed": not any(faults),
        "counts": {rule: sum(rule in fault for fault in faults) for rule in RULES},
        "key_counts": {k: keys[k] for k in range(max(len(q.answers) for q in file.questions))},
        "faults": faults,
    }


def _faults(question: Question, distance: float) -> dict[str, str]:
    views = {"the reference": question.reference}
    views |= {f"option {k}": view for k, view in enumerate(question.answers)}
    shapes = {name: np.array(view.cubes) for name, view in views.items()}
    faults: dict[str, str] = {}
    if len({len(cubes) for cubes in shapes.values()}) > 1:
        faults["different cube counts"] = ", ".join(str(len(cubes)) for cubes in shapes.values())
    reference, *answers = shapes.values()

    def same(cubes: Array) -> bool:
        return len(cubes) == len(reference) and bool(congruent_rows(reference[None], cubes[None]))

    right = [k for k, cubes in enumerate(answers) if same(cubes)]
    if not right:
        faults["no correct option"] = "no option is the rotated reference"
    if len(right) > 1:
        faults["more than one correct option"] = f"options {right}"
    if right and question.key not in (None, *right):
        faults["wrong key"] = f"{question.key}, but the correct option is {right}"
    pictures = {}
    for name, cubes in shapes.items():
        if not whole_and_count(cubes[None, None])[0][0]:
            faults.setdefault("more than one piece", name)
        pictures[name], pixels = _depth_and_pixels(cubes, np.array(views[name].rotation), distance)
        if not pixels.all():
            hidden = cubes[int(pixels.argmin())].tolist()
            faults.setdefault("hidden cube", f"{name}, cube {hidden}")
    for (first, depth), (second, other) in itertools.combinations(pictures.items(), 2):
        if (~np.isclose(depth, other, rtol=0, atol=NEAR, equal_nan=True)).mean() < SAME:
            faults.setdefault("equal images", f"{first} and {second}")
    return faults


def _depth_and_pixels(cubes: Array, rotation: Array, distance: float) -> tuple[Array, Array]:
    """Cast rays at a turned shape; return depth (SIDE, SIDE), NaN beside it, and pixels a cube.

    Depth counts from the middle of the shape towards the viewer. Rays meet the unit cubes in the
    shape's own frame, by slabs.
    """
    low = cubes - (cubes.min(axis=0) + cubes.max(axis=0) + 1) / 2
    radius = float(np.linalg.norm(np.abs(low + 0.5) + 0.5, axis=1).max())
    check(distance > radius, "camera distance", distance, f"above {radius:.3g}, outside the shape")
    edge = radius / np.sqrt(1 - (radius / distance) ** 2)  # the sphere's outline fills the picture
    place = ((np.arange(SIDE) + 0.5) / SIDE * 2 - 1 + SHIFT) * edge / distance
    x, y = np.meshgrid(place, -place)
    directions = np.stack([x, y, np.full_like(x, -1)], axis=-1) @ rotation + SHIFT**2
    eye = np.array([0, 0, distance]) @ rotation + SHIFT
    nearest, owner = np.full((SIDE, SIDE), np.inf), np.full((SIDE, SIDE), -1)
    for number, corner in enumerate(low):
        ends = (np.stack([corner, corner + 1])[:, None, None] - eye) / directions
        enter, leave = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
        closer = (enter < leave) & (enter < nearest)
        nearest[closer], owner[closer] = enter[closer], number
    hit = owner >= 0
    return np.where(hit, distance - nearest, np.nan), np.bincount(owner[hit], minlength=len(cubes))

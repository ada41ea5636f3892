"""Answers by explicit 3D: decode each picture to cubes, then render those."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.cubes.filling import SIDE, explained, fill, misfit, refine, shown_cells
from baselines.cubes.poses import likely_poses, outline_pixels
from baselines.cubes.segmentation import face_labels
from iqtt.audit.features.statistics import border_color
from iqtt.files.reader import open_questions
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.near import is_chain, is_connected
from iqtt.shapes.polycube import ROTATIONS, bounding_radius, box_centre
from metrics.prediction_writer import write_answers

Array = NDArray[Any]
Progress = Callable[[int, int], Any]
POSES = 8  # rotations of a picture that are tried
# Squared radii of shapes are quarters of integers; shapes of at least 8 cubes are no smaller.
QUARTERS = range(16, 50)
COARSE = 16  # hypotheses of parities, distance and rotation that are filled
ENOUGH = 0.03  # misfit of a decoded picture


@dataclass(frozen=True, eq=False)
class Decoded:
    """Cubes of a picture: (n, 3) integers, the camera's distance, and the share of wrong pixels."""

    cubes: Array
    distance: float
    misfit: float


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture's face labels, (H, W), and its likely poses."""

    labels: Array
    poses: list[Array]


def write_cubes(
    data: str | Path,
    out: str | Path,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Answer the questions of a file from its pictures and settings alone; nothing is learned.

    Raises as `open_questions` and `write_answers`.
    """
    with open_questions(data) as questions:
        height, width = questions.height, questions.width
        spec = questions.spec or SplitSpec(height=height, width=width, min_cube_pixels=0)
        scores = np.zeros((len(questions), questions.answers))
        for row in range(len(questions)):
            images = questions.read("questions", slice(row, row + 1))[0]
            if images.dtype != np.uint8:
                images = np.clip(255 * images.astype(np.float32), 0, 255)
            scores[row] = answer_scores(images, spec, row)
            progress(1, len(questions))
    write_answers(out, data, method="cubes", scores=scores, overwrite=overwrite)


def answer_scores(images: Array, spec: SplitSpec, seed: int = 0) -> Array:
    """Return a score of each answer of a question, (K,): minus the least misfit of a shape that
    explains both the reference and the answer.

    Args:
        images: (1 + K, H, W, 3), 0..255.
        spec: the settings of which the field of view, numbers of cubes and radius are used.
        seed: of the random choices.
    """
    half = math.tan(math.radians(spec.fov_y_degrees) / 2)
    pictures = [picture(image, half, (seed, i)) for i, image in enumerate(images)]
    decoded = [decode(shown, spec, (seed, i)) for i, shown in enumerate(pictures)]
    reference, shape = pictures[0], decoded[0]
    costs = []
    for seen, own in zip(pictures[1:], decoded[1:], strict=True):
        by_reference = max(shape.misfit, explain(shape, seen, half))
        by_answer = max(own.misfit, explain(own, reference, half))
        costs.append(min(by_reference, by_answer))
    return -np.array(costs)


def picture(image: Array, half: float, seed: tuple[int, ...]) -> Picture:
    """Return the labels and likely poses of an image, (H, W, 3) of 0..255."""
    background = border_color(image[None, None]).reshape(-1, 3)[0]
    labels = face_labels(image, background)
    rng = np.random.default_rng((*seed, 1))
    return Picture(labels, likely_poses(outline_pixels(labels, half), POSES, rng))


def decode(shown: Picture, spec: SplitSpec, seed: tuple[int, ...] = (0,)) -> Decoded:
    """Return the cubes that a picture shows; none where no shape of the split's rule fits."""
    half = math.tan(math.radians(spec.fov_y_degrees) / 2)
    labels, step = shown.labels, max(1, min(shown.labels.shape) // 64)
    radii = [math.sqrt(q) / 2 for q in QUARTERS if math.sqrt(q) / 2 <= spec.max_radius]
    distances = [spec.framing_distance(r) for r in radii or [spec.max_radius]]
    hypotheses: list[tuple[float, int, Array, float, Array]] = []
    for pose in shown.poses:
        for parity in itertools.product((0.0, 0.5), repeat=3):
            low = -SIDE / 2 - np.array(parity)
            for distance in distances[::2]:
                value = explained(pose, distance, low, labels, half, 2 * step)
                hypotheses.append((value, len(hypotheses), pose, distance, low))
    hypotheses.sort(key=lambda h: (-h[0], h[1]))
    best = Decoded(np.zeros((0, 3), np.int64), 0.0, 1.0)
    ranked: list[tuple[float, int, Array, float, Array]] = []
    rng = np.random.default_rng((*seed, 2))
    for _, i, pose, distance, low in hypotheses[:COARSE]:
        energy = fill(pose, distance, low, labels, half, 2 * step, *spec.cubes, 4000, rng)[1]
        ranked.append((energy, i, pose, distance, low))
    ranked.sort(key=lambda r: r[:2])
    for _, _, turn, away, low in ranked[:4]:
        pose, distance = turn, away
        for _ in range(2):
            filled, _ = fill(pose, distance, low, labels, half, step, *spec.cubes, 12000, rng)
            pose, distance, value = refine(pose, distance, low, filled, labels, half, step)
            filled &= shown_cells(pose, distance, low, filled, labels, half)
            if value < best.misfit and obeys_rules(filled, low, spec):
                best = Decoded(_cubes(filled, pose), distance, value)
        if best.misfit < ENOUGH:
            break
    return best


def obeys_rules(filled: Array, low: Array, spec: SplitSpec) -> bool:
    """Return whether cells are a shape of the split about the origin.

    Its number of cubes, kind and radius are the split's, and its bounding box is centred.
    """
    cubes = np.stack(np.unravel_index(np.flatnonzero(filled), (SIDE,) * 3), axis=1)
    if not spec.cubes[0] <= len(cubes) <= spec.cubes[1]:
        return False
    shape = cubes.astype(np.int64)[None]
    linked = is_chain(shape) if spec.shapes == "chain" else is_connected(shape)
    centred = (box_centre(shape)[0] + low == 0).all()
    return bool(linked[0] and centred and bounding_radius(shape)[0] <= spec.max_radius)


def explain(decoded: Decoded, shown: Picture, half: float) -> float:
    """Return the least misfit of a shape, turned in any way, with a picture."""
    if not len(decoded.cubes) or not shown.labels.any():
        return 1.0
    step = max(1, min(shown.labels.shape) // 64)
    tries: list[tuple[float, int, Array, Array, Array]] = []
    for pose in shown.poses:
        for rotation in ROTATIONS:
            filled, low = _lattice(decoded.cubes @ rotation.T, pose)
            if filled is None:
                continue
            value = misfit(pose, decoded.distance, low, filled, shown.labels, half, 2 * step)
            tries.append((value, len(tries), pose, filled, low))
    tries.sort(key=lambda t: t[:2])
    least = 1.0
    for _, _, pose, filled, low in tries[:3]:
        value = refine(pose, decoded.distance, low, filled, shown.labels, half, step)[2]
        least = min(least, value)
    return least


def _cubes(filled: Array, pose: Array) -> Array:
    """Return the cubes of a lattice in a right-handed frame, (n, 3), lowest coordinate 0."""
    cubes = np.stack(np.unravel_index(np.flatnonzero(filled), (SIDE,) * 3), axis=1)
    if np.linalg.det(pose) < 0:
        cubes[:, 0] *= -1
    return np.asarray(cubes - cubes.min(axis=0))


def _lattice(cubes: Array, pose: Array) -> tuple[Array | None, Array]:
    """Return the lattice of a pose with these cubes, and the coordinates of its lowest corner."""
    cubes = cubes.astype(np.int64)
    if np.linalg.det(pose) < 0:
        cubes = cubes * np.array((-1, 1, 1))
    cubes = cubes - cubes.min(axis=0)
    extent = cubes.max(axis=0) + 1
    low = -SIDE / 2 - np.where(extent % 2 == 1, 0.5, 0.0)
    if (extent > SIDE - 1).any():
        return None, low
    placed = cubes + np.round(-extent / 2 - low).astype(np.int64)
    filled = np.zeros(SIDE**3, np.bool_)
    filled[np.ravel_multi_index(tuple(placed.T), (SIDE,) * 3)] = True
    return filled, low

"""Answers by explicit 3D: decode each picture to cubes, then render those."""

import dataclasses
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.cubes.filling import (
    SIDE,
    explained,
    fill,
    misfit,
    pixel_counts,
    refine,
    shown_pixels,
)
from baselines.cubes.poses import likely_poses, outline_pixels
from baselines.cubes.segmentation import labelings
from iqtt.audit.features.statistics import border
from iqtt.files.reader import open_questions
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.near import is_chain, is_connected
from iqtt.shapes.polycube import ROTATIONS, bounding_radius, box_centre, canonical
from metrics.prediction_writer import write_answers

Array = NDArray[Any]
Progress = Callable[[int, int], Any]
POSES = 8  # rotations of a picture that are tried
SMALLEST = 2.0  # radius of shapes of 8 or more cubes that all show
# Hypotheses of rotation, parities and distance: the best so many are filled by so many moves.
STAGES = ((96, 300), (10, 3000))
FINAL = (4, 8000)  # those that are filled and refined at full resolution
ROUNDS = (1, 3)  # times as many hypotheses, where the first round decodes nothing
GOOD, ENOUGH = 0.015, 0.03  # misfits of a decoded picture that end a search, and all searches
LARGEST = 256  # pixels of a side; of larger pictures every n-th pixel is seen
SHOWN = 0.6  # of the pixels that the split demands of a cube: poses are not exact


@dataclass(frozen=True, eq=False)
class Reading:
    """A way to see a picture.

    Attributes:
        pixels, fine, coarse: x, y and label of pixels, of fewer and of few, (P, 3).
        poses: likely ones, the best first.
        least: pixels that show any cube.
    """

    pixels: Array
    fine: Array
    coarse: Array
    poses: list[Array]
    least: float


@dataclass(frozen=True, eq=False)
class Decoded:
    """Cubes of a picture: (n, 3) integers, the camera's distance, the share of wrong pixels, and
    the readings that may hold: the one that gave the cubes, or all where none did well.
    """

    cubes: Array
    distance: float
    misfit: float
    readings: list[Reading]


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
        spec = questions.cube_spec or SplitSpec(height=height, width=width, min_cube_pixels=0)
        scores = np.zeros((len(questions), questions.answers))
        for row in range(len(questions)):
            images = questions.read("questions", row)
            if images.dtype != np.uint8:
                images = np.clip(255 * np.nan_to_num(images.astype(np.float32)), 0, 255)
            scores[row] = answer_scores(images, spec, row)
            progress(1, len(questions))
    write_answers(out, data, method="cubes", scores=scores, overwrite=overwrite)


def answer_scores(images: Array, spec: SplitSpec, seed: int = 0) -> Array:
    """Return a score of each answer of a question, (K,): minus the misfit where reference and
    answer were decoded to one shape; where none fits well, minus the least misfit of a shape that
    explains both.

    Args:
        images: (1 + K, H, W, 3), 0..255.
        spec: the settings of which the field of view, the numbers of cubes, the rule and largest
            radius of shapes and the pixels that show each cube are used.
        seed: of the random choices.
    """
    reference, *answers = (decode(image, spec, (seed, i)) for i, image in enumerate(images))
    costs = [
        max(reference.misfit, answer.misfit) if same_shape(reference, answer) else 1.0
        for answer in answers
    ]
    if min(costs) > ENOUGH:
        for i, answer in enumerate(answers):
            by_reference = max(reference.misfit, explain(reference, answer))
            by_answer = max(answer.misfit, explain(answer, reference))
            costs[i] = min(costs[i], by_reference, by_answer)
    return -np.array(costs)


def same_shape(first: Decoded, second: Decoded) -> bool:
    """Return whether two pictures were decoded to one shape, up to a rotation."""
    if len(first.cubes) != len(second.cubes) or not len(first.cubes):
        return False
    return bool((canonical(first.cubes[None]) == canonical(second.cubes[None])).all())


def decode(image: Array, spec: SplitSpec, seed: tuple[int, ...] = (0,)) -> Decoded:
    """Return the cubes that an image, (H, W, 3) of 0..255, shows; none where no shape of the
    split's rule fits.
    """
    half = math.tan(math.radians(spec.fov_y_degrees) / 2)
    stride = max(1, min(image.shape[:2]) // LARGEST)
    image = image[stride // 2 :: stride, stride // 2 :: stride]
    height, width = image.shape[:2]
    step = max(1, min(height, width) // 64)
    least = max(1, SHOWN * spec.min_cube_pixels * height * width / (spec.height * spec.width))
    background = np.median(border(image[None, None]), axis=2)[0, 0]
    best = Decoded(np.zeros((0, 3), np.int64), 0.0, 1.0, [])
    rng = np.random.default_rng(seed)
    readings: list[Reading] = []
    ways = list(labelings(image, background))
    for times in ROUNDS:
        for i, labels in enumerate(ways):
            if i == len(readings):
                poses = likely_poses(outline_pixels(labels, half), POSES, rng)
                every, fine, coarse = (shown_pixels(labels, half, s) for s in (1, step, 2 * step))
                readings.append(Reading(every, fine, coarse, poses, least))
            decoded = decode_reading(readings[i], spec, times, rng)
            if decoded.misfit < best.misfit:
                best = decoded
            if best.misfit < GOOD:
                return best
        if best.misfit < ENOUGH:
            return best
    return dataclasses.replace(best, readings=readings)


def decode_reading(
    reading: Reading, spec: SplitSpec, times: int, rng: np.random.Generator
) -> Decoded:
    """Return the cubes of the split's rule that a reading shows best."""
    fewest, most = spec.cubes
    radii = SMALLEST if fewest >= 8 else 1.5, math.sqrt(most**2 + 2) / 2
    # Squared radii of shapes are quarters of integers.
    first, last = (int(4 * min(radius, spec.max_radius) ** 2) for radius in radii)
    distances = [spec.framing_distance(math.sqrt(q) / 2) for q in range(first, last + 1)]
    tried = distances[:: max(3, len(distances) // 24)]
    ranked: list[tuple[float, int, Array, float, Array]] = []
    for pose in reading.poses:
        for parity in itertools.product((0.0, 0.5), repeat=3):
            low = -SIDE / 2 - np.array(parity)
            for distance in tried:
                value = explained(pose, distance, low, reading.coarse)
                ranked.append((-value, len(ranked), pose, distance, low))
    best = Decoded(np.zeros((0, 3), np.int64), 0.0, 1.0, [reading])
    for count, moves in STAGES:
        kept = sorted(ranked, key=lambda r: r[:2])[: count * times]
        ranked = [
            (fill(p, d, low, reading.coarse, fewest, most, moves, rng)[1], i, p, d, low)
            for _, i, p, d, low in kept
        ]
    count, moves = FINAL
    ranked = sorted(ranked, key=lambda r: r[:2])[: count * times]
    for _, _, turn, away, low in ranked:
        pose, distance = turn, away
        for _ in range(2):
            filled, _ = fill(pose, distance, low, reading.fine, fewest, most, moves, rng)
            pose, distance, value = refine(pose, distance, low, filled, reading.fine)
            counts = pixel_counts(pose, distance, low, filled, reading.pixels)
            filled &= counts >= reading.least
            if value < best.misfit and obeys_rules(filled, low, spec):
                best = Decoded(_cubes(filled, pose), distance, value, [reading])
            if best.misfit < GOOD:
                return best
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


def explain(shape: Decoded, seen: Decoded) -> float:
    """Return the least misfit of a shape, turned in any way, with the readings of a picture."""
    least = 1.0
    for reading in seen.readings if len(shape.cubes) else []:
        tries: list[tuple[float, int, Array, Array, Array]] = []
        for pose in reading.poses:
            for rotation in ROTATIONS:
                filled, low = _lattice(shape.cubes @ rotation.T, pose)
                if filled is not None:
                    value = misfit(pose, shape.distance, low, filled, reading.coarse)
                    tries.append((value, len(tries), pose, filled, low))
        tries.sort(key=lambda t: t[:2])
        for _, _, pose, filled, low in tries[:3]:
            value = refine(pose, shape.distance, low, filled, reading.fine)[2]
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
    if (extent > SIDE).any():
        return None, low
    placed = cubes + np.round(-extent / 2 - low).astype(np.int64)
    filled = np.zeros(SIDE**3, np.bool_)
    filled[np.ravel_multi_index(tuple(placed.T), (SIDE,) * 3)] = True
    return filled, low

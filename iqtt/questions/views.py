"""The views of a question: rotations under which every cube shows, far enough from each other."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.distractors import Pools, Shapes, arrange, draw_shapes, question_rng
from iqtt.questions.lights import FACE_STEPS, draw_lights
from iqtt.questions.packing import Question, cube_centres
from iqtt.questions.specs import SplitSpec
from iqtt.questions.visibility import cube_pixels
from iqtt.shapes.polycube import MAX_CUBES, ROTATIONS, bounding_radius, mirror, symmetries
from scenegen.common.errors import PlacementError
from scenegen.common.random.seeding import Purpose
from scenegen.common.rotations import product, rotation_matrix

Array = NDArray[Any]
SHRINK = 2  # how many times smaller than images the grids are on which visibility is judged
MARGIN = 1.5  # on them a cube needs so many times the pixels, so that full images seldom fall short
VIEWS = 100  # rotations proposed for one image before the question gets other shapes
PROPOSALS_AT_ONCE = 128  # views of all images that are judged at once, roughly
QUESTION_ATTEMPTS = 50  # choices of shapes for one question
CROWDED = 10  # from so many cubes on, a shape may well have no view that shows them all


@dataclass
class Tally:
    """Counts the views that were proposed, and those that were refused because they hide a cube."""

    proposed: int = 0
    refused: int = 0

    def add(self, other: "Tally") -> None:
        """Add the views that another process counted."""
        self.proposed += other.proposed
        self.refused += other.refused


def sample_questions(
    pools: Pools, split: str, requests: Sequence[tuple[int, int, int]], tally: Tally
) -> list[Question]:
    """Draw shapes, views and lights of questions until every cube shows in every image.

    Args:
        requests: (index, position of the right answer, attempt to begin with) of each question,
            which depends on these alone, not on the other requests.
        tally: counts the views that are proposed and refused.

    Raises PlacementError where the bounded search finds no question.
    """
    spec, waiting = pools.spec, list(requests)
    done: dict[int, Question] = {}
    while waiting:
        for index, _, attempt in waiting:
            if attempt >= QUESTION_ATTEMPTS:
                raise PlacementError(
                    f"{split} question {index}",
                    f"no views or no lights of {QUESTION_ATTEMPTS} choices of shapes",
                    f"{spec.min_cube_pixels} pixels of every cube in every image, and faces whose"
                    f" colours differ by {FACE_STEPS} of 255",
                    "try a smaller --min-cube-pixels, fewer --cubes or more --lights",
                )
        drawn = draw_shapes(pools, split, [(i, attempt) for i, _, attempt in waiting])
        shapes = []
        for (index, place, attempt), unplaced in zip(waiting, drawn, strict=True):
            rng = question_rng(spec, split, index, Purpose.ANSWERS, attempt)
            shapes.append(arrange(unplaced, place, rng))
        symmetric, distances = shape_symmetries(shapes), camera_distances(spec, shapes)
        turns = find_views(spec, split, waiting, shapes, distances, symmetric, tally)
        again = []
        for i, (index, place, attempt) in enumerate(waiting):
            lights = None
            if np.isfinite(turns[i]).all():
                rng = question_rng(spec, split, index, Purpose.LIGHTS, attempt)
                lights = draw_lights(spec, rng, shapes[i].cubes, turns[i], distances[i])
            if lights is None:
                again.append((index, place, attempt + 1))
                continue
            angle = rotation_angle_degrees(turns[i, 0], turns[i, 1 + place], symmetric[i, 0])
            rng = question_rng(spec, split, index, Purpose.POSES, attempt)
            framed = random_frames(shapes[i], turns[i], rng)
            done[index] = Question(
                index, attempt, framed[0], float(distances[i]), framed[1], *lights, angle
            )
        waiting = again
    return [done[index] for index, _, _ in requests]


def camera_distances(spec: SplitSpec, shapes: Sequence[Shapes]) -> Array:
    """Return the distance from which the camera frames the largest answer of each question, (Q,).

    It is that of all images of the question, as a scale of its own would tell shapes apart.
    """
    radii = [bounding_radius(drawn.cubes[1:]).max() for drawn in shapes]
    return np.array([spec.framing_distance(radius) for radius in radii])


def random_frames(shapes: Shapes, turns: Array, rng: np.random.Generator) -> tuple[Shapes, Array]:
    """Give each shape a frame of its own, and its cubes a random order; no image changes.

    The right answer has the reference's own cubes, and distractors are made from them, so where the
    cubes lie and how they are turned would tell something about the answer.

    Args:
        turns: rotations world_from_shape, (1 + K, 3, 3).

    Returns the shapes and their rotations in the new frames.
    """
    images, count = shapes.cubes.shape[:2]
    frames = ROTATIONS[rng.integers(len(ROTATIONS), size=images)]
    cubes = shapes.cubes @ np.swapaxes(frames, 1, 2)
    cubes -= cubes.min(axis=1, keepdims=True)
    order = np.stack([rng.permutation(count) for _ in range(images)])
    cubes = np.take_along_axis(cubes, order[..., None], axis=1)
    return replace(shapes, cubes=cubes), turns @ np.swapaxes(frames, 1, 2)


def shape_symmetries(shapes: Sequence[Shapes]) -> Array:
    """Return which of ROTATIONS leave each shape of each question as it is, (Q, 1 + K, 24)."""
    images = len(shapes[0].cubes) if shapes else 0
    symmetric = np.zeros((len(shapes), images, len(ROTATIONS)), bool)
    sizes = np.array([drawn.cubes.shape[1] for drawn in shapes])
    for size in np.unique(sizes).tolist():
        rows = np.flatnonzero(sizes == size)
        cubes = np.concatenate([shapes[i].cubes for i in rows.tolist()])
        symmetric[rows] = symmetries(cubes).reshape(len(rows), images, -1)
    return symmetric


def find_views(
    spec: SplitSpec,
    split: str,
    requests: Sequence[tuple[int, int, int]],
    shapes: Sequence[Shapes],
    distances: Array,
    symmetric: Array,
    tally: Tally,
) -> Array:
    """Return rotations under which every cube shows, (Q, 1 + K, 3, 3); NaN where none was found.

    Rotations of answers that are too near to the reference's view are not proposed (`far_enough`),
    nor those that are too near to the view of an answer before it that shows the same shape or its
    mirror image. The right answer's shape is seen twice and most wrong ones once, and a crowded
    shape often hides a cube; for that alone, the less crowded answers would be right more often. So
    from CROWDED cubes on, the shape of each answer needs a view as the reference too, and the
    answers keep away from all such views. The view of the right answer's shape is the one that is
    used.
    """
    questions, slots, answers = len(shapes), spec.cubes[1], spec.answers
    # The answers as references, then as answers.
    turns = np.empty((questions, 2 * answers, VIEWS, 3, 3))
    for i, (index, _, attempt) in enumerate(requests):
        rng = question_rng(spec, split, index, Purpose.VIEW, attempt)
        turns[i] = draw_rotations(rng, (2 * answers, VIEWS))
    centres = cube_centres([cubes for drawn in shapes for cubes in drawn.cubes[1:]], slots)
    centres = np.tile(centres.reshape(questions, answers, slots, 3), (1, 2, 1, 1))
    counts = np.array([drawn.cubes.shape[1] for drawn in shapes])
    right = np.array([drawn.answer for drawn in shapes])
    views = np.full((questions, 2 * answers, 3, 3), np.nan)

    def choose(images: slice, allowed: Array) -> None:
        """Find rotations of some images of all questions; allowed: (Q, K, VIEWS)."""
        chosen = _first_good(
            spec,
            turns[:, images].reshape(-1, VIEWS, 3, 3),
            allowed.reshape(-1, VIEWS),
            centres[:, images].reshape(-1, slots, 3),
            np.repeat(counts, answers),
            np.repeat(distances, answers),
            tally,
        ).reshape(-1, answers)
        question, image = np.nonzero(chosen >= 0)
        best = turns[question, images.start + image, chosen[question, image]]
        views[question, images.start + image] = best

    as_references, as_answers = slice(0, answers), slice(answers, 2 * answers)
    needed = (np.arange(answers) == right[:, None]) | (counts >= CROWDED)[:, None]
    choose(as_references, np.repeat(needed[..., None], VIEWS, axis=2))
    seen = np.isfinite(views[:, as_references]).all(axis=(2, 3))
    allowed = np.repeat((seen | ~needed).all(axis=1)[:, None], answers, axis=1)[..., None]
    mirrored, related = relations(shapes)
    for reference in range(answers):
        far = far_enough(
            spec,
            views[:, reference],
            turns[:, as_answers],
            symmetric[:, 1:],
            mirrored[:, reference],
        )
        allowed = allowed & (far | ~seen[:, reference, None, None])
    # Answers that show one shape, or its mirror image, are found one after the other.
    before = np.tril(related, -1)
    step = before.sum(axis=2)
    for now in range(answers):
        choose(as_answers, allowed & (step == now)[..., None])
        first = views[:, answers + now]
        far = far_enough(spec, first, turns[:, as_answers], symmetric[:, 1:], mirrored[:, now])
        allowed = allowed & (far | ~before[:, :, now, None])
    rows = np.arange(questions)
    return np.concatenate([views[rows, right][:, None], views[:, as_answers]], axis=1)


def relations(shapes: Sequence[Shapes]) -> tuple[Array, Array]:
    """Return how the answers of each question are related, (Q, K, K) bool each.

    The first tells whether one is compared with the other's mirror image, as it has more cubes in
    common with that; the second whether they show one shape, or a shape and its mirror image.
    """
    answers = len(shapes[0].cubes) - 1 if shapes else 0
    mirrored, related = np.zeros((2, len(shapes), answers, answers), bool)
    counts = np.array([drawn.cubes.shape[1] for drawn in shapes])
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        cubes = np.stack([shapes[i].cubes[1:] for i in rows.tolist()]).astype(np.int32)
        plain, turned = _in_common(cubes, cubes), _in_common(mirror(cubes), cubes)
        others = ~np.eye(answers, dtype=bool)
        mirrored[rows] = (turned > plain) & others
        related[rows] = (np.maximum(plain, turned) == count) & others
    return mirrored, related


def _in_common(a: Array, b: Array) -> Array:
    """Return how many cubes each two of K shapes have in common, one of them moved as fits best.

    Args:
        a, b: cubes of the shapes of each of Q questions, (Q, K, n, 3) int32.

    Returns (Q, K, K), for shapes of `a` and of `b`.
    """
    apart = a[:, :, None, :, None] - b[:, None, :, None] + 2 * MAX_CUBES
    moves = np.sort((apart @ np.array((1, 256, 65536), np.int32)).reshape(*apart.shape[:3], -1))
    # Cubes in common are equal moves; so many in a row as there are after sorting.
    common = np.ones(moves.shape[:3], int)
    for more in range(1, a.shape[2]):
        common[(moves[..., more:] == moves[..., :-more]).any(axis=-1)] = 1 + more
    return common


def far_enough(
    spec: SplitSpec, reference: Array, turns: Array, symmetric: Array, mirrored: Array
) -> Array:
    """Return whether each rotation is far enough from the reference's, (Q, K, VIEWS) bool.

    Both the rotation between the views and the angle between their lines of sight count. A rotation
    about the line of sight turns the picture and shows nothing new, and the view from behind has
    the same outline, flipped; so the angle between the lines of sight is that of two axes, 0 to 90
    degrees.

    Args:
        reference: rotations of the references, (Q, 3, 3).
        turns: rotations of the K answers, (Q, K, VIEWS, 3, 3).
        symmetric: symmetries of the answers, (Q, K, 24), as in `rotation_angle_degrees`.
        mirrored: answers that are compared with the reference's mirror image, (Q, K): it shows the
            reference's outline, flipped, from the mirrored line of sight.
    """
    relative = np.swapaxes(reference, 1, 2)[:, None, None] @ turns
    hand = np.where(mirrored[..., None], (-1.0, 1.0, 1.0), 1.0)  # (Q, K, 3), as `mirror` does
    sight = reference[:, None, 2] * hand
    nearest, alike = np.full((2, *turns.shape[:3]), -np.inf)
    for rotation, has in zip(ROTATIONS, np.moveaxis(symmetric, 2, 0), strict=True):
        trace = (relative[has] * rotation).sum(axis=(-2, -1))
        nearest[has] = np.maximum(nearest[has], trace)
        cosine = np.abs(turns[has][:, :, 2] @ (sight[has] @ rotation)[..., None])[..., 0]
        alike[has] = np.maximum(alike[has], cosine)
    turned = (nearest - 1) / 2 <= math.cos(math.radians(spec.min_angle_degrees))
    seen_anew = alike <= math.cos(math.radians(spec.min_sight_angle_degrees))
    return np.asarray(turned & seen_anew)


def _first_good(
    spec: SplitSpec,
    turns: Array,
    allowed: Array,
    centres: Array,
    counts: Array,
    distances: Array,
    tally: Tally,
) -> Array:
    """Return for each of R images its first allowed rotation that shows every cube, or -1, (R,).

    Args:
        turns: proposed rotations, (R, VIEWS, 3, 3).
        allowed: which of them may be chosen, (R, VIEWS).
        centres: centres of the cubes, (R, slots, 3).
        counts: numbers of cubes, (R,).
        distances: from the camera to the origin, (R,).
    """
    size = (max(8, spec.height // SHRINK), max(8, spec.width // SHRINK))
    scale = (size[0] * size[1]) / (spec.height * spec.width)
    enough = math.ceil(MARGIN * spec.min_cube_pixels * scale)
    rank = np.cumsum(allowed, axis=1) - 1
    chosen = np.full(len(turns), -1)
    tried = 0
    while (waiting := np.flatnonzero((chosen < 0) & (rank[:, -1] >= tried))).size:
        # The first good one is taken, so how many are judged at once does not change the result.
        upto = tried + max(1, PROPOSALS_AT_ONCE // len(waiting))
        ranks = rank[waiting]
        row, proposal = np.nonzero(allowed[waiting] & (ranks >= tried) & (ranks < upto))
        row = waiting[row]
        shown = cube_pixels(
            size,
            spec.fov_y_degrees,
            centres[row],
            counts[row],
            turns[row, proposal],
            distances[row],
        )
        unused = np.arange(centres.shape[1]) >= counts[row][:, None]
        good = ((shown >= enough) | unused).all(axis=1)
        first_rows, first = np.unique(row[good], return_index=True)
        chosen[first_rows] = proposal[good][first]
        tried = upto
    took = chosen >= 0
    refused = np.where(took, rank[np.arange(len(rank)), chosen], rank[:, -1] + 1)
    tally.refused += int(refused.sum())
    tally.proposed += int(refused.sum() + took.sum())
    return chosen


def rotation_angle_degrees(a: Array, b: Array, symmetric: Array) -> float:
    """Return the angle of the smallest rotation from view a to view b of a shape, degrees.

    Args:
        a, b: rotations world_from_shape, (3, 3).
        symmetric: which of ROTATIONS leave the shape as it is, (24,) bool. Rotations by these
            cannot be seen, so they do not count.
    """
    # These are the traces of b g^T a^T, for all symmetries g of the shape.
    traces = (ROTATIONS[symmetric] * product(a.T, b)).sum(axis=(1, 2))
    degrees = math.degrees(math.acos(min(1.0, max(-1.0, (float(traces.max()) - 1) / 2))))
    return round(degrees, 9)  # the last bits of an arc cosine depend on the machine


def draw_rotations(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw rotations that are uniform on SO(3), (*shape, 3, 3)."""
    # Rounded, as a few normal numbers come from the logarithm, which differs in its last bits.
    quaternion = np.rint(rng.standard_normal((4, *shape)) * 2.0**40)
    return rotation_matrix(quaternion / np.sqrt((quaternion * quaternion).sum(axis=0)))

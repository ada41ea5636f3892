"""The views of a question: rotations under which every cube shows, and the lights of each image."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.distractors import Pools, Shapes, arrange, draw_shapes, question_key
from iqtt.questions.packing import Question, cube_centres, pack_views
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.polycube import ROTATIONS, bounding_radius, symmetries
from scenegen.common.errors import PlacementError
from scenegen.common.rotations import rotation_matrix
from scenegen.common.seeding import Purpose, item_rng
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
SHRINK = 2  # how many times smaller the images are by which visibility is first judged
MARGIN = 1.5  # in them a cube needs so many times the pixels, so that full images seldom fall short
VIEWS = 60  # rotations proposed for one image before the question gets other shapes
PROPOSED = 2  # least number of views of one image that are judged at once
PROPOSALS_AT_ONCE = 256  # views of all images that are judged at once, roughly
QUESTION_ATTEMPTS = 50  # choices of shapes for one question
CROWDED = 10  # from so many cubes on, a shape may well have no view that shows them all
LIGHT_DISTANCE = 4  # camera distances from a light to the origin: near parts are hardly brighter
# Cosines of the angles to the camera of the first light and of the others.
FIRST_LIGHT, OTHER_LIGHTS = (0.7, 0.9), (0.0, 0.8)


@dataclass
class Tally:
    """Counts the views that were proposed, and those that were refused because they hide a cube."""

    proposed: int = 0
    refused: int = 0


def sample_questions(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    requests: Sequence[tuple[int, int, int]],
    tally: Tally,
    device: str = "auto",
) -> list[Question]:
    """Draw shapes, views and lights of questions until every cube shows in every image.

    Args:
        requests: (index, position of the right answer, attempt to begin with) of each question,
            which depends on these alone, not on the other requests.
        tally: counts the views that are proposed and refused.

    Raises PlacementError where the bounded search finds no question.
    """
    done: dict[int, Question] = {}
    waiting = list(requests)
    while waiting:
        for index, _, attempt in waiting:
            if attempt >= QUESTION_ATTEMPTS:
                raise PlacementError(
                    f"{split} question {index}",
                    f"no views of {QUESTION_ATTEMPTS} choices of shapes",
                    f"{spec.min_cube_pixels} pixels of every cube in every image",
                    "try a smaller --min-cube-pixels, or fewer --cubes",
                )
        drawn = draw_shapes(spec, pools, split, [(i, attempt) for i, _, attempt in waiting])
        shapes = []
        for (index, place, attempt), one in zip(waiting, drawn, strict=True):
            rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.ANSWERS, attempt)
            shapes.append(arrange(one, place, rng))
        symmetric, distances = shape_symmetries(shapes), camera_distances(spec, shapes)
        turns = find_views(spec, split, waiting, shapes, distances, symmetric, tally, device)
        again = []
        for i, (index, place, attempt) in enumerate(waiting):
            if np.isfinite(turns[i]).all():
                angle = rotation_angle_degrees(turns[i, 0], turns[i, 1 + place], symmetric[i, 0])
                rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.POSES, attempt)
                framed = random_frames(shapes[i], turns[i], rng)
                rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.LIGHTS, attempt)
                lights = draw_lights(spec, rng, 1 + spec.answers, distances[i])
                done[index] = Question(
                    index, attempt, framed[0], float(distances[i]), framed[1], *lights, angle
                )
            else:
                again.append((index, place, attempt + 1))
        waiting = again
    return [done[index] for index, _, _ in requests]


def camera_distances(spec: SplitSpec, shapes: Sequence[Shapes]) -> Array:
    """Return the distance from which the camera frames the largest answer of each question, (Q,).

    It is that of all images of the question, as a scale of its own would tell shapes apart.
    """
    radii = [bounding_radius(one.cubes[1:]).max() for one in shapes]
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
    found = np.zeros((len(shapes), images, len(ROTATIONS)), bool)
    sizes = np.array([one.cubes.shape[1] for one in shapes])
    for size in np.unique(sizes).tolist():
        rows = np.flatnonzero(sizes == size)
        cubes = np.concatenate([shapes[i].cubes for i in rows.tolist()])
        found[rows] = symmetries(cubes).reshape(len(rows), images, -1)
    return found


def find_views(
    spec: SplitSpec,
    split: str,
    requests: Sequence[tuple[int, int, int]],
    shapes: Sequence[Shapes],
    distances: Array,
    symmetric: Array,
    tally: Tally,
    device: str,
) -> Array:
    """Return rotations under which every cube shows, (Q, 1 + K, 3, 3); NaN where none was found.

    Rotations of answers that are too near to the reference's view are not proposed, nor those of an
    answer that are too near to an answer before it of the same shape. The right answer's shape is
    seen twice and most wrong ones once, and a crowded shape often hides a cube; for that alone, the
    less crowded answers would be right more often. So from CROWDED cubes on, the shape of each
    answer needs a view as the reference too, and the answers keep away from all such views.
    The view of the right answer's shape is the one that is used.
    """
    questions, slots, answers = len(shapes), spec.cubes[1], spec.answers
    # The answers as references, then as answers.
    turns = np.empty((questions, 2 * answers, VIEWS, 3, 3))
    for i, (index, _, attempt) in enumerate(requests):
        rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.VIEW, attempt)
        turns[i] = draw_rotations(rng, (2 * answers, VIEWS))
    centres = cube_centres([cubes for one in shapes for cubes in one.cubes[1:]], slots)
    centres = np.tile(centres.reshape(questions, answers, slots, 3), (1, 2, 1, 1))
    counts = np.array([one.cubes.shape[1] for one in shapes])
    right = np.array([one.answer for one in shapes])
    found = np.full((questions, 2 * answers, 3, 3), np.nan)

    def choose(some: slice, allowed: Array) -> None:
        """Find rotations of some images of all questions; allowed: (Q, K, VIEWS)."""
        chosen = _first_good(
            spec,
            turns[:, some].reshape(-1, VIEWS, 3, 3),
            allowed.reshape(-1, VIEWS),
            centres[:, some].reshape(-1, slots, 3),
            np.repeat(counts, answers),
            np.repeat(distances, answers),
            tally,
            device,
        ).reshape(-1, answers)
        question, image = np.nonzero(chosen >= 0)
        best = turns[question, some.start + image, chosen[question, image]]
        found[question, some.start + image] = best

    as_references, as_answers = slice(0, answers), slice(answers, 2 * answers)
    needed = (np.arange(answers) == right[:, None]) | (counts >= CROWDED)[:, None]
    choose(as_references, np.repeat(needed[..., None], VIEWS, axis=2))
    seen = np.isfinite(found[:, as_references]).all(axis=(2, 3))
    allowed = np.repeat((seen | ~needed).all(axis=1)[:, None], answers, axis=1)[..., None]
    for reference in range(answers):
        far = far_enough(spec, found[:, reference], turns[:, as_answers], symmetric[:, 1:])
        allowed = allowed & (far | ~seen[:, reference, None, None])
    # The answer before each one that shows the same shape, as in `mirror-pair`; -1 for none.
    twin = np.array([_twins(one) for one in shapes]).reshape(questions, answers)
    choose(as_answers, allowed & (twin < 0)[..., None])
    if (twin >= 0).any():
        first = found[np.arange(questions), answers + twin.max(axis=1)]
        far = far_enough(spec, first, turns[:, as_answers], symmetric[:, 1:])
        choose(as_answers, allowed & far & (twin >= 0)[..., None])
    rows = np.arange(questions)
    return np.concatenate([found[rows, right][:, None], found[:, as_answers]], axis=1)


def _twins(shapes: Shapes) -> list[int]:
    """Return for each answer the answer before it that has the same cubes, else -1."""
    names = [cubes.tobytes() for cubes in shapes.cubes[1:]]
    return [names.index(name) if names.index(name) < i else -1 for i, name in enumerate(names)]


def far_enough(spec: SplitSpec, reference: Array, turns: Array, symmetric: Array) -> Array:
    """Return whether each rotation is far enough from the reference's, (Q, K, VIEWS) bool.

    Args:
        reference: rotations of the references, (Q, 3, 3).
        turns: rotations of the K answers, (Q, K, VIEWS, 3, 3).
        symmetric: symmetries of the answers, (Q, K, 24), as in `rotation_angle_degrees`.
    """
    relative = np.swapaxes(reference, 1, 2)[:, None, None] @ turns
    nearest = np.full(turns.shape[:3], -np.inf)
    for rotation, has in zip(ROTATIONS, np.moveaxis(symmetric, 2, 0), strict=True):
        trace = (relative[has] * rotation).sum(axis=(-2, -1))
        nearest[has] = np.maximum(nearest[has], trace)
    return np.asarray((nearest - 1) / 2 <= math.cos(math.radians(spec.min_angle_degrees)))


def _first_good(
    spec: SplitSpec,
    turns: Array,
    allowed: Array,
    centres: Array,
    counts: Array,
    distances: Array,
    tally: Tally,
    device: str,
) -> Array:
    """Return for each of R images its first allowed rotation that shows every cube, or -1, (R,).

    Args:
        turns: proposed rotations, (R, VIEWS, 3, 3).
        allowed: which of them may be chosen, (R, VIEWS).
        centres: centres of the cubes, (R, slots, 3).
        counts: numbers of cubes, (R,).
        distances: from the camera to the origin, (R,).
    """
    small = spec.render_spec(SHRINK)
    scale = (small.height * small.width) / (spec.height * spec.width)
    enough = math.ceil(MARGIN * spec.min_cube_pixels * scale)
    rank = np.cumsum(allowed, axis=1) - 1
    chosen = np.full(len(turns), -1)
    tried = 0
    while (waiting := np.flatnonzero((chosen < 0) & (rank[:, -1] >= tried))).size:
        # The first good one is taken, so how many are judged at once does not change the result.
        upto = tried + max(PROPOSED, PROPOSALS_AT_ONCE // len(waiting))
        ranks = rank[waiting]
        row, proposal = np.nonzero(allowed[waiting] & (ranks >= tried) & (ranks < upto))
        row = waiting[row]
        batch = pack_views(
            spec, small, centres[row], counts[row], turns[row, proposal], distances[row]
        )
        ids = launch_fields(batch, ("object_id",), device)()["object_id"]
        shown = visible_pixels(ids, small.object_slots)
        unused = np.arange(small.object_slots) >= counts[row][:, None]
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
    traces = ROTATIONS[symmetric].reshape(-1, 9) @ (a.T @ b).ravel()
    return math.degrees(math.acos(min(1.0, max(-1.0, (float(traces.max()) - 1) / 2))))


def draw_rotations(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw rotations that are uniform on SO(3), (*shape, 3, 3)."""
    quaternion = rng.standard_normal((4, *shape))
    return rotation_matrix(quaternion / np.sqrt((quaternion * quaternion).sum(axis=0)))


def draw_lights(
    spec: SplitSpec, rng: np.random.Generator, images: int, camera_distance: float
) -> tuple[Array, Array, Array]:
    """Draw light positions and colours, (images, L, 3) each, and their numbers, (images,).

    They are far away, on the camera's side, in uniform directions within bounds: the first at an
    angle of 26 to 46 degrees to the camera, so that most of what it sees is lit and the faces of a
    cube differ; the others at 37 to 90 degrees. Unused slots are zero.
    """
    most, distance = spec.lights[1], LIGHT_DISTANCE * camera_distance
    count = rng.integers(spec.lights[0], most, images, endpoint=True)
    # A uniform z and a uniform angle about the z axis are uniform on a zone of the sphere.
    z = rng.uniform(*OTHER_LIGHTS, (images, most))
    z[:, 0] = rng.uniform(*FIRST_LIGHT, images)
    around = rng.uniform(0.0, 2 * math.pi, (images, most))
    r = np.sqrt(1 - z * z)
    direction = np.stack([r * np.cos(around), r * np.sin(around), z], axis=2)
    color = rng.uniform(0.3, 1.0, (images, most, 3))
    level = spec.light_level * distance**2 / count
    color *= level[:, None, None] / color.max(axis=2, keepdims=True)
    used = (np.arange(most) < count[:, None])[..., None]
    return np.where(used, distance * direction, 0.0), np.where(used, color, 0.0), count

"""Find a question's shapes and views: every cube of each of its images shows."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.draws import draw_lights, draw_rotations, rotation_angle_degrees
from iqtt.questions.sampling import (
    Pools,
    Shapes,
    arrange,
    draw_shapes,
    question_key,
)
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Question, cube_centres, pack_views
from iqtt.shapes.polycube import ROTATIONS, symmetries
from scenegen.common.errors import PlacementError
from scenegen.common.seeding import Purpose, item_rng
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
SHRINK = 2  # of the images that visibility is first judged by
MARGIN = 1.5  # times the pixels asked for in them, so that the full image seldom falls short
VIEWS = 60  # rotations proposed for one image, before the question gets other shapes
PROPOSED = 2  # views of one image judged at once, at least
PROPOSALS_AT_ONCE = 256  # views judged at once, about
QUESTION_ATTEMPTS = 50  # shapes of one question
CROWDED = 10  # cubes from which a shape may well have no view that shows them all


@dataclass
class Tally:
    """How many views were proposed, and how many refused for hiding a cube."""

    proposed: int = 0
    refused: int = 0


def settle(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    requests: Sequence[tuple[int, int, int]],
    tally: Tally,
    device: str = "auto",
) -> list[Question]:
    """Find shapes and views of questions; each depends on itself alone.

    Args:
        requests: (index, place of the right answer, attempt to begin with).

    Raises PlacementError where the bounded search finds none.
    """
    done: dict[int, Question] = {}
    waiting = list(requests)
    while waiting:
        _check_attempts(spec, split, waiting)
        drawn = draw_shapes(spec, pools, split, [(i, attempt) for i, _, attempt in waiting])
        shapes = []
        for (index, place, attempt), one in zip(waiting, drawn, strict=True):
            rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.ANSWERS, attempt)
            shapes.append(arrange(one, place, rng))
        symmetric = _symmetries(shapes)
        turns = _find_views(spec, split, waiting, shapes, symmetric, tally, device)
        again = []
        for i, (index, place, attempt) in enumerate(waiting):
            if np.isfinite(turns[i]).all():
                done[index] = _lit(spec, split, index, attempt, shapes[i], turns[i], symmetric[i])
            else:
                again.append((index, place, attempt + 1))
        waiting = again
    return [done[index] for index, _, _ in requests]


def _check_attempts(spec: SplitSpec, split: str, requests: Sequence[tuple[int, int, int]]) -> None:
    """Raise PlacementError where a question had its last attempt."""
    for index, _, attempt in requests:
        if attempt >= QUESTION_ATTEMPTS:
            raise PlacementError(
                f"{split} question {index}: no view of {QUESTION_ATTEMPTS} choices of shapes"
                f" shows {spec.min_cube_pixels} pixels of every cube; try a smaller"
                f" --min-cube-pixels, or fewer --cubes"
            )


def _symmetries(shapes: Sequence[Shapes]) -> Array:
    """Return which of ROTATIONS leave each shape of each question as it is, (Q, 4, 24)."""
    found = np.zeros((len(shapes), 4, len(ROTATIONS)), bool)
    sizes = np.array([one.cubes.shape[1] for one in shapes])
    for size in np.unique(sizes).tolist():
        rows = np.flatnonzero(sizes == size)
        cubes = np.concatenate([shapes[i].cubes for i in rows.tolist()])
        found[rows] = symmetries(cubes).reshape(len(rows), 4, -1)
    return found


def _find_views(
    spec: SplitSpec,
    split: str,
    requests: Sequence[tuple[int, int, int]],
    shapes: Sequence[Shapes],
    symmetric: Array,
    tally: Tally,
    device: str,
) -> Array:
    """Return rotations under which every cube shows, (Q, 4, 3, 3); NaN where none was found.

    Of the answers' proposals, those too near to the reference's view do not count. The right shape
    is seen twice and a wrong one once, and a crowded shape often hides a cube: were that all, the
    less crowded answers would be right more often. So from CROWDED cubes on each answer needs a
    view as the reference too, and the answers keep away from all three; the right one's is used.
    """
    questions, slots = len(shapes), spec.cubes[1]
    turns = np.empty((questions, 6, VIEWS, 3, 3))  # of the answers as references, as answers
    for i, (index, _, attempt) in enumerate(requests):
        rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.VIEW, attempt)
        turns[i] = draw_rotations(rng, (6, VIEWS))
    centres = cube_centres([cubes for one in shapes for cubes in one.cubes[1:]], slots)
    centres = np.tile(centres.reshape(questions, 3, slots, 3), (1, 2, 1, 1))
    counts = np.array([one.cubes.shape[1] for one in shapes])
    right = np.array([one.answer for one in shapes])
    found = np.full((questions, 6, 3, 3), np.nan)

    def choose(some: slice, allowed: Array) -> None:
        """Settle these images of all questions, (Q, 3, VIEWS) of whose proposals are allowed."""
        chosen = _first_good(
            spec,
            turns[:, some].reshape(-1, VIEWS, 3, 3),
            allowed.reshape(-1, VIEWS),
            centres[:, some].reshape(-1, slots, 3),
            np.repeat(counts, 3),
            tally,
            device,
        ).reshape(-1, 3)
        question, image = np.nonzero(chosen >= 0)
        best = turns[question, some.start + image, chosen[question, image]]
        found[question, some.start + image] = best

    needed = (np.arange(3) == right[:, None]) | (counts >= CROWDED)[:, None]
    choose(slice(0, 3), np.repeat(needed[..., None], VIEWS, axis=2))
    seen = np.isfinite(found[:, :3]).all(axis=(2, 3))
    allowed = np.repeat((seen | ~needed).all(axis=1)[:, None], 3, axis=1)[..., None]
    for reference in range(3):
        far = _far(spec, found[:, reference], turns[:, 3:], symmetric[:, 1:])
        allowed = allowed & (far | ~seen[:, reference, None, None])
    choose(slice(3, 6), allowed)
    return np.concatenate([found[np.arange(questions), right][:, None], found[:, 3:]], axis=1)


def _far(spec: SplitSpec, reference: Array, turns: Array, symmetric: Array) -> Array:
    """Whether each rotation is far enough from the reference's, (Q, 3, VIEWS) bool.

    Args:
        reference: (Q, 3, 3).
        turns: of the answers, (Q, 3, VIEWS, 3, 3).
        symmetric: as `rotation_angle_degrees` takes it, (Q, 3, 24).
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
    tally: Tally,
    device: str,
) -> Array:
    """Return for each of R images its first allowed proposal that shows every cube, or -1, (R,).

    Args:
        turns: (R, VIEWS, 3, 3); allowed: (R, VIEWS).
        centres: (R, slots, 3); counts: (R,).
    """
    small = spec.render_spec(SHRINK)
    scale = (small.height * small.width) / (spec.height * spec.width)
    enough = math.ceil(MARGIN * spec.min_cube_pixels * scale)
    rank = np.cumsum(allowed, axis=1) - 1
    chosen = np.full(len(turns), -1)
    tried = 0
    while (waiting := np.flatnonzero((chosen < 0) & (rank[:, -1] >= tried))).size:
        # The first that will do is taken, so how many are judged at once changes nothing.
        upto = tried + max(PROPOSED, PROPOSALS_AT_ONCE // len(waiting))
        ranks = rank[waiting]
        row, proposal = np.nonzero(allowed[waiting] & (ranks >= tried) & (ranks < upto))
        row = waiting[row]
        batch = pack_views(spec, small, centres[row], counts[row], turns[row, proposal])
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


def _lit(
    spec: SplitSpec,
    split: str,
    index: int,
    attempt: int,
    shapes: Shapes,
    turns: Array,
    symmetric: Array,
) -> Question:
    """Return the question with its lights, which are drawn apart from its rotations."""
    rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.LIGHTS, attempt)
    angle = rotation_angle_degrees(turns[0], turns[1 + shapes.answer], symmetric[0])
    return Question(index, attempt, shapes, turns, *draw_lights(spec, rng, 4), angle)

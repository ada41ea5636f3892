"""The shapes of a question: the right answer and its two distractors.

The three answers are drawn first, and then which of them is right, each with the same probability.
So nothing in the three answers alone tells which one is right:

- `other`: three classes, drawn in the same way.
- `near`: a shape, and two shapes with the same one of its cubes moved; any two of the three differ
  by the place of that cube.
- `mirror`: a chiral shape, its mirror image, and a near shape. In a third of these questions the
  near shape is right: otherwise the answer that is unlike the other two would always be wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.specs import DISTRACTOR_KINDS, SPLITS, SplitSpec
from iqtt.shapes.near import move_cubes
from iqtt.shapes.polycube import canonical_class, is_chiral, mirror, set_ids
from iqtt.shapes.splits import (
    LISTED_CUBES,
    SplitClasses,
    TooFewShapesError,
    assign_classes,
    known_classes,
)
from scenegen.common.errors import PlacementError
from scenegen.common.records import check
from scenegen.common.seeding import Purpose, item_rng

Array = NDArray[Any]
Drawn: TypeAlias = tuple[Array, Array]
"""The right answer and two distractors, (3, n, 3) int8, and their kinds, (3,); -1 is right."""
SHAPE_ATTEMPTS = 400  # references tried for one question
MOVES = 60  # moves of one cube that are tried for one reference
TRIALS = 40  # references that are tried to see whether a kind of question can be asked
DRAWN_CLASSES = 20_000  # classes of a split, where there are too many to list them all


@dataclass(frozen=True, eq=False)
class Shapes:
    """The shapes of a question.

    Attributes:
        cubes: reference and three answers, (4, n, 3) int8; the right answer repeats the reference.
        kinds: kinds of the three answers, (3,) int8: -1 for the right one, else an index into
            DISTRACTOR_KINDS.
        answer: which of the three is right, 0 to 2.
    """

    cubes: Array
    kinds: Array
    answer: int


def question_key(split: str, index: int) -> int:
    """Return the item index under which a question of a split has its random generators."""
    return (SPLITS.index(split) << 40) | index


@dataclass(frozen=True, eq=False)
class Pools:
    """The shapes that questions are drawn from.

    Attributes:
        classes: the shape classes of each split, by number of cubes.
        sizes: for each kind of distractor, the numbers of cubes that allow it in every split.
    """

    classes: dict[int, SplitClasses]
    sizes: dict[str, tuple[int, ...]]


def make_pools(spec: SplitSpec) -> Pools:
    """Give each split its own shape classes, and find which kinds of questions they allow.

    Raises:
        TooFewShapesError: no number of cubes allows the distractors in every split.
        SpecError: the spec has no seed, as in files that do not tell it.
    """
    check(spec.seed is not None, "seed", "none, as in files that do not tell it", "a number")
    classes = {n: _split_classes(spec, n) for n in range(spec.cubes[0], spec.cubes[1] + 1)}
    kinds = DISTRACTOR_KINDS if spec.distractors == "mixed" else (spec.distractors,)
    allowed = {}
    for kind in kinds:
        allowed[kind] = tuple(n for n in classes if _allows(spec, classes[n], kind, n))
        if not allowed[kind]:
            raise TooFewShapesError(
                "cubes",
                f"too few {spec.shapes} shapes of {spec.cubes[0]}-{spec.cubes[1]} cubes within"
                f" radius {spec.max_radius:g}",
                f"enough for {kind!r} questions with shapes of their own in each of"
                f" {', '.join(SPLITS)}",
                "take more --cubes, or a larger --max-radius",
            )
    return Pools(classes, allowed)


def _split_classes(spec: SplitSpec, cubes: int) -> SplitClasses:
    """Give each split as many classes as there are, or as are found where not all are listed."""
    size = DRAWN_CLASSES
    if cubes <= LISTED_CUBES[spec.shapes]:
        size = len(known_classes(cubes, spec.shapes, spec.max_radius)) // len(SPLITS)
    while True:
        rng = item_rng(spec.seed or 0, cubes, Purpose.CATALOGUE)
        try:
            sizes = [size] * len(SPLITS)
            return assign_classes(rng, cubes, sizes, spec.shapes, spec.max_radius)
        except TooFewShapesError:  # the loop ends: 0 classes are always found
            size //= 10


def _allows(spec: SplitSpec, classes: SplitClasses, kind: str, cubes: int) -> bool:
    """Return whether at least every twentieth reference of every split has such distractors."""
    for split in range(len(SPLITS)):
        if len(classes.splits[split]) < (3 if kind == "other" else 1):
            return False
        rngs = [
            item_rng(spec.seed or 0, cubes, Purpose.CATALOGUE, 1 + split * TRIALS + trial)
            for trial in range(TRIALS)
        ]
        made = _draw(spec, kind, classes, split, rngs)
        if sum(drawn is not None for drawn in made) < TRIALS / 20:
            return False
    return True


def answer_positions(spec: SplitSpec, split: str, first: int, count: int) -> Array:
    """Return the position of the right answer of each of some questions, (count,) uint8, 0 to 2.

    They are the questions first .. first + count - 1. The three positions come equally often, as
    nearly as the count allows, in random order.
    """
    rng = item_rng(spec.seed or 0, question_key(split, first), Purpose.POSITIONS)
    return np.asarray(rng.permutation(np.arange(count) % 3).astype(np.uint8))


def draw_shapes(
    spec: SplitSpec, pools: Pools, split: str, requests: Sequence[tuple[int, int]]
) -> list[Drawn]:
    """Draw the shapes of some questions.

    Args:
        requests: (index, attempt) of each question. Its shapes depend on these alone, not on the
            other requests.

    Raises PlacementError where no reference is found that has the distractors asked for.
    """
    rngs = [
        item_rng(spec.seed or 0, question_key(split, index), Purpose.QUESTION, attempt)
        for index, attempt in requests
    ]
    kinds = tuple(pools.sizes)
    groups: dict[tuple[str, int], list[int]] = {}
    for i, rng in enumerate(rngs):
        kind = kinds[rng.integers(len(kinds))]
        groups.setdefault((kind, int(rng.choice(pools.sizes[kind]))), []).append(i)
    drawn: list[Drawn | None] = [None] * len(requests)
    for (kind, cubes), waiting in groups.items():
        rows = waiting
        for _ in range(SHAPE_ATTEMPTS):
            some = [rngs[i] for i in rows]
            made = _draw(spec, kind, pools.classes[cubes], SPLITS.index(split), some)
            for i, one in zip(rows, made, strict=True):
                drawn[i] = one
            rows = [i for i in rows if drawn[i] is None]
            if not rows:
                break
        if rows:
            raise PlacementError(
                f"{split} question {requests[rows[0]][0]}",
                f"none of {SHAPE_ATTEMPTS} {spec.shapes} shapes of {cubes} cubes to have {kind!r}"
                " distractors that no other split may use",
                hint="take more --cubes, or another kind of --distractors",
            )
    return [one for one in drawn if one is not None]


def _either_hand(cubes: Array, rng: np.random.Generator) -> Array:
    return mirror(cubes) if rng.random() < 0.5 else cubes


def _draw(
    spec: SplitSpec,
    kind: str,
    split_classes: SplitClasses,
    split: int,
    rngs: Sequence[np.random.Generator],
) -> list[Drawn | None]:
    """Draw the shapes of a question with each generator; None where they are not all found."""
    if kind == "other":
        pool, kinds = split_classes.splits[split], np.array([-1, 0, 0], np.int8)
        chosen = [rng.choice(len(pool), 3, replace=False) for rng in rngs]
        return [
            (np.stack([_either_hand(pool[i], rng) for i in three]), kinds)
            for three, rng in zip(chosen, rngs, strict=True)
        ]
    found = _moved(spec, split_classes, split, rngs)
    chiral = is_chiral(np.stack([shape for shape, _ in found])) if kind == "mirror" else None
    made: list[Drawn | None] = []
    for i, (rng, (shape, moved)) in enumerate(zip(rngs, found, strict=True)):
        if chiral is None:
            shapes, order, kinds = [shape, *moved], rng.permutation(3), np.array([-1, 1, 1])
        else:
            shapes = [shape, mirror(shape), *moved[:1]] if chiral[i] else []
            order, kinds = _MIRROR_ROLES[rng.integers(3)]
        complete = len(shapes) == 3
        made.append((np.stack(shapes)[order], kinds.astype(np.int8)) if complete else None)
    return made


def _moved(
    spec: SplitSpec, split_classes: SplitClasses, split: int, rngs: Sequence[np.random.Generator]
) -> list[tuple[Array, list[Array]]]:
    """Draw for each generator a shape of the split and up to two shapes with one cube moved.

    It is the same cube in both. They belong to the split too, and all three are of different
    classes.
    """
    pool = split_classes.splits[split]
    references = np.stack([_either_hand(pool[rng.integers(len(pool))], rng) for rng in rngs])
    count = references.shape[1]
    per_cube = (count - 1) * 6
    moves = np.stack(
        [rng.integers(count) * per_cube + rng.permutation(per_cube)[:MOVES] for rng in rngs]
    )
    repeated = np.repeat(references, moves.shape[1], axis=0)
    moved, valid = move_cubes(repeated, moves.ravel(), spec.shapes, spec.max_radius)
    question = np.repeat(np.arange(len(rngs)), moves.shape[1])[valid]
    moved = moved[valid]
    classes = canonical_class(np.concatenate([references, moved]))
    names = [bytes(name) for name in set_ids(classes)]
    owned = split_classes.owner(classes[len(rngs) :]) == split
    found: list[tuple[Array, list[Array]]] = [(reference, []) for reference in references]
    seen = [{name} for name in names[: len(rngs)]]
    for i, cubes, name, own in zip(question, moved, names[len(rngs) :], owned, strict=True):
        if own and name not in seen[i] and len(found[i][1]) < 2:
            found[i][1].append(cubes)
            seen[i].add(name)
    return found


def arrange(drawn: Drawn, answer: int, rng: np.random.Generator) -> Shapes:
    """Put the right answer at its position and the distractors, in random order, at the others."""
    cubes, kinds = drawn
    order = 1 + rng.permutation(2)
    places = np.insert(order, answer, 0)
    return Shapes(np.concatenate([cubes[:1], cubes[places]]), kinds[places], answer)


# Which of (shape, its mirror image, near shape) are the right answer and the two distractors, and
# of what kinds these are. Where the near shape is right, the shape is near to it, and the mirror
# image counts as `mirror` because it mirrors a shape that is near.
_MIRROR_ROLES = np.array(
    [[[0, 1, 2], [-1, 2, 1]], [[1, 0, 2], [-1, 2, 1]], [[2, 0, 1], [-1, 1, 2]]]
)

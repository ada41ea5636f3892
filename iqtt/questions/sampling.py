"""Which shapes a question shows.

The three answers are drawn first, and then which of them is right, each with the same chance; so
nothing among themselves can single it out:

- `other`: three classes drawn alike.
- `near`: a shape, and two with one cube moved, the same in both; any two of the three differ by
  that cube's place.
- `mirror`: a chiral shape, its mirror image, and a near shape. (Were the reference always one of
  the pair, "the odd one out is wrong" would leave two to guess from.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.shapes.catalogue import EXACT_CUBES, Catalogue, known_classes, make_catalogue
from iqtt.shapes.near import move_cubes
from iqtt.shapes.polycube import canonical_class, is_chiral, mirror, set_ids
from iqtt.shapes.sampling import TooFewShapesError
from scenegen.common.errors import PlacementError
from scenegen.common.records import check
from scenegen.common.seeding import Purpose, item_rng

Array = NDArray[Any]
Drawn: TypeAlias = tuple[Array, Array]
"""Right answer and two distractors, (3, n, 3) int8, and their kinds, (3,), the right one's -1."""
KIND_NAMES = ("other", "near", "mirror")
SHAPE_ATTEMPTS = 400  # references tried for one question
MOVES = 60  # of one cube, tried for one reference
TRIALS = 40  # references tried to see whether a kind of question can be asked
DRAWN_CLASSES = 20_000  # of a split, where there are too many cubes to list all classes


@dataclass(frozen=True, eq=False)
class Shapes:
    """The shapes of a question.

    Attributes:
        cubes: reference and three answers, (4, n, 3) int8; the right answer repeats the reference.
        kinds: of the three answers, (3,) int8: -1 right, else an index into KIND_NAMES.
        answer: which of the three is right.
    """

    cubes: Array
    kinds: Array
    answer: int


def question_key(split: str, index: int) -> int:
    """Return the number that stands for a question of a split in every seed."""
    return (SPLITS.index(split) << 40) | index


@dataclass(frozen=True, eq=False)
class Pools:
    """What questions are drawn from.

    Attributes:
        catalogues: the shape classes of each split, by number of cubes.
        sizes: for each kind of distractor, the numbers of cubes that allow it in every split.
    """

    catalogues: dict[int, Catalogue]
    sizes: dict[str, tuple[int, ...]]


def make_pools(spec: SplitSpec) -> Pools:
    """Give each split its own shape classes, and find which questions they allow.

    Raises:
        TooFewShapesError: no number of cubes allows the distractors in every split.
        SpecError: the seed is not told.
    """
    check(spec.seed is not None, "seed", "none, as in files that do not tell it", "a number")
    catalogues = {n: _catalogue(spec, n) for n in range(spec.cubes[0], spec.cubes[1] + 1)}
    kinds = KIND_NAMES if spec.distractors == "mixed" else (spec.distractors,)
    allowed = {}
    for kind in kinds:
        allowed[kind] = tuple(n for n in catalogues if _allows(spec, catalogues[n], kind, n))
        if not allowed[kind]:
            raise TooFewShapesError(
                f"cubes: {spec.shapes} shapes of {spec.cubes[0]}-{spec.cubes[1]} cubes within"
                f" radius {spec.max_radius:g} are too few for {kind!r} questions of their own in"
                f" each of {', '.join(SPLITS)}; take more --cubes, or a larger --max-radius"
            )
    return Pools(catalogues, allowed)


def _catalogue(spec: SplitSpec, cubes: int) -> Catalogue:
    """Give each split as many classes as there are, or as are found where not all are listed."""
    size = DRAWN_CLASSES
    if cubes <= EXACT_CUBES[spec.kind]:
        size = len(known_classes(cubes, spec.kind, spec.max_radius)) // len(SPLITS)
    while True:
        rng = item_rng(spec.seed or 0, cubes, Purpose.CATALOGUE)
        try:
            sizes = [size] * len(SPLITS)
            return make_catalogue(rng, cubes, sizes, spec.kind, spec.max_radius)
        except TooFewShapesError:  # ends: there are always none
            size //= 10


def _allows(spec: SplitSpec, catalogue: Catalogue, kind: str, cubes: int) -> bool:
    """Whether at least every twentieth reference of every split has such distractors."""
    for split in range(len(SPLITS)):
        if len(catalogue.splits[split]) < (3 if kind == "other" else 1):
            return False
        rngs = [
            item_rng(spec.seed or 0, cubes, Purpose.CATALOGUE, 1 + split * TRIALS + trial)
            for trial in range(TRIALS)
        ]
        made = _MAKERS[kind](spec, catalogue, split, rngs)
        if sum(drawn is not None for drawn in made) < TRIALS / 20:
            return False
    return True


def answer_positions(spec: SplitSpec, split: str, first: int, count: int) -> Array:
    """Return where the right answer of questions first .. first + count - 1 stands, (count,).

    The three positions come equally often, as nearly as the count allows.
    """
    rng = item_rng(spec.seed or 0, question_key(split, first), Purpose.POSITIONS)
    return np.asarray(rng.permutation(np.arange(count) % 3).astype(np.uint8))


def draw_shapes(
    spec: SplitSpec, pools: Pools, split: str, requests: Sequence[tuple[int, int]]
) -> list[Drawn]:
    """Draw the shapes of questions, given as (index, attempt); each depends on itself alone.

    Raises PlacementError where no reference has the distractors that are asked for.
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
            made = _MAKERS[kind](
                spec, pools.catalogues[cubes], SPLITS.index(split), [rngs[i] for i in rows]
            )
            for i, one in zip(rows, made, strict=True):
                drawn[i] = one
            rows = [i for i in rows if drawn[i] is None]
            if not rows:
                break
        if rows:
            raise PlacementError(
                f"{split} question {requests[rows[0]][0]}: none of {SHAPE_ATTEMPTS} {spec.shapes}"
                f" shapes of {cubes} cubes has {kind!r} distractors that no other split may use;"
                f" take more --cubes, or another kind of --distractors"
            )
    return [one for one in drawn if one is not None]


def _either_hand(cubes: Array, rng: np.random.Generator) -> Array:
    return mirror(cubes) if rng.random() < 0.5 else cubes


def _other(
    _spec: SplitSpec, catalogue: Catalogue, split: int, rngs: Sequence[np.random.Generator]
) -> list[Drawn | None]:
    pool = catalogue.splits[split]
    made: list[Drawn | None] = []
    for rng in rngs:
        chosen = rng.choice(len(pool), 3, replace=False)
        cubes = np.stack([_either_hand(pool[i], rng) for i in chosen])
        made.append((cubes, np.array([-1, 0, 0], np.int8)))
    return made


def _near(
    spec: SplitSpec, catalogue: Catalogue, split: int, rngs: Sequence[np.random.Generator]
) -> list[Drawn | None]:
    kinds = np.array([-1, 1, 1], np.int8)
    made: list[Drawn | None] = []
    for rng, (shape, moved) in zip(rngs, _moved(spec, catalogue, split, rngs), strict=True):
        order = rng.permutation(3)
        made.append((np.stack([shape, *moved])[order], kinds) if len(moved) == 2 else None)
    return made


def _mirror(
    spec: SplitSpec, catalogue: Catalogue, split: int, rngs: Sequence[np.random.Generator]
) -> list[Drawn | None]:
    found = _moved(spec, catalogue, split, rngs)
    chiral = is_chiral(np.stack([shape for shape, _ in found]))
    made: list[Drawn | None] = []
    for rng, (shape, moved), differs in zip(rngs, found, chiral, strict=True):
        order, kinds = _MIRROR_ROLES[rng.integers(3)]
        if moved and differs:
            three = np.stack([shape, mirror(shape), moved[0]])[list(order)]
            made.append((three, np.array(kinds, np.int8)))
        else:
            made.append(None)
    return made


def _moved(
    spec: SplitSpec, catalogue: Catalogue, split: int, rngs: Sequence[np.random.Generator]
) -> list[tuple[Array, list[Array]]]:
    """For each generator draw a shape of the split, and up to two with one of its cubes moved.

    It is the same cube in both. They belong to the split too, and all are of different classes.
    """
    pool = catalogue.splits[split]
    references = np.stack([_either_hand(pool[rng.integers(len(pool))], rng) for rng in rngs])
    count = references.shape[1]
    per_cube = (count - 1) * 6
    moves = np.stack(
        [rng.integers(count) * per_cube + rng.permutation(per_cube)[:MOVES] for rng in rngs]
    )
    repeated = np.repeat(references, moves.shape[1], axis=0)
    moved, valid = move_cubes(repeated, moves.ravel(), spec.kind, spec.max_radius)
    question = np.repeat(np.arange(len(rngs)), moves.shape[1])[valid]
    moved = moved[valid]
    classes = canonical_class(np.concatenate([references, moved]))
    names = [bytes(name) for name in set_ids(classes)]
    owned = catalogue.owner_of_classes(classes[len(rngs) :]) == split
    found: list[tuple[Array, list[Array]]] = [(reference, []) for reference in references]
    seen = [{name} for name in names[: len(rngs)]]
    for i, cubes, name, own in zip(question, moved, names[len(rngs) :], owned, strict=True):
        if own and name not in seen[i] and len(found[i][1]) < 2:
            found[i][1].append(cubes)
            seen[i].add(name)
    return found


def arrange(drawn: Drawn, answer: int, rng: np.random.Generator) -> Shapes:
    """Put the right answer at its place and the distractors, in random order, at the others."""
    cubes, kinds = drawn
    order = 1 + rng.permutation(2)
    places = np.insert(order, answer, 0)
    return Shapes(np.concatenate([cubes[:1], cubes[places]]), kinds[places], answer)


# Of (shape, its mirror image, near shape): which come right, wrong, wrong, and of what kinds. To
# the near shape, the shape is near, and the mirror image is that of something near.
_MIRROR_ROLES = (
    ((0, 1, 2), (-1, 2, 1)),
    ((1, 0, 2), (-1, 2, 1)),
    ((2, 0, 1), (-1, 1, 2)),
)
_MAKERS = {"other": _other, "near": _near, "mirror": _mirror}

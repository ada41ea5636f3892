"""The shapes of a question: the right answer and its distractors.

The answers are drawn first, and then which of them is right, each with the same probability. So
nothing in the answers alone tells which one is right, except where the rule of the kind says so:

- `other`: classes, drawn in the same way.
- `near`: a shape, and shapes with the same one of its cubes moved; any two of them differ by the
  place of that cube.
- `mirror`: a chiral shape, its mirror image, and a near shape. In a third of these questions the
  near shape is right: otherwise the answer that is unlike the other two would always be wrong.
- `matched`: classes that `shapes.matched` finds alike in what outlines show.
- `mirror-pair`: a chiral shape, and its mirror image twice. The right answer is the odd one out, so
  that with three answers the reference is not needed; but only mental rotation finds it.

With two answers there is one distractor, of the same kind.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.kinds import DISTRACTOR_KINDS
from iqtt.questions.specs import SPLITS, QuestionSpec, SplitSpec
from iqtt.shapes.matched import matched_rows
from iqtt.shapes.near import move_cubes
from iqtt.shapes.polycube import canonical_class, is_chiral, mirror, set_ids
from iqtt.shapes.splits import TooFewShapesError, split_classes, split_of
from scenegen.common.errors import PlacementError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check

Array = NDArray[Any]
Drawn: TypeAlias = tuple[Array, Array]
"""The right answer and K - 1 distractors, (K, n, 3) int8, and their kinds, (K,); -1 is right."""
SHAPE_ATTEMPTS = 400  # references tried for one question
MOVES = 60  # moves of one cube that are tried for one reference
TRIALS = 40  # references that are tried to see whether a kind of question can be asked
DRAWN_CLASSES = 20_000  # classes of a split, where there are too many to list them all
LOOKS_AND_SIZES = (  # settings that make no question another one
    *("train", "labeled", "val", "test", "image_dtype", "with_depth"),
    *("background", "ambient", "reflectance", "light_level"),
)
LEAST_MATCHED = 60  # shapes with matched ones that a split has at least, so that questions vary


@dataclass(frozen=True, eq=False)
class Shapes:
    """The shapes of a question.

    Attributes:
        cubes: reference and K answers, (1 + K, n, 3) int8; the right answer repeats the reference.
        kinds: kinds of the answers, (K,) int8: -1 for the right one, else an index into
            DISTRACTOR_KINDS.
        answer: which of them is right, 0 to K - 1.
    """

    cubes: Array
    kinds: Array
    answer: int


def question_key(split: str, index: int) -> int:
    """Return the item index under which a question of a split has its random generators."""
    return (SPLITS.index(split) << 40) | index


def question_rng(
    spec: SplitSpec, split: str, index: int, purpose: Purpose, attempt: int
) -> np.random.Generator:
    """Return a random generator of one question; kinds that share a seed share no stream."""
    kind = int.from_bytes(f"{spec.distractors} {spec.answers}".encode())
    return item_rng((spec.seed or 0, kind), question_key(split, index), purpose, attempt)


@dataclass(frozen=True, eq=False)
class Pools:
    """The shapes that questions of a split are drawn from.

    Attributes:
        spec: what the questions are.
        classes: the shape classes of training, validation and test, by number of cubes.
        matched: for the same, the rows of matched classes (`matched_rows`); empty where no question
            needs them.
        sizes: for each kind of question, the numbers of cubes that allow it in every split; kinds
            that no number allows are left out.
    """

    spec: SplitSpec
    classes: dict[int, tuple[Array, ...]]
    matched: dict[int, tuple[Array, ...]]
    sizes: dict[str, tuple[int, ...]]


def make_pools(spec: SplitSpec) -> Pools:
    """Find the shape classes of each split, and which kinds of questions they allow.

    Raises:
        TooFewShapesError: no number of cubes allows the distractors in every split.
        SpecError: the spec has no seed, as in files that do not tell it.
    """
    check(spec.seed is not None, "seed", "none, as in files without a seed", "a number")
    classes = {}
    for n in range(spec.cubes[0], spec.cubes[1] + 1):
        rng = item_rng(spec.seed or 0, n, Purpose.CATALOGUE)
        classes[n] = split_classes(rng, n, spec.shapes, spec.max_radius, DRAWN_CLASSES)
    matched = {}
    if "matched" in spec.kinds:
        matched = {n: tuple(map(matched_rows, parts)) for n, parts in classes.items()}
    pools = Pools(spec, classes, matched, {})
    for kind in spec.kinds:
        allowed = tuple(n for n in classes if _has_distractors(pools, kind, n))
        if allowed:
            pools.sizes[kind] = allowed
    if not pools.sizes:
        raise TooFewShapesError(
            "cubes",
            f"too few {spec.shapes} shapes of {spec.cubes[0]}-{spec.cubes[1]} cubes within"
            f" radius {spec.max_radius:g}",
            f"enough for {spec.distractors!r} questions with shapes of their own in each of"
            f" {', '.join(SPLITS)}",
            "take more --cubes, or a larger --max-radius",
        )
    return pools


def _has_distractors(pools: Pools, kind: str, cubes: int) -> bool:
    """Return whether at least every twentieth reference of every split has such distractors."""
    spec = pools.spec
    for split in range(len(SPLITS)):
        if len(pools.classes[cubes][split]) < (spec.answers if kind == "other" else 1):
            return False
        if kind == "matched" and len(pools.matched[cubes][split]) < LEAST_MATCHED:
            return False
        rngs = [
            item_rng(spec.seed or 0, cubes, Purpose.CATALOGUE, 1 + split * TRIALS + trial)
            for trial in range(TRIALS)
        ]
        made = _draw(pools, kind, cubes, split, rngs)
        if sum(drawn is not None for drawn in made) < TRIALS / 20:
            return False
    return True


def answer_positions(spec: QuestionSpec, split: str, first: int, count: int) -> Array:
    """Return the position of the right answer of each of some questions, (count,) uint8, from 0.

    They are the questions first .. first + count - 1. The positions come equally often, as nearly
    as the count allows, in random order. The order follows from all settings that decide what the
    questions are, so that the key of one split tells nothing about that of another, whatever they
    have in common; only the sizes of other tables and how images look make no difference.
    """
    settings = {name: value for name, value in vars(spec).items() if name not in LOOKS_AND_SIZES}
    text = json.dumps([settings, count], sort_keys=True)
    key = int.from_bytes(hashlib.sha256(text.encode()).digest())
    rng = item_rng(key, question_key(split, first), Purpose.POSITIONS)
    return np.asarray(rng.permutation(np.arange(count) % spec.answers).astype(np.uint8))


def draw_shapes(pools: Pools, split: str, requests: Sequence[tuple[int, int]]) -> list[Drawn]:
    """Draw the shapes of some questions.

    Args:
        requests: (index, attempt) of each question. Its shapes depend on these alone, not on the
            other requests.

    Raises PlacementError where no reference is found that has the distractors asked for.
    """
    rngs = [
        question_rng(pools.spec, split, index, Purpose.QUESTION, attempt)
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
            generators = [rngs[i] for i in rows]
            made = _draw(pools, kind, cubes, SPLITS.index(split), generators)
            for i, shapes in zip(rows, made, strict=True):
                drawn[i] = shapes
            rows = [i for i in rows if drawn[i] is None]
            if not rows:
                break
        if rows:
            raise PlacementError(
                f"{split} question {requests[rows[0]][0]}",
                f"none of {SHAPE_ATTEMPTS} {pools.spec.shapes} shapes of {cubes} cubes has"
                f" {kind!r} distractors of the same split",
                hint="use more --cubes, or another distractor type (--distractors)",
            )
    return [shapes for shapes in drawn if shapes is not None]


def _either_hand(cubes: Array, rng: np.random.Generator) -> Array:
    return mirror(cubes) if rng.random() < 0.5 else cubes


def _draw(
    pools: Pools, kind: str, cubes: int, split: int, rngs: Sequence[np.random.Generator]
) -> list[Drawn | None]:
    """Draw the shapes of a question with each generator; None where they are not all found."""
    spec, pool = pools.spec, pools.classes[cubes][split]
    if kind in ("near", "mirror"):
        return _near_questions(spec, kind, pool, split, rngs)
    if kind == "mirror-pair":
        shapes = np.stack([_either_hand(pool[rng.integers(len(pool))], rng) for rng in rngs])
        kinds = np.array([-1, 2, 2], np.int8)[: spec.answers]
        return [
            (np.stack([shape, mirror(shape), mirror(shape)][: spec.answers]), kinds)
            if good
            else None
            for shape, good in zip(shapes, is_chiral(shapes), strict=True)
        ]
    code = DISTRACTOR_KINDS.index(kind)
    kinds = np.array([-1, code, code], np.int8)[: spec.answers]
    made: list[Drawn | None] = []
    for rng in rngs:
        if kind == "other":
            rows = rng.choice(len(pool), spec.answers, replace=False)
        else:
            # A shape and two of its matched ones, in random order: any of the three may be right.
            table = pools.matched[cubes][split]
            alike = table[rng.integers(len(table))]
            partners = 1 + rng.choice(np.count_nonzero(alike >= 0) - 1, 2, replace=False)
            rows = rng.permutation(alike[[0, *partners]])[: spec.answers]
        made.append((np.stack([_either_hand(pool[i], rng) for i in rows]), kinds))
    return made


def _near_questions(
    spec: SplitSpec, kind: str, pool: Array, split: int, rngs: Sequence[np.random.Generator]
) -> list[Drawn | None]:
    """Draw the shapes of a question of the kinds `near` or `mirror` with each generator."""
    pairs = _moved(spec, pool, split, rngs)
    chiral = is_chiral(np.stack([shape for shape, _ in pairs])) if kind == "mirror" else None
    made: list[Drawn | None] = []
    for i, (rng, (shape, moved)) in enumerate(zip(rngs, pairs, strict=True)):
        if chiral is None:
            shapes, order = [shape, *moved][: spec.answers], rng.permutation(spec.answers)
            kinds = np.array([-1, 1, 1])[: spec.answers]
        else:
            shapes = [shape, mirror(shape), *moved[:1]] if chiral[i] else []
            order, kinds = _MIRROR_ROLES[rng.integers(3)]
        complete = len(shapes) == spec.answers
        made.append((np.stack(shapes)[order], kinds.astype(np.int8)) if complete else None)
    return made


def _moved(
    spec: SplitSpec, pool: Array, split: int, rngs: Sequence[np.random.Generator]
) -> list[tuple[Array, list[Array]]]:
    """Draw for each generator a shape of the split and up to two shapes with one cube moved.

    It is the same cube in both. They belong to the split too, and all three are of different
    classes.
    """
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
    owned = split_of(classes[len(rngs) :], spec.shapes == "chain") == split
    pairs: list[tuple[Array, list[Array]]] = [(reference, []) for reference in references]
    seen = [{name} for name in names[: len(rngs)]]
    for i, cubes, name, is_ours in zip(question, moved, names[len(rngs) :], owned, strict=True):
        if is_ours and name not in seen[i] and len(pairs[i][1]) < 2:
            pairs[i][1].append(cubes)
            seen[i].add(name)
    return pairs


def arrange(drawn: Drawn, answer: int, rng: np.random.Generator) -> Shapes:
    """Put the right answer at its position and the distractors, in random order, at the others."""
    cubes, kinds = drawn
    order = 1 + rng.permutation(len(kinds) - 1)
    places = np.insert(order, answer, 0)
    return Shapes(np.concatenate([cubes[:1], cubes[places]]), kinds[places], answer)


# Which of (shape, its mirror image, near shape) are the right answer and the two distractors, and
# of what kinds these are. Where the mirror image is right, the near shape is near to what that
# mirrors, so it is `near-mirror`. Where the near shape is right, the mirror image is so to it.
_MIRROR_ROLES = np.array(
    [[[0, 1, 2], [-1, 2, 1]], [[1, 0, 2], [-1, 2, 4]], [[2, 0, 1], [-1, 1, 4]]]
)

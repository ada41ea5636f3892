"""Proofs about wrong answers: each is of the kind that the file tells, and they differ.

The names of kinds are those of the file's `distractor_kind`; a name that is not known here is not
judged.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.congruence import cube_rotations
from iqtt.audit.proofs.shapes import Shapes
from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.proofs.views import views_apart
from iqtt.audit.table import AuditTable
from iqtt.questions.kinds import DISTRACTOR_KINDS

Array = NDArray[Any]
# Largest distance of the moments of two answers, cube edges: twice that of two matched shapes, as
# two answers may both be matched to a third.
MOMENTS = 0.1
_CODE = np.array([1_000_000, 1_000, 1])  # makes one number of a difference of two cubes
_CHUNK = 4096  # pairs of shapes at a time: bounds the memory


def answers_differ(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that no two answers show the same shape, but for a mirror-pair's wrong ones."""
    same = [_twins(table, its_shapes) for table, its_shapes in zip(tables, shapes, strict=True)]
    return judge(
        "options differ",
        "no two options are congruent, except the two mirror images of a mirror-pair question",
        tables,
        [mask.any(axis=1) for mask in same],
        lambda t, row: (
            f"images {_pairs(tables[t])[int(same[t][row].argmax())]} show the same shape"
        ),
    )


def _pairs(table: AuditTable) -> list[tuple[int, int]]:
    return list(itertools.combinations(range(1, table.images), 2))


def _twins(table: AuditTable, shapes: Shapes) -> Array:
    """Return which pairs of answers are congruent though they must not be, (Q, pairs) bool."""
    mirror = np.column_stack([np.zeros(len(table), np.bool_), _is_kind(table, "mirror")])
    names = shapes.shape_name
    twins = [
        (names[:, a] == names[:, b]) & ~(mirror[:, a] & mirror[:, b]) for a, b in _pairs(table)
    ]
    return np.stack(twins, axis=1) & shapes.whole[:, None]


def _is_kind(table: AuditTable, kind: str) -> Array:
    """Return which answers are wrong ones of a kind, (Q, K) bool."""
    number = DISTRACTOR_KINDS.index(kind) if kind in DISTRACTOR_KINDS else len(DISTRACTOR_KINDS)
    return np.asarray(table.truth["distractor_kind"] == number)


def labels(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that each wrong answer is to the reference what its label says.

    A `mirror` is its mirror image. All others are neither it nor its mirror image: a `near` is it
    with one cube moved, and a `near-mirror` is its mirror image with one cube moved.
    """
    wrong = []
    for table, its_shapes in zip(tables, shapes, strict=True):
        names, classes = its_shapes.shape_name, its_shapes.class_name
        mirror, near, near_mirror = (
            _is_kind(table, kind) for kind in ("mirror", "near", "near-mirror")
        )
        of_reference = classes[:, 1:] == classes[:, :1]
        bad = mirror & ~(of_reference & (names[:, 1:] != names[:, :1]))
        known = np.isin(table.truth["distractor_kind"], range(len(DISTRACTOR_KINDS)))
        bad |= known & ~mirror & of_reference
        bad |= near & ~_one_cube_moved(table, its_shapes, near)
        bad |= near_mirror & ~_one_cube_moved(table, its_shapes, near_mirror, mirrored=True)
        wrong.append(bad.any(axis=1) & its_shapes.whole)
    return judge(
        "labels",
        "mirror: mirror image of the reference; near: reference with one cube moved; near-mirror:"
        " mirror image with one cube moved; no other option is a mirror image",
        tables,
        wrong,
        lambda t, row: (
            f"distractor types {tables[t].truth['distractor_kind'][row].tolist()} do not match the"
            " shapes"
        ),
    )


def _one_cube_moved(
    table: AuditTable, shapes: Shapes, chosen: Array, mirrored: bool = False
) -> Array:
    """Return which of the chosen answers are the reference with one cube moved, (Q, K) bool.

    With `mirrored` it is the reference's mirror image.
    """
    sides = np.array([-1 if mirrored else 1, 1, 1])
    result = np.zeros(chosen.shape, np.bool_)
    chosen = chosen & shapes.whole[:, None]
    for n in np.unique(shapes.count[chosen.any(axis=1)]).tolist():
        rows, answers = np.nonzero(chosen & (shapes.count == n)[:, None])
        for start in range(0, len(rows), _CHUNK):
            row, answer = rows[start : start + _CHUNK], answers[start : start + _CHUNK]
            reference, other = (
                table.cubes[row, image, :n].astype(np.int64) for image in (0, 1 + answer)
            )
            result[row, answer] = _all_but_one_coincide(reference * sides, other)
    return result


def _all_but_one_coincide(first: Array, second: Array) -> Array:
    """Return whether all cubes but one can be laid on the other shape's, (S, n, 3) to (S,).

    Under each turn, the shift that lays most cubes on others is the most frequent difference.
    """
    count, size = first.shape[:2]
    fits = np.full(count, size == 1)
    for turn in cube_rotations():
        shifts = second[:, :, None] - (first @ turn.T)[:, None]
        codes = np.sort((shifts @ _CODE).reshape(count, -1), axis=1)
        run = max(size - 1, 1)  # of equal differences
        fits |= (codes[:, run - 1 :] == codes[:, : codes.shape[1] - run + 1]).any(axis=1)
    return fits


def mirror_images(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that two mirror images show one shape from two sides.

    Rotations that the shape's own symmetry hides do not count.
    """
    wrong = []
    for table, its_shapes in zip(tables, shapes, strict=True):
        mirrors = _is_kind(table, "mirror")
        first, second = 1 + np.argsort(~mirrors, axis=1, kind="stable")[:, :2].T
        angle = views_apart(table, its_shapes, first, second, mirrors.sum(axis=1) == 2)[0]
        least = 0.0 if table.spec is None else table.spec.min_angle_degrees
        wrong.append(angle < least - 1e-6)
    return judge(
        "mirror images",
        "the views of the two mirror images differ by at least the minimum angles",
        tables,
        wrong,
        lambda t, row: "they are seen from nearly the same side",
    )


def matched(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that matched shapes are alike: boxes and contacts equal, moments close."""
    gaps = [_gaps(table, its_shapes) for table, its_shapes in zip(tables, shapes, strict=True)]
    return judge(
        "matched",
        "matched distractors equal the correct shape in bounding box and touching faces, and in"
        f" seven moments within {MOMENTS:g} cube edges",
        tables,
        [~(gap <= MOMENTS + 1e-5) for gap in gaps],
        lambda t, row: (
            "another bounding box or number of touching faces"
            if np.isinf(gaps[t][row])
            else f"moments that differ by {gaps[t][row]:.3f}"
        ),
    )


def _gaps(table: AuditTable, shapes: Shapes) -> Array:
    """Return how far the moments of a question's matched answers are from the reference's, (Q,).

    It is infinite where box or contacts differ, and 0 for questions without matched answers.
    """
    is_matched = _is_kind(table, "matched") & shapes.whole[:, None]
    rows = np.flatnonzero(is_matched.any(axis=1))
    result = np.zeros(len(table))
    for n in np.unique(shapes.count[rows]).tolist():
        here = rows[shapes.count[rows] == n]
        cubes = table.cubes[here, :, :n].astype(np.int64)
        box = np.sort(np.ptp(cubes, axis=2), axis=2)
        apart = np.abs(cubes[:, :, :, None] - cubes[:, :, None]).sum(axis=4)
        touching = np.count_nonzero(apart == 1, axis=(2, 3))
        alike = (box == box[:, :1]).all(axis=2) & (touching == touching[:, :1])
        lengths = moment_lengths(cubes)
        far = np.linalg.norm(lengths - lengths[:, :1], axis=2)
        far = np.where(alike, far, np.inf)[:, 1:]
        result[here] = np.where(is_matched[here], far, 0).max(axis=1)
    return result


def moment_lengths(cubes: Array) -> Array:
    """Return seven lengths of shapes, by docs/iqtt.md#moments: integers (..., n, 3) to (..., 7).

    The squared norm of a tensor of moments is the mean, over all pairs of cubes, of a power of
    their dot product. Sums are of n times the coordinates, in integers, so that a symmetric shape
    gets 0 and not the sixth root of a rounding error.
    """
    size = cubes.shape[-2]
    x = size * cubes.astype(np.int64) - cubes.sum(axis=-2, keepdims=True, dtype=np.int64)
    dots = x @ np.swapaxes(x, -1, -2)
    square = np.diagonal(dots, axis1=-2, axis2=-1)
    # The inertia of a cube about its own middle adds 1/12 to each square.
    singular = np.linalg.svd(x / size, compute_uv=False)[..., ::-1]
    radii = np.sqrt(singular**2 / size + 1 / 12)
    third = (dots**3).mean(axis=(-2, -1)) ** (1 / 6)
    trace = np.cbrt(np.linalg.norm((square[..., None] * x).mean(axis=-2), axis=-1))
    fourth = (dots.astype(np.float64) ** 4).mean(axis=(-2, -1)) ** (1 / 8)
    distance = (square.astype(np.float64) ** 2).mean(axis=-1) ** (1 / 4)
    lengths = np.stack([third / 2, trace / 2, distance, fourth], axis=-1) / size
    return np.concatenate([radii, lengths], axis=-1)

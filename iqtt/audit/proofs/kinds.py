"""Proofs about wrong answers: each is of the kind that the file tells, and they differ.

The names of kinds are those of the file's `distractor_kind`; a name that is not known here is not
judged.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.congruence import cube_codes, cube_rotations
from iqtt.audit.proofs.shapes import Shapes
from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.table import AuditTable
from iqtt.questions.specs import DISTRACTOR_KINDS

Array = NDArray[Any]
# Largest distance of the principal radii of gyration of two answers, cube edges: twice that of two
# matched shapes, as two answers may both be matched to a third.
GYRATION = 0.12


def answers_differ(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that no two answers show the same shape, but for a mirror-pair's wrong ones."""
    same = [_twins(table, its_shapes) for table, its_shapes in zip(tables, shapes, strict=True)]
    return judge(
        "answers differ",
        "no two answers congruent to each other, but for two mirror images of the right one",
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


def mirror_images(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that an answer told to be a mirror image is one, of an answer and of no turned copy.

    Where all wrong answers are mirror images, they must be the right one's, and two of
    them must show it from two sides: rotations that the shape's own symmetry hides do not count.
    """
    wrong = []
    for table, its_shapes in zip(tables, shapes, strict=True):
        is_mirror = _is_kind(table, "mirror")
        names, classes = its_shapes.shape_name, its_shapes.class_name
        # (Q, answer, answer): of one class and not congruent.
        mirrors = classes[:, 1:, None] == classes[:, None, 1:]
        mirrors &= names[:, 1:, None] != names[:, None, 1:]
        bad = (is_mirror & ~mirrors.any(axis=2)).any(axis=1)
        alone = is_mirror.sum(axis=1) == table.images - 2
        of_right = (classes[:, 1:] == classes[:, :1]) & (names[:, 1:] != names[:, :1])
        bad |= alone & (is_mirror & ~of_right).any(axis=1)
        bad |= alone & (_angle_between(table, its_shapes, is_mirror) < _least_angle(table))
        wrong.append(bad & its_shapes.whole)
    return judge(
        "mirror images",
        "told mirror images are; where they are the only wrong answers, they are the right one's,"
        " from sides as far apart as the answers'",
        tables,
        wrong,
        lambda t, row: f"kinds {tables[t].truth['distractor_kind'][row].tolist()} are not so",
    )


def _least_angle(table: AuditTable) -> float:
    return 0.0 if table.spec is None else table.spec.min_angle_degrees - 1e-6


def _angle_between(table: AuditTable, shapes: Shapes, mirrors: Array) -> Array:
    """Return how far apart two mirror images are seen, degrees, (Q,); infinite if not two."""
    result = np.full(len(table), np.inf)
    rows = np.flatnonzero((mirrors.sum(axis=1) == 2) & shapes.whole)
    if table.images != 4 or not len(rows):
        return result
    views = table.truth["world_from_shape"]
    order = np.argsort(~mirrors[rows], axis=1, kind="stable")[:, :2]
    first_place, second_place = 1 + order[:, 0], 1 + order[:, 1]
    for n in np.unique(shapes.count[rows]).tolist():
        of_size = shapes.count[rows] == n
        here, a, b = rows[of_size], first_place[of_size], second_place[of_size]
        first, second = (table.cubes[here, k, :n].astype(np.int64) for k in (a, b))
        target = cube_codes(second)
        for turn in cube_rotations():
            fits = (cube_codes(first @ turn.T) == target).all(axis=1)
            between = views[here, b][fits] @ turn @ views[here, a][fits].swapaxes(1, 2)
            cosine = (np.trace(between, axis1=1, axis2=2) - 1) / 2
            angle = np.degrees(np.arccos(cosine.clip(-1, 1)))
            result[here[fits]] = np.fmin(result[here[fits]], angle)
    return result


def matched(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that matched shapes are alike: boxes and contacts equal, radii of gyration close."""
    gaps = [_gaps(table, its_shapes) for table, its_shapes in zip(tables, shapes, strict=True)]
    return judge(
        "matched",
        "matched wrong answers have the right one's bounding box and number of touching faces, and"
        f" its principal radii of gyration within {GYRATION:g} cube edges",
        tables,
        [~(gap <= GYRATION + 1e-6) for gap in gaps],
        lambda t, row: (
            "another box or number of contacts"
            if np.isinf(gaps[t][row])
            else f"radii that differ by {gaps[t][row]:.3f}"
        ),
    )


def _gaps(table: AuditTable, shapes: Shapes) -> Array:
    """Return how far the radii of a question's matched answers are from the reference's, (Q,).

    It is infinite where box or contacts differ, and 0 for questions without matched answers.
    """
    is_matched = _is_kind(table, "matched") & shapes.whole[:, None]
    rows = np.flatnonzero(is_matched.any(axis=1))
    result = np.zeros(len(table))
    for n in np.unique(shapes.count[rows]).tolist():
        here = rows[shapes.count[rows] == n]
        cubes = table.cubes[here, :, :n].astype(np.float64)
        box = np.sort(np.ptp(cubes, axis=2), axis=2)
        apart = np.abs(cubes[:, :, :, None] - cubes[:, :, None]).sum(axis=4)
        touching = np.count_nonzero(apart == 1, axis=(2, 3))
        alike = (box == box[:, :1]).all(axis=2) & (touching == touching[:, :1])
        radii = gyration_radii(cubes)
        far = np.linalg.norm(radii - radii[:, :1], axis=2)
        far = np.where(alike, far, np.inf)[:, 1:]
        result[here] = np.where(is_matched[here], far, 0).max(axis=1)
    return result


def gyration_radii(cubes: Array) -> Array:
    """Return the principal radii of gyration of solid shapes, (..., n, 3) to (..., 3), rising.

    The singular values of the centred cubes give those of their middles; the inertia of a cube
    about its own middle adds 1/12 to each square.
    """
    centred = cubes - cubes.mean(axis=-2, keepdims=True)
    singular = np.linalg.svd(centred, compute_uv=False)[..., ::-1]
    return np.asarray(np.sqrt(singular**2 / cubes.shape[-2] + 1 / 12))

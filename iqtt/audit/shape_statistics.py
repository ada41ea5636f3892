"""Numbers that describe the shapes of answers, from their cubes: finer than any picture tells."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.shape_proofs import Shapes
from iqtt.audit.table import AuditTable
from iqtt.files.layout import NO_CUBE

Array = NDArray[Any]
NAMES = ("contacts of cubes", "spread of cubes", "shape met elsewhere")


def answer_statistics(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> list[Array]:
    """Return for each table what NAMES say of each answer, (Q, 3, 3); NaN unless `Shapes.whole`.

    They are the pairs of cubes that share a face; the cubes' mean squared distance from their
    middle; and the answers of other questions, in all tables, that show the shape or its mirror
    image. (Not their references: a right answer has one beside it, so these would tell of other
    questions which answers are right, and of this one which is not.)
    """
    everything = np.concatenate([s.class_name[:, 1:].reshape(-1) for s in shapes])
    names, times = np.unique(everything, return_counts=True)
    results = []
    for table, found in zip(tables, shapes, strict=True):
        cubes = table.truth["cubes"][:, 1:]
        used = (cubes != NO_CUBE).all(axis=3)
        contacts, spread = np.zeros((2, *used.shape[:2]))
        # A pair of cubes at a time: memory stays flat.
        for i in range(used.shape[2]):
            apart = np.abs(cubes - cubes[:, :, i : i + 1].astype(np.int16))
            both = used & used[:, :, i : i + 1]
            contacts += np.count_nonzero(both & (apart.sum(axis=3) == 1), axis=2) / 2
            spread += ((apart**2).sum(axis=3) * both).sum(axis=2)
        spread /= 2 * np.maximum(used.sum(axis=2), 1) ** 2
        own = found.class_name[:, 1:]
        here = (own[:, :, None] == own[:, None]).sum(axis=2)
        elsewhere = times[np.searchsorted(names, own)] - here
        numbers = np.stack([contacts, spread, elsewhere], axis=2)
        results.append(np.where(found.whole[:, None, None], numbers, np.nan))
    return results

"""Proofs about shapes, recomputed from the stored cubes with `congruence`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.congruence import congruent_rows, name_shapes, row_keys
from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.table import AuditTable
from iqtt.files.layout import NO_CUBE

Array = NDArray[Any]
MOST_CUBES = 64  # more than any file has; keeps names of shapes with other numbers of cubes apart
_CHUNK = 8192  # questions at a time: bounds the memory


@dataclass(frozen=True, eq=False)
class Shapes:
    """What the cubes of the Q questions of a table say about their shapes.

    Attributes:
        whole: whether a question's shapes, one for each image, are connected and have the same
            number of cubes, (Q,) bool. The other attributes have a meaning for these questions
            only.
        count: number of cubes of each of a question's shapes, (Q,).
        right: which answers are congruent to the reference, (Q, K) bool.
        shape_name: numbers for the shapes, (Q, 1 + K), equal if and only if the shapes are
            congruent, in all tables together; -1 unless `whole`.
        class_name: the same, but equal for mirror images too.
    """

    whole: Array
    count: Array
    right: Array
    shape_name: Array
    class_name: Array

    @property
    def place(self) -> Array:
        """Position of the right answer, (Q,); -1 unless there is exactly one."""
        return np.where(self.right.sum(axis=1) == 1, self.right.argmax(axis=1), -1)


def compare_shapes(tables: Sequence[AuditTable]) -> list[Shapes]:
    """Find out which of the tables' shapes are the same; of a table without truth none is whole."""
    results = []
    for table in tables:
        cubes = table.cubes
        whole, count = whole_and_count(cubes)
        right = np.zeros((len(table), table.images - 1), np.bool_)
        for n in np.unique(count[whole]).tolist():
            rows = np.flatnonzero(whole & (count == n))
            for k in range(table.images - 1):
                right[rows, k] = congruent_rows(cubes[rows, 0, :n], cubes[rows, 1 + k, :n])
        nameless = np.full((2, len(table), table.images), -1)
        results.append(Shapes(whole, count, right, *nameless))
    sizes = {n for s in results for n in np.unique(s.count[s.whole]).tolist()}
    images = tables[0].images if tables else 1
    for n in sorted(sizes):
        chosen = [np.flatnonzero(s.whole & (s.count == n)) for s in results]
        alike = [t.cubes[r, :, :n].reshape(-1, n, 3) for t, r in zip(tables, chosen, strict=True)]
        names = name_shapes(np.concatenate(alike))
        ends = np.cumsum([len(rows) for rows in chosen])[:-1]
        shape, mirrored = (np.split(v.reshape(-1, images) * MOST_CUBES + n, ends) for v in names)
        for i, its_shapes in enumerate(results):
            its_shapes.shape_name[chosen[i]], its_shapes.class_name[chosen[i]] = (
                shape[i],
                mirrored[i],
            )
    return results


def whole_and_count(cubes: Array) -> tuple[Array, Array]:
    """Return `Shapes.whole` and `Shapes.count` of stored cubes, (Q, I, most, 3)."""
    used = (cubes != NO_CUBE).all(axis=3)
    count = used.sum(axis=2)
    whole = (used == (np.arange(cubes.shape[2]) < count[..., None])).all(axis=(1, 2))
    whole &= (used == (cubes != NO_CUBE).any(axis=3)).all(axis=(1, 2))
    whole &= (count == count[:, :1]).all(axis=1) & (count[:, 0] > 0)
    for start in range(0, len(cubes), _CHUNK):
        part = slice(start, start + _CHUNK)
        wide, both = cubes[part].astype(np.int16), used[part, :, :, None] & used[part, :, None]
        apart = np.abs(wide[:, :, :, None] - wide[:, :, None]).sum(axis=4)
        differ = np.count_nonzero(both & (apart == 0), axis=(2, 3)) == count[part]
        # A shape is connected if every used row reaches the first cube.
        reaches = (both & (apart <= 1)).astype(np.float32)
        for _ in range(cubes.shape[2].bit_length()):
            reaches = np.minimum(reaches @ reaches, 1)
        joined = (reaches[:, :, 0] > 0) | ~used[part]
        whole[part] &= differ.all(axis=1) & joined.all(axis=(1, 2))
    return whole, count[:, 0]


def whole_shapes(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that the cubes are connected shapes of the specified size; other proofs rest on it."""
    ranges = [table.spec.cubes if table.spec else (1, MOST_CUBES) for table in tables]
    wrong = [
        ~(s.whole & (s.count >= low) & (s.count <= high))
        for s, (low, high) in zip(shapes, ranges, strict=True)
    ]
    return judge(
        "shapes",
        "connected, with equal cube counts within each question, as specified",
        tables,
        wrong,
        lambda t, row: (
            f"{shapes[t].count[row]} cubes"
            if shapes[t].whole[row]
            else "its cubes are not connected shapes"
        ),
    )


def one_right_answer(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that exactly one answer is congruent to the reference: the one that the file names."""
    wrong = []
    for table, its_shapes in zip(tables, shapes, strict=True):
        named = table.truth["distractor_kind"] == -1
        bad = (named != its_shapes.right).any(axis=1) | (its_shapes.place < 0)
        wrong.append(bad if table.answers is None else bad | (table.answers != its_shapes.place))

    def found_instead(t: int, row: int) -> str:
        congruent = np.flatnonzero(shapes[t].right[row]).tolist()
        answers = tables[t].answers
        stored = "" if answers is None else f", answer key {answers[row]}"
        kinds = tables[t].truth["distractor_kind"][row].tolist()
        return (
            f"congruent to the reference: {congruent or 'none'}{stored}, distractor types {kinds}"
        )

    rule = "exactly one option is congruent to the reference, as in the answer key"
    return judge("one correct option", rule, tables, wrong, found_instead)


def stored_ids(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that stored ids are equal if and only if the shapes, or their classes, are the same."""
    wrong = [np.zeros(len(table), np.bool_) for table in tables]
    whole = np.concatenate([s.whole for s in shapes])
    ends = np.cumsum([len(table) for table in tables])[:-1]
    for stored, names in (("shape_id", "shape_name"), ("class_id", "class_name")):
        ids = np.concatenate([table.truth[stored] for table in tables])[whole]
        computed = np.concatenate([getattr(s, names) for s in shapes])[whole].reshape(-1)
        keys = row_keys(ids.reshape(computed.size, ids.shape[2]))
        _, stored_id = np.unique(keys, return_inverse=True)
        bad = np.zeros(len(whole), np.bool_)
        clash = _not_one_to_one(stored_id, computed) | _not_one_to_one(computed, stored_id)
        bad[whole] = clash.reshape(-1, tables[0].images).any(axis=1)
        wrong = [a | b for a, b in zip(wrong, np.split(bad, ends), strict=True)]
    rule = "shape_id and class_id agree with the cubes"
    return judge("stored ids", rule, tables, wrong, lambda t, row: "its ids are not")


def _not_one_to_one(a: Array, b: Array) -> Array:
    """Return for each item whether its value in a comes with several values in b, (N,) bool."""
    order = np.lexsort((b, a))
    joins = (a[order][1:] == a[order][:-1]) & (b[order][1:] != b[order][:-1])
    bad = np.unique(a[order][1:][joins])
    return np.asarray(np.isin(a, bad))

"""Proofs that shapes keep to their split: none is in two, and each is in its own for ever.

The rule is that of docs/iqtt.md: a class is ranked by a hash of its canonical form, and the ranking
of all classes of as many cubes is cut in three. So any two files agree, whoever made them. The hash
is computed here from the cubes anew; where the rankings are cut never changes and is a table.
"""

import hashlib
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.congruence import MIRROR_X, cube_rotations
from iqtt.audit.proofs.shapes import Shapes
from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.table import AuditTable

Array = NDArray[Any]
TAG = b"3D-IQTT split "
ID_BYTES = 32  # of the id of a class; unused ones are 255
SPLITS = ("train", "val", "test")
THIRDS = (2**64 // 3, 2 * 2**64 // 3)
# The least hashes of validation and of test, by number of cubes; THIRDS for more cubes than here.
CHAINS = {
    3: (0x24AFB062880D261E, 0xF989E38A130D0E35),
    4: (0x50A8A9012D0867D4, 0xD263C9889C717E4D),
    5: (0x4DB90EAEC42266AD, 0xAAF72FADEC492EDB),
    6: (0x4BAF5D9E6D61B0EE, 0xA566270CF6CF50C7),
    7: (0x53315EC9974F5C87, 0xA79FF7865CE1EE80),
    8: (0x510309AF337CCC23, 0xA749F728927E2682),
    9: (0x5426ADA389305B41, 0xA7CCABF1D95BF551),
    10: (0x55959403C64DC0F2, 0xAAC666C84B5606C8),
    11: (0x54E70D5011B414F9, 0xAA6D1BDF9A7B3C94),
}
BRANCHING = {
    4: (0x4FFBD5EB5F93FAFF, 0xB07F4300BC71BD98),
    5: (0x5BC9B9F87D5F6611, 0x986E876D8B6136AC),
    6: (0x52A1FE60175BF884, 0xA3E389A2FD47427B),
    7: (0x5BDEB61AA339D298, 0xB044CA37328C8F7B),
    8: (0x52FF2AAC29169654, 0xA7CE2E7E703E2ADC),
    9: (0x54D6C801DA638686, 0xA9B041B46741B762),
}
_CHUNK = 4096  # shapes at a time: bounds the memory


def splits_for_ever(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that each class belongs to its table's split by the hash of its canonical form.

    Released files, whose splits were drawn otherwise, are left out.
    """
    by_hash = [table.spec is not None for table in tables]
    if not any(by_hash):
        return Proof("split by hash", "skipped", "released files have other splits")
    wrong = [np.zeros(len(table), np.bool_) for table in tables]
    for t, (table, its_shapes) in enumerate(zip(tables, shapes, strict=True)):
        chains = table.spec is not None and table.spec.shapes == "chain"
        for n in np.unique(its_shapes.count[its_shapes.whole]).tolist() if by_hash[t] else ():
            rows = np.flatnonzero(its_shapes.whole & (its_shapes.count == n))
            _, first, copy = np.unique(
                its_shapes.class_name[rows], return_index=True, return_inverse=True
            )
            distinct = table.cubes[rows, :, :n].reshape(-1, n, 3)[first]
            owner = class_splits(distinct, chains)[copy.reshape(len(rows), -1)]
            wrong[t][rows] = (owner != SPLITS.index(table.questions.split or "test")).any(axis=1)
    rule = "each shape is in the split that the hash of its canonical form selects"
    return judge("split by hash", rule, tables, wrong, lambda t, row: "a shape of another split")


def class_splits(cubes: Array, chains: bool) -> Array:
    """Return the split that each shape's class belongs to, (S, n, 3) to (S,): index into SPLITS.

    Args:
        chains: whether all shapes are known to be chains.
    """
    n = cubes.shape[1]
    keys = _canonical_keys(cubes)
    padded = np.full((len(keys), ID_BYTES // 2), 0xFFFF, ">u2")
    padded[:, :n] = keys
    hashes = [
        int.from_bytes(hashlib.sha256(TAG + row.tobytes()).digest()[:8], "big") for row in padded
    ]
    walks = [chains or is_walk(shape) for shape in cubes.tolist()]
    borders = [(CHAINS if walk else BRANCHING).get(n, THIRDS) for walk in walks]
    return np.array([sum(h >= b for b in two) for h, two in zip(hashes, borders, strict=True)])


def _canonical_keys(cubes: Array) -> Array:
    """Return each class's canonical form: its cubes as 256 x + 16 y + z, sorted, (S, n).

    Of all turns and mirror images whose box has sides x >= y >= z it is the least list.
    """
    turns = [turn * sign for turn in cube_rotations() for sign in ([1, 1, 1], MIRROR_X)]
    results: list[Array] = [np.zeros((0, cubes.shape[1]), np.int64)]
    for start in range(0, len(cubes), _CHUNK):
        part = cubes[start : start + _CHUNK].astype(np.int64)
        best = np.full(part.shape[:2], 1 << 12)
        for turn in turns:
            turned = part @ turn
            turned -= turned.min(axis=1, keepdims=True)
            keys = np.sort(turned @ np.array([256, 16, 1]), axis=1)
            side = turned.max(axis=1)
            falls = (side[:, 0] >= side[:, 1]) & (side[:, 1] >= side[:, 2])
            at = (keys != best).argmax(axis=1)[:, None]
            less = np.take_along_axis(keys < best, at, axis=1)[:, 0]
            best = np.asarray(np.where((falls & less)[:, None], keys, best))
        results.append(best)
    return np.concatenate(results)


def is_walk(cubes: Sequence[Sequence[int]]) -> bool:
    """Return whether some order of the cubes goes from face to face through all of them."""
    places = {tuple(cube) for cube in cubes}
    steps = [s for s in itertools.product((-1, 0, 1), repeat=3) if sum(map(abs, s)) == 1]
    near = {
        p: [q for s in steps if (q := (p[0] + s[0], p[1] + s[1], p[2] + s[2])) in places]
        for p in places
    }

    def goes_on(at: tuple[int, ...], seen: set[tuple[int, ...]]) -> bool:
        rest = [q for q in near[at] if q not in seen]
        return len(seen) == len(places) or any(goes_on(q, seen | {q}) for q in rest)

    return any(goes_on(p, {p}) for p in places)


def splits_share_nothing(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that no shape, nor its mirror image, is in two splits."""
    names = [table.questions.split or "" for table in tables]
    owned: dict[str, Array] = dict.fromkeys(sorted(set(names)), np.zeros(0, np.int64))
    if len(owned) < 2:
        return Proof("disjoint splits", "skipped", f"one split only: {', '.join(owned)}")
    for split, its_shapes in zip(names, shapes, strict=True):
        owned[split] = np.union1d(owned[split], its_shapes.class_name[its_shapes.whole])
    every, times = np.unique(np.concatenate(list(owned.values())), return_counts=True)
    shared = every[times > 1]
    rule = "no shape and no mirror image of a shape is in two splits"
    number = ", ".join(f"{split} {len(classes):,}" for split, classes in owned.items())
    return judge(
        "disjoint splits",
        f"{rule} (shapes: {number})",
        tables,
        [np.isin(s.class_name, shared).any(axis=1) & s.whole for s in shapes],
        lambda t, row: (
            f"its shape is in {_elsewhere(owned, shapes[t].class_name[row], names[t])} too"
        ),
    )


def _elsewhere(owned: dict[str, Array], classes: Array, split: str) -> str:
    return " and ".join(
        name
        for name, its_classes in owned.items()
        if name != split and np.isin(classes, its_classes).any()
    )

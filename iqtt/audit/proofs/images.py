"""Proofs about images, the places of right answers, and digests, from what `table` read."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.table import AuditTable, content_problems
from iqtt.files.layout import NO_CUBE
from scenegen.rendering.ground_truth import encode_image

Array = NDArray[Any]


def balance(tables: Sequence[AuditTable], right: Sequence[Array]) -> Proof:
    """Prove that the right answer is at each position equally often, in every table.

    Args:
        right: for each table the positions of the right answers, (Q,); -1 where unknown.
    """
    counts = [
        np.bincount(places[places >= 0], minlength=table.images - 1)
        for table, places in zip(tables, right, strict=True)
    ]
    answered = [i for i in range(len(tables)) if counts[i].sum()]
    shown = [f"{tables[i].name}: {'/'.join(map(str, counts[i]))}" for i in answered]
    uneven = [text for i, text in zip(answered, shown, strict=True) if np.ptp(counts[i]) > 1]
    if not answered:
        return Proof("correct positions", "skipped", "no answer key")
    if uneven:
        detail = f"{'; '.join(uneven)} at positions 0/1/...; expected: counts differ by at most 1"
        return Proof("correct positions", "FAIL", detail)
    return Proof("correct positions", "ok", "balanced: " + "; ".join(shown))


def content(tables: Sequence[AuditTable]) -> Proof:
    """Prove that all datasets and attributes are those that were written, by the files' digests."""
    rule = "all datasets and attributes match their content hashes"
    untold = [table.name for table in tables if not table.contents]
    if len(untold) == len(tables):
        return Proof("content", "skipped", "no content hashes")
    wrong = content_problems(tables)
    note = f"; no hashes in {', '.join(untold)}" if untold else ""
    if wrong:
        return Proof("content", "FAIL", f"{'; '.join(wrong)}; expected: {rule}{note}")
    return Proof("content", "ok", rule + note)


def values(tables: Sequence[AuditTable]) -> Proof:
    """Prove that all pixel values are finite and within 0..1."""
    return judge(
        "pixel values",
        "finite, from 0 to 1",
        tables,
        [table.unfit.any(axis=1) for table in tables],
        lambda t, row: f"{tables[t].unfit[row].max()} values of an image are not",
    )


def framing(tables: Sequence[AuditTable]) -> Proof:
    """Prove that no shape touches the border of an image."""
    for table in tables:
        if table.spec is None or not len(table):
            continue
        expected = encode_image(np.array(table.spec.background), table.questions.image_dtype)
        # The renderer may round a half up or down.
        step = 1 if table.questions.image_dtype == "uint8" else 1e-3
        if np.abs(table.background.astype(float) - expected).max() > step:
            detail = f"{table.name}: the most frequent border colour is {table.background.tolist()}"
            return Proof("framing", "FAIL", f"{detail}; expected: {expected.tolist()} as specified")
    guessed = any(table.spec is None for table in tables)
    note = "; background: the most frequent border colour" if guessed else ""
    return judge(
        "framing",
        f"no shape touches the image border{note}",
        tables,
        [table.on_border.any(axis=1) for table in tables],
        lambda t, row: f"{tables[t].on_border[row].max()} pixels of an image's border",
    )


def visibility(tables: Sequence[AuditTable]) -> Proof:
    """Prove, by the stored counts, that every cube shows and no silhouette is larger than them."""
    shown = [table.truth["visible_pixels"].astype(np.int64) for table in tables]
    used = [(table.cubes != NO_CUBE).any(axis=3) for table in tables]
    least = [np.where(u, s, 2**31).min(axis=2) for u, s in zip(used, shown, strict=True)]
    # A surface may have the colour of the background, which makes a silhouette smaller only.
    total = [np.where(u, s, 0).sum(axis=2) for u, s in zip(used, shown, strict=True)]
    needed = [table.spec.min_cube_pixels if table.spec else 0 for table in tables]
    return judge(
        "visibility",
        f"at least {max(needed)} visible pixels per cube; no silhouette is larger than its cubes",
        tables,
        [
            ((few < enough) | (table.silhouette > most)).any(axis=1)
            for table, few, enough, most in zip(tables, least, needed, total, strict=True)
        ],
        lambda t, row: (
            f"a cube shows {least[t][row].min()} pixels, silhouettes {tables[t].silhouette[row]}"
            f" of cubes {total[t][row]}"
        ),
    )


def distinct_images(tables: Sequence[AuditTable]) -> Proof:
    """Prove that no image is stored twice, in all tables together."""
    first = _first_copies(np.concatenate([table.digests.reshape(-1) for table in tables]))
    shown = first.reshape(-1, tables[0].images)
    return _no_copies(tables, "distinct images", "no image stored twice", shown)


def distinct_questions(tables: Sequence[AuditTable]) -> Proof:
    """Prove that no question is asked twice, even with its answers in another order."""
    words = np.concatenate([table.digests for table in tables]).view(np.uint64)
    words = words.reshape(-1, tables[0].images, 2)
    # A sum of hashes does not depend on their order.
    keys = np.concatenate([words[:, 0], words[:, 1:].sum(axis=1, dtype=np.uint64)], axis=1)
    first = _first_copies(keys.view("V32").reshape(-1))
    return _no_copies(tables, "distinct questions", "no question asked twice", first[:, None])


def _first_copies(keys: Array) -> Array:
    """Return the index of the first copy of each key, (N,)."""
    _, first, copy = np.unique(keys, return_index=True, return_inverse=True)
    return np.asarray(first[copy])


def _no_copies(tables: Sequence[AuditTable], name: str, rule: str, first: Array) -> Proof:
    """Prove that each item is its own first copy; first: (all questions, items a question)."""
    number = np.arange(first.size).reshape(first.shape)
    starts = np.cumsum([0, *map(len, tables)])

    def found(t: int, row: int) -> str:
        copies = first[starts[t] + row]
        item = int(np.flatnonzero(copies != number[starts[t] + row])[0])
        question, of = divmod(int(copies[item]), first.shape[1])
        where = int(np.searchsorted(starts, question, side="right")) - 1
        whose = f"{tables[where].name} row {question - starts[where]}"
        return f"image {item} is image {of} of {whose}" if first.shape[1] > 1 else f"as {whose}"

    repeats = np.split((first != number).any(axis=1), starts[1:-1])
    return judge(name, rule, tables, repeats, found)

"""How a proof is judged: a rule, the questions that break it, and what is said of these."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from iqtt.audit.table import AuditTable

SHOWN = 3  # questions that the detail of a proof names


@dataclass(frozen=True)
class Proof:
    """A rule and whether all questions keep it; `detail` says what was expected and found."""

    name: str
    status: Literal["ok", "FAIL", "skipped"]
    detail: str


def judge(
    name: str,
    rule: str,
    tables: Sequence[AuditTable],
    wrong: Sequence[ArrayLike],
    problem: Callable[[int, int], str],
    looked: int | None = None,
) -> Proof:
    """Return the verdict on a rule that each question must keep.

    Args:
        rule: what is expected, in words.
        wrong: for each table which questions break the rule, (Q,) bool.
        problem: returns, for a (table, row) that breaks it, what is wrong there, in words.
        looked: number of questions that were looked at, if not all.
    """
    total = f"{sum(map(len, tables)):,}"
    total = total if looked is None else f"{looked:,} of {total}"
    broken = [(t, row) for t, mask in enumerate(wrong) for row in np.flatnonzero(mask).tolist()]
    if not broken:
        return Proof(name, "ok", f"{rule} ({total} questions)")
    named = [f"{tables[t].name} row {row}: {problem(t, row)}" for t, row in broken[:SHOWN]]
    more = f" and {len(broken) - SHOWN:,} more" if len(broken) > SHOWN else ""
    text = "; ".join(named) + more
    return Proof(
        name, "FAIL", f"{text}; expected: {rule} ({len(broken):,} of {total} questions fail)"
    )

"""The text of an audit: aligned columns for a terminal, or Markdown."""

from collections.abc import Iterator, Sequence

from iqtt.audit.audit import Audit
from iqtt.audit.probes.rules import (
    ERROR_RATE,
    FRAMES,
    LIGHT,
    MIRRORED,
    OUTLINE,
    SPANS,
    WITHOUT,
    Probe,
)
from scenegen.common.text_table import aligned, piped, printable

_BLOCKS = (
    (WITHOUT, "options only", ("largest", "smallest", "most typical", "odd one out")),
    (WITHOUT, "options only, learned and cross-validated", ("learned",)),
    (
        WITHOUT,
        "position of the correct option, cross-validated",
        ("most frequent", "after the last"),
    ),
    (LIGHT, "option and reference, by light", ("nearest", "farthest")),
    (
        MIRRORED,
        "correct option or its mirror image",
        ("nearest", "farthest"),
    ),
    (FRAMES, "stored rotations and cube orders", ("nearest", "farthest", "learned")),
    (OUTLINE, "option and reference, by silhouette", ("nearest", "farthest", "learned")),
    (OUTLINE, "option and reference, by angle in degrees", SPANS),
)


def text(audit: Audit, markdown: bool = False) -> str:
    """Return the verdict, proofs and shortcut classifiers as aligned columns, or as Markdown."""
    table = piped if markdown else aligned
    files = [(t.name, f"{t.questions:,}", f"{t.probed:,}", t.split or "released")
             for t in audit.tables]  # fmt: skip
    proofs = [(p.status, p.name, p.detail) for p in audit.proofs]
    lines = [
        *_conclusion(audit),
        "",
        *table([("table", "questions", "classified", "split"), *files]),
    ]
    lines += [*audit.lacking, "", *table([("", "proof", "found"), *proofs])]
    for title, rows in _blocks(audit.probes):
        lines += ["", title, *[""] * markdown, *table(rows)]
    if audit.probes:
        level = f"* beats chance at the {100 * ERROR_RATE:g}% level (Holm-corrected)"
        lines += ["", f"accuracy in percent with its 95% Wilson interval; {level}"]
    return "\n".join(map(printable, lines))


def _blocks(probes: Sequence[Probe]) -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """Yield a title and a table for each kind of classifiers: statistics by rules."""
    for sees, title, rules in _BLOCKS:
        by_rule = {(p.statistic, p.rule): p for p in probes if p.sees == sees and p.rule in rules}
        if not by_rule:
            continue
        names = dict.fromkeys(name for name, _ in by_rule)
        rows = [(name, *(_cell(by_rule.get((name, rule))) for rule in rules)) for name in names]
        chance = next(iter(by_rule.values())).chance
        counts = sorted({p.n for p in by_rule.values()})
        may = "may exceed" if sees == OUTLINE else "must not exceed"
        numbers = " to ".join(f"{n:,}" for n in dict.fromkeys((counts[0], counts[-1])))
        full = f"{title}: {may} chance, {100 * chance:.1f}% ({numbers} questions)"
        yield full, [("", *rules), *rows]


def _cell(probe: Probe | None) -> str:
    if probe is None:
        return "-"
    share = f"{100 * probe.accuracy:.1f} [{100 * probe.low:.1f}, {100 * probe.high:.1f}]"
    return share + (" *" if probe.beats_chance else "")


def _conclusion(audit: Audit) -> list[str]:
    failed = [proof.name for proof in audit.proofs if proof.status == "FAIL"]
    passed = sum(proof.status == "ok" for proof in audit.proofs)
    proofs = f"{passed} proofs passed, 0 failed"
    if failed:
        proofs = f"FAILED proofs: {', '.join(failed)}"
    if not audit.questions:
        proofs = "FAILED: there are no questions"
    if not audit.probes:
        return [proofs, "no shortcut classifiers: the correct options are unknown"]
    tried = sum(probe.sees != OUTLINE for probe in audit.probes)
    shortcuts = [f"{p.statistic}, {p.rule} ({p.sees})" for p in audit.shortcuts]
    names = f": {'; '.join(shortcuts)}" if shortcuts else ""
    return [proofs, f"{len(shortcuts)} of {tried} shortcut classifiers beat chance{names}"]

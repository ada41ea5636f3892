"""The text of an audit: aligned columns for a terminal, or Markdown."""

from collections.abc import Iterator, Sequence

from iqtt.audit.audit import Audit
from iqtt.audit.probes.rules import ERROR_RATE, FRAMES, LIGHT, MIRRORED, OUTLINE, WITHOUT, Probe
from scenegen.common.text_table import aligned, piped, printable

_BLOCKS = (
    (WITHOUT, "answers alone", ("largest", "smallest", "most typical", "odd one out")),
    (WITHOUT, "answers alone, learned and cross-validated", ("learned",)),
    (WITHOUT, "where right answers stand, cross-validated", ("commonest", "after the last")),
    (LIGHT, "next to the reference, by light", ("nearest", "farthest")),
    (
        MIRRORED,
        "the right answer or its mirror image, next to the reference",
        ("nearest", "farthest"),
    ),
    (FRAMES, "by the frames in which shapes are stored", ("nearest", "farthest", "learned")),
    (OUTLINE, "next to the reference, by outline", ("nearest", "farthest", "learned")),
)


def table(audit: Audit) -> str:
    """Return proofs and probes as text with aligned columns."""
    files = [(t.name, f"{t.questions:,} questions", t.split or "released") for t in audit.tables]
    lines = [*aligned(files), *audit.lacking, ""]
    lines += aligned([(p.status, p.name, p.detail) for p in audit.proofs])
    for title, rows in _blocks(audit.probes):
        lines += ["", title, *("  " + line for line in aligned(rows))]
    return "\n".join(map(printable, [*lines, "", *_conclusion(audit)]))


def markdown(audit: Audit) -> str:
    """Return proofs and probes as Markdown tables."""
    files = [(t.name, f"{t.questions:,}", f"{t.probed:,}") for t in audit.tables]
    lines = piped([("table", "questions", "probed"), *files])
    lines += [*(f"\n{line}" for line in audit.lacking)]
    lines += [
        "",
        *piped([("", "proof", "found"), *((p.status, p.name, p.detail) for p in audit.proofs)]),
    ]
    for title, rows in _blocks(audit.probes):
        lines += ["", f"{title[0].upper()}{title[1:]}:", "", *piped(rows)]
    return "\n".join(map(printable, [*lines, "", *_conclusion(audit)]))


def _blocks(probes: Sequence[Probe]) -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """Yield for each kind of probes a title and a table: statistics in rows, rules in columns."""
    for sees, title, rules in _BLOCKS:
        by_rule = {(p.statistic, p.rule): p for p in probes if p.sees == sees and p.rule in rules}
        if not by_rule:
            continue
        names = dict.fromkeys(name for name, _ in by_rule)
        rows = [(name, *(_cell(by_rule.get((name, rule))) for rule in rules)) for name in names]
        chance = next(iter(by_rule.values())).chance
        counts = sorted({p.n for p in by_rule.values()})
        may = "sees some shape, so may beat" if sees == OUTLINE else "must not beat"
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
    lines = [f"FAILED: {', '.join(failed)}." if failed else "No proof failed."]
    if not audit.questions:
        lines = ["FAILED: there are no questions."]
    if audit.probes:
        tried = sum(probe.sees != OUTLINE for probe in audit.probes)
        shortcuts = [f"{p.statistic}, {p.rule} ({p.sees})" for p in audit.shortcuts]
        verdict = f"{len(shortcuts)} did: {'; '.join(shortcuts)}" if shortcuts else "none did"
        lines.append(
            "Percent right with 95% Wilson intervals; * beats chance at the"
            f" {100 * ERROR_RATE:g}% level, corrected for the number of probes (Holm)."
            f" Of {tried} probes that must not beat chance, {verdict}."
        )
    else:
        lines.append("No probes: no right answers are known.")
    return lines

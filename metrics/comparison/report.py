"""A comparison for people, as aligned text or Markdown, and for programs, as JSON."""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict

from metrics.comparison.compare import ALPHA, CONFIDENCE, POWER, SIGN_FLIP, Comparison, Difference
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import metric
from scenegen.common.text_table import laid_out, markdown, number, printable

FORMAT_NAME = "pix2shape-bench/comparison"
FORMAT_VERSION = "1.0"
_HEAD = (
    "method",
    "score",
    "difference",
    "better/worse/same",
    "p",
    "p (Holm)",
    "least shown",
    "verdict",
)


def text_report(comparison: Comparison, as_markdown: bool = False) -> str:
    """Return a table for each score: the reference, then the others against it; and a legend."""
    escape = markdown if as_markdown else str
    lines = [_title(comparison, escape), *laid_out(_tables(comparison, escape), as_markdown)]
    notes = [f"- {markdown(n)}" if as_markdown else f"note: {n}" for n in comparison.notes]
    between = [""] if as_markdown and notes else []
    return "\n".join(map(printable, [*lines, "", *legend(comparison), *between, *notes]))


def to_json(comparison: Comparison) -> str:
    """Return JSON whose keys are the attributes of `Comparison` and `Difference`."""
    content = {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        **asdict(comparison),
        "confidence": CONFIDENCE,
        "alpha": ALPHA,
        "power": POWER,
        "family": len(comparison.differences),
    }
    content["differences"] = [
        {**asdict(d), "unit": metric(d.metric).unit, "verdict": d.verdict}
        for d in comparison.differences
    ]
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _title(comparison: Comparison, escape: Callable[[str], str]) -> str:
    stamp = "" if comparison.comparable else " NOT COMPARABLE, compared all the same."
    known = known_test(comparison.truth_digest)
    truth = escape(known.name if known else comparison.truth_digest[:12])
    return (
        f"Against {escape(comparison.reference)}, over {sized(comparison)} (truth {truth}).{stamp}"
    )


def sized(comparison: Comparison) -> str:
    """Return over how many items methods are compared, in words."""
    if comparison.task == "rooms":
        return f"{comparison.items:,} images of {comparison.clusters:,} scenes"
    return f"{comparison.items:,} questions"


def _tables(
    comparison: Comparison, escape: Callable[[str], str]
) -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """Yield a title and the rows for each score, the reference first."""
    for name in dict.fromkeys(d.metric for d in comparison.differences):
        found = [d for d in comparison.differences if d.metric == name]
        reference = (escape(comparison.reference), number(found[0].reference_value))
        rows = [_HEAD, (*reference, *("" for _ in _HEAD[2:]))]
        title = f"{name} ({metric(name).unit}, {metric(name).direction})"
        yield escape(title), rows + [difference_cells(difference, escape) for difference in found]


def difference_head() -> tuple[str, ...]:
    """Return the head of the columns of `difference_cells`."""
    return _HEAD


def difference_cells(d: Difference, escape: Callable[[str], str] = str) -> tuple[str, ...]:
    """Return a difference as the cells of a row, from the method's name to the verdict."""
    interval = ""
    if d.low is not None and d.high is not None:
        like = d.difference or max(abs(d.low), abs(d.high))
        ends = f"{_signed(d.low, like)}, {_signed(d.high, like)}"
        interval = escape(f" [{ends}]")
    return (
        escape(d.method),
        number(d.value),
        _signed(d.difference, d.difference) + interval,
        f"{d.wins}/{d.losses}/{d.ties}",
        _probability(d.p_value),
        _probability(d.p_holm),
        "none" if d.smallest is None else number(d.smallest),
        d.verdict,
    )


def _signed(value: float, like: float) -> str:
    return ("+" if value > 0.0 else "") + number(value, like)


def _probability(p: float) -> str:
    return f"{p:.4f}" if p >= 0.0001 else "<0.0001"


def legend(comparison: Comparison) -> list[str]:
    """Return in sentences what the columns of a comparison say."""
    first = comparison.differences[0]
    rooms = comparison.task == "rooms"
    clusters, apart = ("scenes",) * 2 if rooms else ("questions", "shapes")
    if first.test == SIGN_FLIP:
        test = f"sign flips of the differences of each {apart[:-1]}"
    else:
        test = "exact McNemar test"
    if len({d.test for d in comparison.differences}) > 1:
        test = "exact McNemar test; sign flips for means over several runs"
    family = len(comparison.differences)
    many = f"{family} comparisons" if family > 1 else "1 comparison"
    return [
        f"difference: method - reference, paired, with its {CONFIDENCE:.0%} bootstrap interval over"
        f" {apart} (not corrected).",
        f"better/worse/same: {clusters}. p: {test}, two-sided; Holm: corrected for {many}.",
        f"least shown: what this test set would show in {POWER:.0%} of cases after the correction,"
        " as the differences spread here; none: no difference, or none can be told.",
    ]

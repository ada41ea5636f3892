"""A comparison for people, as aligned text, Markdown or a page, and for programs, as JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace

from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import metric
from metrics.scoring.records import ScoreFile
from metrics.views.compare.compare import (
    ALPHA,
    CONFIDENCE,
    POWER,
    SIGN_FLIP,
    Comparison,
    Difference,
)
from metrics.views.page import Section, html_page
from metrics.views.report import group_charts
from metrics.views.score_tables import side_by_side, skill_notes, too_few_warning, unread_notes
from metrics.views.table import Cell, Table, make_table, to_markdown, to_text
from scenegen.common.text_table import Interval, number

FORMAT_NAME = "pix2shape-bench/comparison"
FORMAT_VERSION = "1.0"
HEAD = (
    *("metric", "method", "value", "difference", "verdict"),
    *("b/w/s", "p (Holm)", "MDE"),
)


def text_report(
    comparison: Comparison,
    files: Sequence[ScoreFile],
    as_markdown: bool = False,
    width: int | None = None,
) -> str:
    """Return the skills of all methods, a table of differences, and notes.

    Sentences are wrapped to lines of `width` characters, where it is given.
    """
    write = to_markdown if as_markdown else to_text
    tables = [side_by_side(files), difference_table(comparison)]
    title = "\n".join([_title(comparison), *(f"WARNING  {t}" for t in _warnings(comparison))])
    return write(title, tables, _notes(comparison, files), width)


def html_report(comparison: Comparison, files: Sequence[ScoreFile]) -> str:
    """Return a page: verdicts, differences, and charts by group; `files` are those compared."""
    verdicts = [f"{label}: {_answer(comparison, label)}" for label in comparison.methods]
    sections = [
        Section(remarks=[_title(comparison), *verdicts], tables=[side_by_side(files)]),
        Section(
            "Differences", tables=[difference_table(comparison)], notes=_notes(comparison, files)
        ),
        *group_charts(files),
    ]
    title = f"Compared with {comparison.reference}"
    return html_page(title, sections, _warnings(comparison))


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


def difference_table(comparison: Comparison) -> Table:
    """Return for each metric the differences from the reference, with the paired test."""
    rows: list[Sequence[Cell | str]] = []
    for name in dict.fromkeys(d.metric for d in comparison.differences):
        differences = [d for d in comparison.differences if d.metric == name]
        first, up = differences[0], metric(name).higher_is_better
        reference = number(first.reference_value, (first.low, first.high))
        label = f"{name} {'up' if up else 'down'}"
        rows.append((label, comparison.reference, reference, *[""] * 5))
        rows += [("", *_difference_row(d)) for d in differences]
    return replace(make_table("", HEAD, rows), named_by=1)


def _difference_row(d: Difference) -> Sequence[Cell | str]:
    """Return a score, its difference with the interval, and what the paired test says.

    All are shown with the digits of the difference, whose interval is the narrowest.
    """
    ends = (d.low, d.high)
    shown = [_signed(end, ends) for end in ends if end is not None]
    difference = Cell(_signed(d.difference, ends), f"[{', '.join(shown)}]" if shown else "")
    smallest = "none" if d.smallest is None else number(d.smallest)
    counts = f"{d.wins}/{d.losses}/{d.ties}"
    holm = f"{d.p_holm:.4f}" if d.p_holm >= 0.0001 else "<0.0001"
    return d.method, number(d.value, ends), difference, d.verdict, counts, holm, smallest


def _signed(value: float, interval: Interval) -> str:
    return ("+" if value > 0.0 else "") + number(value, interval)


def _title(comparison: Comparison) -> str:
    """Return the reference, and how many items of which ground truth are compared."""
    size = f"{comparison.items:,} questions"
    if comparison.task == "rooms":
        size = f"{comparison.items:,} images of {comparison.clusters:,} scenes"
    if comparison.task == "measured":
        groups = f" in {comparison.clusters:,} groups"
        size = f"{comparison.items:,} images"
        size += groups * (comparison.clusters < comparison.items)
    test = known_test(comparison.truth_digest)
    truth = test.name if test else comparison.truth_digest[:12]
    title = f"Compared with {comparison.reference}: {size}, ground truth {truth}"
    if comparison.task == "iqtt":
        return title
    return f"{title}   alignment: {comparison.alignment}"


def _units(comparison: Comparison) -> tuple[str, str]:
    """Return what is better or worse, and what is independent, in the plural."""
    of_task = {"rooms": ("scenes", "scenes"), "measured": ("groups", "groups")}
    return of_task.get(comparison.task, ("questions", "shapes"))


def _warnings(comparison: Comparison) -> list[str]:
    items, _ = _units(comparison)
    few = [] if items == "questions" else too_few_warning(comparison.clusters, items)
    return ["some scores are not comparable, see below"] * (not comparison.comparable) + few


def _notes(comparison: Comparison, files: Sequence[ScoreFile]) -> list[str]:
    """Return what the columns mean, and notes on the files."""
    tests = {d.test for d in comparison.differences}
    items, apart = _units(comparison)
    if len(tests) > 1:
        test = "McNemar's exact test, or a sign-flip test for means over several runs"
    elif tests == {SIGN_FLIP}:
        test = f"a sign-flip test over {apart}"
    else:
        test = "McNemar's exact test"
    return [
        *skill_notes(files[0]),
        "difference: score of the method minus score of the first method, with a"
        f" {CONFIDENCE:.0%} CI from a paired bootstrap over {apart} (without Holm's correction)",
        "verdict: whether the method is better or worse than the first method; not shown if p"
        f" (Holm) is above {ALPHA:g}",
        f"b/w/s: number of {items} in which the method is better, worse, the same",
        f"p (Holm): two-sided p-value of {test}, with Holm's correction for all"
        f" {len(comparison.differences)} comparisons",
        "MDE: minimum detectable effect, the smallest difference that this test set detects with"
        f" {POWER:.0%} power"
        " after the correction",
        *unread_notes(files),
        *comparison.notes,
    ]


def _answer(comparison: Comparison, label: str) -> str:
    """Return in which scores a method is better and worse than the reference, in words."""
    texts = []
    for verdict in ("better", "worse", "not shown"):
        titles = [
            metric(d.metric).title
            for d in comparison.differences
            if d.method == label and d.verdict == verdict
        ]
        words = "no difference shown" if verdict == "not shown" else verdict
        texts += [f"{words} in {', '.join(titles)}"] if titles else []
    return "; ".join(texts) + "."

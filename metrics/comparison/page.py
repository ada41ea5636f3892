"""A comparison as one self-contained page that answers first: verdicts, then scenes and curves."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from metrics.comparison.compare import Comparison, Difference
from metrics.comparison.pairing import common_rows
from metrics.comparison.report import difference_cells, legend, sized
from metrics.report.at_hand import submission_at_hand, truth_at_hand
from metrics.report.axes import span
from metrics.report.charts import strip
from metrics.report.curves import view_curves
from metrics.report.headline import Cell, Grid, headline_table, kinds_table, notes
from metrics.report.html import render
from metrics.report.pictures import DEPTH, ERROR
from metrics.report.scenes import Pictured, chosen_scenes, entry_name, pictured, shown_score
from metrics.report.text import GROUP_TITLES, SKILL, what_the_floor_is
from metrics.scoring.metric_names import metric
from metrics.scoring.records import GROUPINGS, ScoreFile
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import number

_HEAD = (
    "difference",
    "on its scale",
    "better/worse/same",
    "p",
    "p (Holm)",
    "least shown",
    "verdict",
)
_LISTS = {"best": "the best", "median": "in the middle", "worst": "the worst"}


class AtHandError(SceneGenError):
    """A file that was given for pictures and is none of those that were scored."""


def html_comparison(
    comparison: Comparison,
    files: Sequence[ScoreFile],
    truth: Path | None = None,
    submissions: Sequence[Path] = (),
) -> str:
    """Return the page as text.

    Args:
        files: those that were compared, the reference first.
        truth, submissions: where the pictures come from; else from the files that the score files
            name, where they still lie there unchanged.

    Raises AtHandError where `truth` is another one, or a submission none of those that were scored;
    OSError and FileFormatError where a picture's row cannot be read.
    """
    _check_given(files, truth, submissions)
    labels = [comparison.reference, *comparison.methods]
    rooms = comparison.task == "rooms"
    first = files[0]
    return render(
        "compare.html",
        comparison=comparison,
        size=sized(comparison),
        answers=[(label, _answer(comparison, label)) for label in comparison.methods],
        differences=list(_differences(comparison)),
        legend=legend(comparison),
        headline=headline_table(first, files[1:]),
        notes=[*([f"{SKILL} {what_the_floor_is(first)}"] if first.skills else []), *notes(first)],
        kinds=[
            (f"Accuracy {GROUP_TITLES[g]}", kinds_table(first, g, files[1:]))
            for g in GROUPINGS["iqtt"]
            if getattr(first, g)
        ],
        curves=list(view_curves(files, labels)) if rooms else [],
        pictures=list(_pictures(comparison, files, truth, submissions)) if rooms else [],
    )


def _check_given(
    files: Sequence[ScoreFile], truth: Path | None, submissions: Sequence[Path]
) -> None:
    if truth is not None and truth_at_hand(files[0], truth) is None:
        digest = files[0].meta.truth_digest[:12]
        raise AtHandError(truth, "another truth, or none", f"the one of digest {digest}")
    for path in submissions:
        runs = [f for f in files if submission_at_hand(f, [path]) == path]
        if not runs:
            raise AtHandError(path, "a file that was not scored", "the first run of a score file")


def _answer(comparison: Comparison, label: str) -> str:
    """Return in which scores a method is better and worse than the reference, in words."""
    found: dict[str, list[str]] = {"better": [], "worse": [], "not shown": []}
    for d in comparison.differences:
        if d.method == label:
            found[d.verdict].append(metric(d.metric).title)
    told = [f"{verdict} in {', '.join(found[verdict])}" for verdict in ("better", "worse")
            if found[verdict]]  # fmt: skip
    if found["not shown"]:
        told.append(f"no difference shown in {', '.join(found['not shown'])}")
    return "; ".join(told)


def _differences(comparison: Comparison) -> Iterator[tuple[str, Grid]]:
    """Yield a title and the table of each score: the others' differences from the reference."""
    for name in dict.fromkeys(d.metric for d in comparison.differences):
        found = [d for d in comparison.differences if d.metric == name]
        ends = [end for d in found for end in (d.difference, *_ends(d))]
        ticks = span(ends, -math.inf)
        rows: list[tuple[Cell | str, ...]] = []
        for d in found:
            method, value, difference, *rest = difference_cells(d)
            shown, _, interval = difference.partition(" ")
            drawing = strip(d.difference, _ends(d), [("at zero", 0.0)], ticks)
            like = 0.1 if metric(name).unit == "correlation" else d.reference_value
            told = f"{value} instead of {number(d.reference_value, like)}"
            cells = Cell(method, told), Cell(shown, interval), Cell("", "", drawing)
            rows.append((*cells, *rest))
        yield (
            f"{metric(name).title} ({metric(name).unit}, {metric(name).direction})",
            (
                ("method", *_HEAD),
                rows,
            ),
        )


def _ends(d: Difference) -> tuple[float, float]:
    if d.low is None or d.high is None:
        return math.nan, math.nan
    return d.low, d.high


def _pictures(
    comparison: Comparison,
    files: Sequence[ScoreFile],
    truth: Path | None,
    submissions: Sequence[Path],
) -> Iterator[tuple[str, list[Pictured]]]:
    """Yield the scenes in which the first method with a file at hand gains and loses most.

    Raises OSError and FileFormatError where a file cannot be read or lacks a row.
    """
    name = next((d.metric for d in comparison.differences), shown_score(files[0]))
    where, ours = truth_at_hand(files[0], truth), submission_at_hand(files[0], submissions)
    others = ((i, submission_at_hand(files[i], submissions)) for i in range(1, len(files)))
    other, theirs = next(((i, path) for i, path in others if path), (0, None))
    if where is None or ours is None or theirs is None:
        return
    reference, method = files[0], files[other]
    orders = common_rows([reference, method])
    apart = method.items[name][orders[1]] - reference.items[name][orders[0]]
    higher = metric(name).higher_is_better
    chosen = chosen_scenes(reference.clusters[orders[0]], apart, higher)
    label = comparison.methods[other - 1]
    for title, entries in chosen.items():
        a = pictured(reference, where, ours, orders[0][entries].tolist())
        b = pictured(method, where, theirs, orders[1][entries].tolist())
        items = [
            _side_by_side(one, two, (comparison.reference, label))
            for one, two in zip(a, b, strict=True)
        ]
        for i, entry in enumerate(entries):
            told = f"{metric(name).title} {apart[entry]:+.4g}"
            named = entry_name(reference, int(orders[0][entry]))
            items[i] = Pictured(named, told, items[i].pictures)
        scenes = f"{len(entries)} scenes" if len(entries) > 1 else "1 scene"
        by = f"by the difference in {metric(name).title}"
        against = f"{label} against {comparison.reference}"
        yield f"{scenes} {by}, {_LISTS[title]}: {against}", items


def _side_by_side(one: Pictured, two: Pictured, labels: tuple[str, str]) -> Pictured:
    """The image and true depth, then predicted depth and error of both methods."""
    first, second = dict(one.pictures), dict(two.pictures)
    shown = list(first.items())[:2]
    for label, urls in zip(labels, (first, second), strict=True):
        shown += [(f"{name}, {label}", urls[name]) for name in (DEPTH, ERROR)]
    return Pictured(one.name, one.told, shown)

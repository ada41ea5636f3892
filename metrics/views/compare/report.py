"""A comparison for people, as aligned text, Markdown or a page, and for programs, as JSON."""

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path

from metrics.measured.reader import open_images
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import ScoreFile
from metrics.submissions.reader import RoomPredictions, open_predictions
from metrics.views.at_hand import submission_at_hand, truth_at_hand
from metrics.views.compare.compare import (
    ALPHA,
    CONFIDENCE,
    POWER,
    SIGN_FLIP,
    Comparison,
    Difference,
)
from metrics.views.compare.pairing import common_rows
from metrics.views.examples import (
    Example,
    Lists,
    chosen_scenes,
    entry_name,
    room_examples,
    shown_score,
)
from metrics.views.headline import kinds_sections
from metrics.views.page import Lead, Section, html_page
from metrics.views.pictures import DEPTH, ERROR, Picture
from metrics.views.plots import Point, strip
from metrics.views.report import ROOMS_REMARK, curves_section
from metrics.views.score_tables import (
    SKILL,
    floor_text,
    labels_of,
    score_cell,
    too_few_warning,
    unread_notes,
    what_the_floor_is,
)
from metrics.views.table import Cell, Table, make_table, to_markdown, to_text
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import Interval, number

FORMAT_NAME = "pix2shape-bench/comparison"
FORMAT_VERSION = "1.0"
TESTS_HEAD = ("better/worse/same", "p", "p (Holm)", "least shown", "verdict")
_LISTS = {"best": "the best", "median": "in the middle", "worst": "the worst"}
_NO_PICTURES = (
    "No pictures: the truth or the submissions do not lie where the score files name them, or were"
    " changed. Give them with --truth and --predictions."
)


class AtHandError(SceneGenError):
    """A file that was given for pictures and is none of those that were scored."""


def text_report(
    comparison: Comparison,
    files: Sequence[ScoreFile],
    as_markdown: bool = False,
    width: int | None = None,
) -> str:
    """Return the skills of all methods, then a table of differences in each score; and a legend.

    Sentences are wrapped to lines of `width` characters, where it is given.
    """
    stamp = "" if comparison.comparable else " NOT COMPARABLE, compared all the same."
    test = known_test(comparison.truth_digest)
    truth = test.name if test else comparison.truth_digest[:12]
    title = f"Against {comparison.reference}, over {_size(comparison)} (truth {truth}).{stamp}"
    notes = [
        *unread_notes(files),
        *_legend(comparison),
        *(f"note: {note}" for note in comparison.notes),
    ]
    write = to_markdown if as_markdown else to_text
    tables = [_text_table(comparison.reference, group) for group in _by_score(comparison)]
    return write(title, [skills_table(files), *tables], notes, width)


def skills_table(files: Sequence[ScoreFile]) -> Table:
    """Return a row for each main score, with a column of each method's skill, and the floor.

    Scores without a skill are shown themselves.
    """
    rows: list[Sequence[Cell | str]] = []
    for name in HEADLINE[files[0].task]:
        if name in files[0].metrics:
            has_skill = name in files[0].skills
            cells = [(file.skills if has_skill else file.metrics).get(name) for file in files]
            floor = floor_text(files[0], name) if has_skill else "no floor: the score itself"
            rows.append((metric(name).title, *map(score_cell, cells), floor))
    return make_table("Skill of each method", ("score", *labels_of(files), "floor"), rows)


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


def _size(comparison: Comparison) -> str:
    """Return over how many items methods are compared, in words."""
    if comparison.task == "rooms":
        return f"{comparison.items:,} images of {comparison.clusters:,} scenes"
    if comparison.task == "measured":
        groups = f" in {comparison.clusters:,} groups"
        return f"{comparison.items:,} images" + groups * (comparison.clusters < comparison.items)
    return f"{comparison.items:,} questions"


def _by_score(comparison: Comparison) -> list[list[Difference]]:
    """Return the differences in each score."""
    names = dict.fromkeys(d.metric for d in comparison.differences)
    return [[d for d in comparison.differences if d.metric == name] for name in names]


def _text_table(reference: str, differences: Sequence[Difference]) -> Table:
    name = differences[0].metric
    head = ("method", "score", "difference", *TESTS_HEAD)
    rows: list[Sequence[Cell | str]] = [
        (reference, _beside(differences[0].reference_value, differences[0]), *[""] * len(head[2:]))
    ]
    rows += [
        (d.method, _beside(d.value, d), difference_cell(d), *paired_cells(d)) for d in differences
    ]
    title = f"{name} ({metric(name).unit}, {metric(name).direction})"
    return make_table(title, head, rows)


def difference_cell(d: Difference) -> Cell:
    """Return a difference and its interval."""
    ends = (d.low, d.high)
    shown = [_signed(end, ends) for end in ends if end is not None]
    return Cell(_signed(d.difference, ends), f"[{', '.join(shown)}]" if shown else "")


def paired_cells(d: Difference) -> tuple[str, ...]:
    """Return what the paired test says, below `TESTS_HEAD`."""
    smallest = "none" if d.smallest is None else number(d.smallest)
    counts = f"{d.wins}/{d.losses}/{d.ties}"
    return counts, _probability(d.p_value), _probability(d.p_holm), smallest, d.verdict


def _beside(value: float, d: Difference) -> str:
    """Return a score as its difference is shown, whose interval is the narrower one."""
    return number(value, (d.low, d.high))


def _signed(value: float, interval: Interval) -> str:
    return ("+" if value > 0.0 else "") + number(value, interval)


def _probability(p: float) -> str:
    return f"{p:.4f}" if p >= 0.0001 else "<0.0001"


def _legend(comparison: Comparison) -> list[str]:
    """Return in sentences what the columns of a comparison say."""
    tests = {d.test for d in comparison.differences}
    of_task = {"rooms": ("scenes", "scenes"), "measured": ("groups", "groups")}
    items, apart = of_task.get(comparison.task, ("questions", "shapes"))
    if len(tests) > 1:
        test = "exact McNemar test; sign flips for means over several runs"
    elif tests == {SIGN_FLIP}:
        test = f"sign flips of the differences of each {apart[:-1]}"
    else:
        test = "exact McNemar test"
    family = len(comparison.differences)
    comparisons = f"{family} comparisons" if family > 1 else "1 comparison"
    return [
        f"difference: method - reference, paired, with its {CONFIDENCE:.0%} bootstrap interval over"
        f" {apart} (not corrected).",
        f"better/worse/same: {items}. p: {test}, two-sided; Holm: corrected for {comparisons}.",
        f"least shown: what this test set would show in {POWER:.0%} of cases after the correction,"
        " as the differences spread here; none: no difference, or none can be told.",
        *(
            f"warning: {text}"
            for text in (
                too_few_warning(comparison.clusters, items) if items != "questions" else ()
            )
        ),
    ]


def html_report(
    comparison: Comparison,
    files: Sequence[ScoreFile],
    truth: Path | None = None,
    submissions: Sequence[Path] = (),
) -> str:
    """Return a page that answers first: verdicts, then differences, scenes and curves.

    Args:
        files: those that were compared, the reference first.
        truth, submissions: where the pictures come from; else from the files that the score files
            name, where they still lie there unchanged.

    Raises AtHandError where `truth` is another one, or a submission none of those that were scored;
    OSError and FileFormatError where a picture's row cannot be read.
    """
    _require_scored(files, truth, submissions)
    images = comparison.task != "iqtt"
    digest = comparison.truth_digest[:12]
    basis = f"Over {_size(comparison)}, truth {digest}; paired tests at 5%, corrected."
    examples = _examples(comparison, files, truth, submissions) if images else []
    sections = [
        Section(
            "",
            remarks=[basis],
            tables=[skills_table(files)],
            notes=[*unread_notes(files), f"{SKILL} {what_the_floor_is(files[0])}"],
        ),
        Section(
            "Differences",
            tables=[_page_table(differences) for differences in _by_score(comparison)],
            notes=[*_legend(comparison), *comparison.notes],
        ),
    ]
    if images:
        remark = ROOMS_REMARK if examples else _NO_PICTURES
        sections.append(Section("Scenes", remarks=[remark], examples=examples))
    if comparison.task == "rooms":
        sections += curves_section(files)
    elif not images:
        sections += kinds_sections(files)
    return html_page(
        f"Compared with {comparison.reference}",
        sections,
        leads=[Lead(label, _answer(comparison, label)) for label in comparison.methods],
        warnings=[] if comparison.comparable else ["Not comparable, compared all the same."],
    )


def _require_scored(
    files: Sequence[ScoreFile], truth: Path | None, submissions: Sequence[Path]
) -> None:
    """Raise AtHandError for a file that was not scored."""
    if truth is not None and truth_at_hand(files[0], truth) is None:
        digest = files[0].meta.truth_digest[:12]
        raise AtHandError(truth, "another truth, or none", f"the one of digest {digest}")
    for path in submissions:
        if not any(submission_at_hand(file, [path]) == path for file in files):
            raise AtHandError(path, "a file that was not scored", "the first run of a score file")


def _answer(comparison: Comparison, label: str) -> str:
    """Return in which scores a method is better and worse than the reference, in words."""
    texts = []
    for verdict, words in (
        ("better", "better in"),
        ("worse", "worse in"),
        ("not shown", "no difference shown in"),
    ):
        titles = [
            metric(d.metric).title
            for d in comparison.differences
            if d.method == label and d.verdict == verdict
        ]
        texts += [f"{words} {', '.join(titles)}"] if titles else []
    return "; ".join(texts) + "."


def _page_table(differences: Sequence[Difference]) -> Table:
    """Return the others' differences from the reference in one score, each drawn on one scale."""
    definition = metric(differences[0].metric)
    points = [Point(0.0, d.difference, d.low, d.high) for d in differences]
    ends = [end for point in points for end in (point.value, point.low, point.high)]
    rows: list[Sequence[Cell | str]] = []
    for d, point in zip(differences, points, strict=True):
        method = Cell(d.method, f"{_beside(d.value, d)} instead of {_beside(d.reference_value, d)}")
        drawing, scale = strip(point, [("zero", 0.0)], ends)
        rows.append(
            (method, difference_cell(d), Cell("", scale, drawing=drawing), *paired_cells(d))
        )
    title = f"{definition.title} ({definition.unit}, {definition.direction})"
    return make_table(title, ("method", "difference", "on its scale", *TESTS_HEAD), rows)


def _examples(
    comparison: Comparison,
    files: Sequence[ScoreFile],
    truth: Path | None,
    submissions: Sequence[Path],
) -> Lists:
    """Return the scenes in which the first other method at hand gains and loses most, as all see.

    Raises OSError and FileFormatError where a file cannot be read or lacks a row.
    """
    name = next((d.metric for d in comparison.differences), shown_score(files[0]))
    where = truth_at_hand(files[0], truth)
    paths = [submission_at_hand(file, submissions) for file in files]
    there = [(files[i], path) for i, path in enumerate(paths) if path is not None]
    if where is None or paths[0] is None or len(there) < 2:
        return []
    reference, method = there[0][0], there[1][0]
    orders = common_rows([file for file, _ in there])
    apart = method.items[name][orders[1]] - reference.items[name][orders[0]]
    names = (comparison.reference, *comparison.methods)
    score, labels = metric(name), [names[i] for i, path in enumerate(paths) if path is not None]
    chosen = chosen_scenes(reference.clusters[orders[0]], apart, score.higher_is_better)
    with ExitStack() as stack:
        rooms = open_images(where)
        stack.enter_context(rooms)
        opened = [stack.enter_context(open_predictions(path)) for _, path in there]
        seen_in = {
            place: [
                list(room_examples(file, rooms, predictions, order[entries].tolist()))
                for (file, _), predictions, order in zip(there, opened, orders, strict=True)
                if isinstance(predictions, RoomPredictions)
            ]
            for place, entries in chosen.items()
        }
    lists: Lists = []
    for place, entries in chosen.items():
        scenes = f"{len(entries)} {reference.unit if len(entries) > 1 else reference.unit[:-1]}"
        title = f"{scenes} by the difference in {score.title}, {_LISTS[place]}: "
        examples = [
            Example(
                entry_name(reference, int(orders[0][entry])),
                f"{score.title} {apart[entry]:+.4g}",
                list(_side_by_side(views, labels)),
            )
            for entry, *views in zip(entries, *seen_in[place], strict=True)
        ]
        lists.append((title + f"{labels[1]} against {labels[0]}", examples))
    return lists


def _side_by_side(views: Sequence[Example], labels: Sequence[str]) -> Iterator[Picture]:
    """Yield the image and true depth, then predicted depth and error of each method."""
    yield from views[0].pictures[:2]
    for example, label in zip(views, labels, strict=True):
        for picture in example.pictures:
            if picture.caption in (DEPTH, ERROR):
                caption = label if picture.caption == DEPTH else f"error, {label}"
                yield replace(picture, caption=caption)

"""A leaderboard as a static site: rankings, a gallery, and a report of each score file.

The pages load nothing but each other, so that any server of files can show them, such as GitHub
Pages. Right answers of questions stand on none of them.
"""

import itertools
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from metrics.comparison.report import difference_cells, difference_head
from metrics.leaderboard.floors import SKILL_OF
from metrics.leaderboard.gallery import gallery
from metrics.leaderboard.paired_tests import compared_with_first, marked
from metrics.leaderboard.ranking import Paper, leaderboard
from metrics.leaderboard.table import Table
from metrics.report.at_hand import submission_at_hand, truth_at_hand
from metrics.report.charts import Chart
from metrics.report.curves import view_curves
from metrics.report.headline import answer
from metrics.report.html import render
from metrics.report.page import html_report
from metrics.report.scenes import Pictured
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import metric
from metrics.scoring.records import ScoreFile
from scenegen.common.text_table import distinct, plain, printable
from scenegen.files.new_folder import folder_written_beside

INDEX, GALLERY = "index.html", "gallery.html"
REPORT = re.compile(r"report-\d+-[a-z0-9-]*\.html")
Card = tuple[str, str, tuple[str, str, str]]  # label, link, and what the report is about


@dataclass(frozen=True)
class Section:
    """What the site shows of one test set.

    Attributes:
        title: of the test set.
        made: how its truth was made, or how it is called; may be empty.
        lead: what the first row is, such as "leads", and its first cell: value, what follows it,
            and of what.
        rankings: tables that rank, or belong to one.
        groups: tables by view angle or kind of question.
        curves: by view angle, of the comparable methods.
        tests: head and rows of the paired tests against the first method.
        cards: of each score file, the best first.
        scenes: as each method sees them.
    """

    title: str
    made: str
    lead: tuple[str, str, str, str]
    rankings: Sequence[Table]
    groups: Sequence[Table]
    curves: Sequence[Chart]
    tests: tuple[Sequence[str], Sequence[Sequence[str]]]
    cards: Sequence[Card]
    scenes: Sequence[Pictured]


def write_site(
    files: Sequence[ScoreFile],
    folder: str | Path,
    metrics: Sequence[str] | None = None,
    *,
    paper: Paper = "task",
    overwrite: bool = False,
) -> None:
    """Write index.html, gallery.html and a report of each score file to a folder.

    Pictures come from the truths and submissions that the score files name, where they still lie
    there unchanged. With `overwrite` an older site is replaced as a whole.

    Raises as `ranking.leaderboard` and `new_folder.folder_written_beside`.
    """
    folder = Path(folder)
    names = report_names(files)
    links = {id(file): name for file, name in zip(files, names, strict=True)}
    tables = leaderboard(files, metrics, paper=paper)
    old = [p.name for p in folder.glob("report-*.html") if REPORT.fullmatch(p.name)]
    with folder_written_beside(folder, {INDEX, GALLERY, *names, *old}, overwrite) as new:
        sections = list(_sections(tables, links))
        others = [table for table in tables if not _files(table)]
        pages = {
            INDEX: render("site.html", sections=sections, others=others),
            GALLERY: render("gallery.html", sections=sections),
        }
        for name, page in pages.items():
            (new / name).write_text(page, encoding="utf-8")
        for file, name in zip(files, names, strict=True):
            (new / name).write_text(_report(file), encoding="utf-8")


def report_names(files: Sequence[ScoreFile]) -> list[str]:
    """Return names for the reports: a number, then what of the method's name suits an address."""
    words = [re.sub(r"[^a-z0-9]+", "-", file.method.lower()).strip("-")[:40] for file in files]
    return [f"report-{i}-{word or 'method'}.html" for i, word in enumerate(words, 1)]


def _report(file: ScoreFile) -> str:
    """The report of a score file, with pictures of rooms where truth and submission are at hand."""
    truth = truth_at_hand(file) if file.task == "rooms" else None
    submission = submission_at_hand(file) if truth else None
    runs = [submission] if submission else []
    return html_report(file, truth or Path(file.meta.truth_path), runs, home=INDEX)


def _files(table: Table) -> list[ScoreFile]:
    return [row.file for row in table.rows if row.file is not None]


def _sections(tables: Sequence[Table], links: Mapping[int, str]) -> Iterator[Section]:
    """Yield a section for each test set, in the order of the tables."""
    by_truth: dict[tuple[str, str], list[Table]] = {}
    for table in tables:
        for file in _files(table)[:1]:
            by_truth.setdefault((file.task, file.meta.truth_digest), []).append(table)
    for members in by_truth.values():
        files = _files(members[0])
        ranked = [file for file in files if file.comparable]
        found, verdicts = compared_with_first(files)
        linked = [_linked(marked(table, verdicts), links) for table in members]
        main = {name for table in members for name in table.keys if _is_score(name)}
        rankings = [t for t in linked if set(t.keys) & main]
        labels = distinct([f.method for f in files], [f.path.stem if f.path else "" for f in files])
        rows = [
            (f"{one[0]}, {metric(d.metric).title}", *one[1:])
            for d in (found.differences if found else ())
            for one in [difference_cells(d)]
        ]
        against = f"method, against {found.reference}" if found else ""
        named = [label for f, label in zip(files, labels, strict=True) if f.comparable]
        yield Section(
            title=members[0].title,
            made=_how_made(files[0]),
            lead=_lead(members[0]),
            rankings=rankings,
            groups=[table for table in linked if table not in rankings],
            curves=list(view_curves(ranked, named)) if ranked and ranked[0].task == "rooms" else (),
            tests=((against, *difference_head()[1:]), rows),
            cards=[
                (label, links[id(f)], answer(f)) for f, label in zip(files, labels, strict=True)
            ],
            scenes=gallery(files, labels),
        )


def _is_score(key: str) -> bool:
    """Return whether a column is of a score or its skill, and not of an angle or a kind."""
    from metrics.scoring.metric_names import UnknownMetricError

    try:
        metric(key.removeprefix(SKILL_OF))
    except UnknownMetricError:
        return False
    return True


def _linked(table: Table, links: Mapping[int, str]) -> Table:
    rows = (replace(row, link=links.get(id(row.file), "")) for row in table.rows)
    return replace(table, rows=tuple(rows))


def _lead(table: Table) -> tuple[str, str, str, str]:
    """Return what the first row of a ranking is, and its first cell, as in `Section.lead`."""
    row, cell = table.rows[0], table.rows[0].cells[0]
    assert row.file is not None
    firsts = sum(other.rank == "1" for other in table.rows)
    if not row.rank:
        what = "is not ranked"
    elif firsts > 1:
        what = f"is one of {firsts} in the first place"
    else:
        what = "leads" if len(_files(table)) > 1 else "alone"
    value, _, told = answer(row.file)
    known = table.keys[0].startswith(SKILL_OF) and value == cell.value
    return what, cell.value, cell.rest.strip(), told if known else table.columns[0]


def _how_made(file: ScoreFile) -> str:
    """Return preset and command of a test set of the benchmark, and of others the preset alone.

    The command that a truth records may name the seed, from which anyone can make the right answers
    and depths of a test set that is withheld.
    """
    known = known_test(file.meta.truth_digest)
    if known:
        return f"{preset_of(known.command)}; {printable(known.command)}"
    command = _recorded_command(file)
    return preset_of(command) if command else plain(Path(file.meta.truth_path).name)


def preset_of(command: str) -> str:
    """Return the preset that a command names, in words; the default one where it names none."""
    try:
        words = shlex.split(command)
    except ValueError:
        words = command.split()
    given = [b for a, b in itertools.pairwise(words) if a == "--preset"]
    given += [word.partition("=")[2] for word in words if word.startswith("--preset=")]
    default = "shapes" if "render" in words else "small"
    return f"preset {plain(given[-1]) if given else default}"


def _recorded_command(file: ScoreFile) -> str:
    truth = truth_at_hand(file)
    if truth is None:
        return ""
    if file.task == "rooms":
        from scenegen.rooms.reader import RoomsFile

        with RoomsFile(truth) as rooms:
            return str(rooms.attributes.get("creation_command", ""))
    from iqtt.files.reader import AnswersFile

    with AnswersFile(truth) as answers:
        return str(answers.attributes.get("creation_command", ""))

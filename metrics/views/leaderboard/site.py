"""A leaderboard as a static site: rankings, a gallery, and a report of each score file.

The pages load nothing but each other, so that any server of files can show them, such as GitHub
Pages. Right answers of questions stand on none of them.
"""

import itertools
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import metric
from metrics.scoring.records import ScoreFile
from metrics.views.at_hand import submission_at_hand, truth_at_hand
from metrics.views.by_angle import view_curves
from metrics.views.compare.report import TESTS_HEAD, difference_cell, paired_cells
from metrics.views.examples import Example
from metrics.views.headline import answer
from metrics.views.leaderboard.cards import Card
from metrics.views.leaderboard.gallery import gallery
from metrics.views.leaderboard.ranking import Paper, Ranking, rankings
from metrics.views.page import Lead, Link, Section, html_page
from metrics.views.report import html_report
from metrics.views.score_tables import labels_of
from metrics.views.table import Cell, Table, make_row, make_table
from scenegen.common.text_table import plain, printable
from scenegen.files.new_file import folder_written_beside

INDEX, GALLERY = "index.html", "gallery.html"
REPORT = re.compile(r"report-\d+-[a-z0-9-]*\.html")
METHODS = ("", "incomparable")  # kinds of rows
GALLERY_TITLE = "Predicted depth of the same scenes, spread evenly over the test set"


def to_html(tables: Sequence[Table]) -> str:
    """Return the tables of a leaderboard as one page."""
    sections = [Section(table.title, tables=[table]) for table in tables]
    return html_page("Leaderboard", sections, sortable=True)


def write_site(
    files: Sequence[ScoreFile],
    folder: str | Path,
    metrics: Sequence[str] | None = None,
    *,
    paper: Paper = "task",
    cards: Mapping[str, Card] | None = None,
    overwrite: bool = False,
) -> None:
    """Write index.html, gallery.html and a report of each score file to a folder.

    Pictures come from the truths and submissions that the score files name, where they still lie
    there unchanged. With `overwrite` an older site is replaced as a whole.

    Raises as `ranking.rankings` and `new_file.folder_written_beside`.
    """
    folder = Path(folder)
    names = report_names(files)
    links = {id(file): name for file, name in zip(files, names, strict=True)}
    ranked, others = rankings(files, metrics, paper=paper, tested=True, links=links, cards=cards)
    old = [p.name for p in folder.glob("report-*.html") if REPORT.fullmatch(p.name)]
    with folder_written_beside(folder, {INDEX, GALLERY, *names, *old}, overwrite) as new:
        scenes = [gallery(ranking.files, labels_of(ranking.files)) for ranking in ranked]
        sections = [s for args in zip(ranked, scenes, strict=True) for s in _sections(*args)]
        sections += [Section(table.title, tables=[table], folded=True) for table in others]
        gallery_sections = [
            _gallery_section(ranking, shown, links)
            for ranking, shown in zip(ranked, scenes, strict=True)
        ]
        for name, title, content in (
            (INDEX, "Leaderboard", sections),
            (GALLERY, "Gallery", gallery_sections),
        ):
            pages = ((INDEX, "Leaderboard"), (GALLERY, "Gallery"))
            navigation = [Link(address, text, address == name) for address, text in pages]
            page = html_page(title, content, links=navigation, sortable=name == INDEX)
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


def _sections(ranking: Ranking, scenes: Sequence[Example]) -> Iterator[Section]:
    """Yield the ranking of a test set with its curves, then folded tables.

    Beside each method is its depth of the first of the gallery's scenes.
    """
    compared = [file for file in ranking.files if file.comparable]
    charts = []
    if compared and compared[0].task == "rooms":
        labels = dict(zip(map(id, ranking.files), labels_of(ranking.files), strict=True))
        charts = list(view_curves(compared, [labels[id(file)] for file in compared]))
    yield Section(
        ranking.title,
        leads=[lead_of(ranking)],
        remarks=[_how_made(ranking.files[0])],
        tables=[_with_thumbnails(ranking, scenes[:1]), *ranking.tables[1:]],
        charts=charts,
    )
    for table in ranking.groups:
        yield Section(table.title, tables=[table], folded=True)
    if ranking.comparison is not None:
        rows: list[Sequence[Cell | str]] = [
            (f"{d.method}, {metric(d.metric).title}", difference_cell(d), *paired_cells(d))
            for d in ranking.comparison.differences
        ]
        against = f"method, against {ranking.comparison.reference}"
        table = make_table("Paired tests", (against, "difference", *TESTS_HEAD), rows)
        yield Section(f"Paired tests: {ranking.title}", tables=[table], folded=True)


def _with_thumbnails(ranking: Ranking, scenes: Sequence[Example]) -> Table:
    """Return the ranking with each method's depth of one scene before its name."""
    urls = {picture.caption: picture.url for scene in scenes for picture in scene.pictures}
    labels, rows = iter(labels_of(ranking.files)), []
    for row in ranking.tables[0].rows:
        url = urls.get(f"depth of {next(labels)}", "") if row.kind in METHODS else ""
        first, name, *rest = row.cells
        rows.append(replace(row, cells=(first, replace(name, drawing=url), *rest)))
    return replace(ranking.tables[0], rows=tuple(rows))


def lead_of(ranking: Ranking) -> Lead:
    """Return what the first row of a ranking is, and its first score."""
    entry = ranking.entries[0]
    rows, head = ranking.tables[0].rows, ranking.tables[0].head[2]
    row = next(row for row in rows if row.kind != "floor")
    firsts = sum(other.rank == "1" for other in ranking.entries)
    if ranking.mute:
        return Lead("No method", "is told apart on this test set")
    if not entry.file.comparable:
        words = "is not ranked"
    elif not entry.rank:
        return Lead("No method", f"is better than the floor in {head}")
    elif firsts > 1:
        words = f"is one of {firsts} in the first place"
    else:
        words = "leads" if len(ranking.entries) > 1 else "alone"
    return Lead(entry.label, f"{words}: {row.cells[2]} {head}", entry.link)


def _gallery_section(
    ranking: Ranking, scenes: Sequence[Example], links: Mapping[int, str]
) -> Section:
    """Return the answer of each method, with a link to its report, and scenes as they see them."""
    labels = labels_of(ranking.files)
    rows = []
    for file, label in zip(ranking.files, labels, strict=True):
        lead = answer(file)
        rows.append(make_row([label, lead.strong, lead.text], link=links[id(file)]))
    table = Table("", ("method", "", "of what"), tuple(rows))
    examples = [(GALLERY_TITLE, scenes)] if scenes else []
    remark = _how_made(ranking.files[0])
    return Section(ranking.title, remarks=[remark], tables=[table], examples=examples)


def _how_made(file: ScoreFile) -> str:
    """Return preset and command of a test set of the benchmark, and of others the preset alone.

    The command that a truth records may name the seed, from which anyone can make the right answers
    and depths of a test set that is withheld.
    """
    test = known_test(file.meta.truth_digest)
    if test:
        return f"{preset_of(test.command)}; {printable(test.command)}"
    command = _recorded_command(file)
    return preset_of(command) if command else plain(Path(file.meta.truth_path).name)


def preset_of(command: str) -> str:
    """Return the preset that a command names, in words; the default one where it names none."""
    try:
        words = shlex.split(command)
    except ValueError:
        words = command.split()
    names = [b for a, b in itertools.pairwise(words) if a == "--preset"]
    names += [word.partition("=")[2] for word in words if word.startswith("--preset=")]
    default = "shapes" if "render" in words else "small"
    return f"preset {plain(names[-1]) if names else default}"


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

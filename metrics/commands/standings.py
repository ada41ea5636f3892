"""The `bench` commands on several methods: compare them, and rank them.

Both take score files and submissions, which are scored before.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from metrics.commands.options import FITS, MARKDOWN, SEED
from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import OVERWRITE
from scenegen.command_line.output import line_width, print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputPath

if TYPE_CHECKING:
    from metrics.scoring.records import ScoreFile

ALIGN = click.option(
    "--align",
    type=click.Choice(FITS),
    help="Alignment that is fitted to the ground truth of each image, for all methods [default: of"
    " the alignments that the methods declare, the one with the most free parameters].",
)
TRUTH = click.option(
    "--truth",
    type=InputPath(),
    help="Ground truth of the submissions [default: the file that each submission names].",
)


def _scores_of(paths: tuple[str, ...], truth: str | None, **settings: Any) -> "list[ScoreFile]":
    from metrics.scoring.runs import Settings
    from metrics.views.compare.methods import read_or_score

    @contextmanager
    def progress_of(rows: int) -> Iterator[Any]:
        with progress_bar(rows, "image") as bar:
            yield bar.update

    return read_or_score(paths, truth, Settings(**settings), progress_of)


@click.command(
    epilog=EXAMPLE + "bench compare theirs.h5 mine.h5 --truth rooms.h5\n"
    "  bench compare baseline.json mine.json --metric chamfer"
)
@click.argument("scores", nargs=-1, required=True, type=InputPath(), metavar="FIRST OTHER...")
@TRUTH
@click.option(
    "--metric", "metrics", multiple=True,
    help="Metric to compare. Repeatable [default: the main metrics].",
)  # fmt: skip
@click.option("--json", "json_path", type=OutputPath(), help="Write the comparison as JSON.")
@click.option(
    "--html", "html_path", type=OutputPath(), help="Write a page with verdicts and charts."
)
@MARKDOWN
@SEED
@ALIGN
@click.option(
    "--allow-incomparable",
    is_flag=True,
    help="Allow files with scores of different parts of a test set. The comparison then uses the"
    " images or questions that are in all files.",
)
@OVERWRITE
def compare(
    scores: tuple[str, ...],
    truth: str | None,
    metrics: tuple[str, ...],
    json_path: str | None,
    html_path: str | None,
    markdown: bool,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Compare the scores of each OTHER method with the scores of the FIRST method.

    FIRST and OTHER are score files of `bench score --json`, or submissions, which are scored first.
    The comparison is paired by image or question. All methods get the same alignment. The output
    lists the differences (OTHER minus FIRST) with confidence intervals, verdicts, significance
    tests, and the smallest difference that the test set can detect.
    """
    from metrics.scoring.aligned import aligned
    from metrics.views.compare.compare import compare as compare_files
    from metrics.views.compare.report import html_report, text_report, to_json
    from scenegen.files.new_file import check_writable, write_text

    for path in (json_path, html_path):
        if path:
            check_writable(Path(path), overwrite)
    files = _scores_of(scores, truth, seed=settings["seed"], align=settings["align"])
    comparison = compare_files(files, metrics or None, **settings)
    files = aligned(files, comparison.alignment)
    if json_path:
        write_text(json_path, to_json(comparison), overwrite)
    if html_path:
        write_text(html_path, html_report(comparison, files), overwrite)
    click.echo(text_report(comparison, files, markdown, line_width()))


@click.command(
    epilog=EXAMPLE + "bench leaderboard baseline.json mine.h5 --truth rooms.h5"
    " --format html --out b.html"
)
@click.argument("scores", nargs=-1, required=True, type=InputPath(), metavar="METHOD...")
@TRUTH
@click.option(
    "--metric", "metrics", multiple=True,
    help="Metric to show. Repeatable. Methods are ranked by the first --metric [default: the main"
    " metrics].",
)  # fmt: skip
@click.option(
    "--format",
    "form",
    type=click.Choice(["markdown", "text", "html", "latex"]),
    default="markdown",
    show_default=True,
    help="Format of the tables.",
)
@click.option("--no-intervals", is_flag=True, help="Print values without confidence intervals.")
@click.option(
    "--caption", default="", help="Caption of the first LaTeX table [default: its test set]."
)
@click.option(
    "--label",
    default="",
    help=r"Label of the first LaTeX table, for \ref. Further tables get this label and a number.",
)
@click.option("--out", type=OutputPath(), help="Output file [default: print the tables].")
@ALIGN
@click.option("--no-paper", is_flag=True, help="Leave out the results of the Pix2Shape paper.")
@OVERWRITE
def leaderboard(
    scores: tuple[str, ...],
    truth: str | None,
    metrics: tuple[str, ...],
    form: str,
    no_intervals: bool,
    caption: str,
    label: str,
    out: str | None,
    align: Any,
    no_paper: bool,
    overwrite: bool,
) -> None:
    """Rank methods, in one table per test set. All methods of a table get the same alignment.

    Each METHOD is a score file of `bench score --json`, or a submission, which is scored first.
    Methods are ranked by their first main metric: shape_error for box rooms, abs_rel for interiors
    and sensor data, solid_iou for layers and meshes, and accuracy for questions. In box rooms with
    several views, methods that get only the first view are ranked by behind_depth_error. Baselines
    have no rank. The results of the Pix2Shape paper also have no rank, because the paper used other
    data.
    """
    from metrics.views.leaderboard import leaderboard as rank
    from metrics.views.leaderboard import to_html
    from metrics.views.table import to_latex, to_markdown, to_text, without_rests
    from scenegen.files.new_file import check_writable, write_text

    if (caption or label) and form != "latex":
        raise click.UsageError("--caption and --label need --format latex")
    if out is not None:
        check_writable(Path(out), overwrite)
    files = _scores_of(scores, truth, align=align)
    tables = list(rank(files, metrics or None, paper=not no_paper, align=align))
    if no_intervals:
        tables = [without_rests(table) for table in tables]
    if caption and tables:
        tables[0] = replace(tables[0], title=caption)
    if form == "html":
        text = to_html(tables)
    elif form == "latex":
        text = to_latex(tables, label)
    else:
        in_form = to_text if form == "text" else to_markdown
        text = in_form("", tables, width=line_width() if out is None else None)
    if out is None:
        click.echo(text)
        return
    write_text(out, f"{text}\n", overwrite)
    print_line(f"{out}: {len(scores)} methods")


COMMANDS = (compare, leaderboard)

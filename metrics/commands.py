"""The `bench` commands that score: each parses its options, makes one library call, and prints.

Heavy imports happen inside the commands, so that `--help` is fast.
"""

from pathlib import Path
from typing import Any

import click

from scenegen.commands.viewing import page_options
from scenegen.common.command_line import (
    EXAMPLE,
    LARGEST,
    MESHES,
    MOST_PROCESSES,
    OVERWRITE,
    SCHEDULER,
    Items,
    needs,
    on_scheduler,
    print_line,
    progress_bar,
)
from scenegen.common.paths import InputPath, OutputFolder, OutputPath, refuse_inputs

TRUTH = click.option(
    "--truth",
    type=InputPath(),
    help="The rooms file or the file of answers to score against [default: the file that the"
    " submission names; scores are then comparable only if it is a known test set].",
)
MARKDOWN = click.option("--markdown", is_flag=True, help="Print Markdown instead of aligned text.")
SEED = click.option(
    "--seed",
    type=click.IntRange(0, LARGEST),
    default=0,
    show_default=True,
    help="Seed of the bootstrap.",
)


@click.command(
    epilog=EXAMPLE + "bench score predictions.h5 --truth rooms.h5 --json mine.json --html me.html"
)
@click.argument("submissions", nargs=-1, required=True, type=InputPath(), metavar="PREDICTIONS...")
@TRUTH
@click.option(
    "--json", "json_path", type=OutputPath(), help="Write the means and the scores of all items."
)
@click.option(
    "--csv", "csv_path", type=OutputPath(), help="Write a table of the scores of every item."
)
@click.option(
    "--html",
    "html_path",
    type=OutputPath(),
    help="Write a page: the headline, pictures of scenes or questions, curves, all numbers.",
)
@click.option(
    "--beside",
    multiple=True,
    type=InputPath(),
    metavar="SCORES.json",
    help="Scores on the same truth to show beside these in the page; may be repeated.",
)
@MARKDOWN
@SEED
@click.option(
    "--resamples", type=click.IntRange(100, 100_000), default=2000, show_default=True,
    help="How many resamples the bootstrap draws.",
)  # fmt: skip
@click.option(
    "--allow-partial",
    is_flag=True,
    help="Score only the rows that are predicted; the scores are then not comparable.",
)
@click.option(
    "--non-finite",
    type=click.Choice(["error", "penalise"]),
    default="error",
    show_default=True,
    help="Refuse values that are not finite, or score them as the worst possible; the scores are"
    " then not comparable.",
)
@click.option(
    "--processes",
    type=click.IntRange(1, MOST_PROCESSES),
    help="How many processes score [default: one a core].",
)
@SCHEDULER
@OVERWRITE
def score(
    submissions: tuple[str, ...],
    truth: str | None,
    json_path: str | None,
    csv_path: str | None,
    html_path: str | None,
    beside: tuple[str, ...],
    markdown: bool,
    scheduler: str | None,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Score a submission, or several training runs of one method, and print a table."""
    from metrics.report.text import text_report, write_csv
    from metrics.score_file import write_scores
    from metrics.scoring.evaluate import count_rows
    from metrics.scoring.evaluate import score as score_files
    from metrics.scoring.runs import Settings, scorer_versions
    from metrics.submissions.reader import open_predictions
    from metrics.submissions.truths import find_truth
    from scenegen.common.new_file import check_writable, write_text

    outputs = [Path(path) for path in (json_path, csv_path, html_path) if path]
    for path in outputs:
        check_writable(path, overwrite)
    others: list[Any] = []
    if beside:
        from metrics.report.page import read_beside

        if html_path is None:
            raise click.UsageError("--beside is for the page: give --html, too")
        others = read_beside(beside, submissions[0])
    for name in submissions if any(path.exists() for path in outputs) else ():
        with open_predictions(name) as predictions:
            refuse_inputs(outputs, [find_truth(predictions, truth).path])
    workers = settings["processes"] or 0
    with (
        on_scheduler(scheduler, workers, scorer_versions) as cluster,
        progress_bar(count_rows(submissions[0]), "image") as bar,
    ):
        chosen = Settings(**settings, cluster=cluster)
        found = score_files(submissions, truth, chosen, bar.update)
    if json_path:
        write_scores(found, json_path, overwrite)
    if csv_path:
        write_csv(found, csv_path, overwrite)
    try:
        if html_path:
            from metrics.report.page import html_report

            truth_path, runs = Path(found.meta.truth_path), [Path(path) for path in submissions]
            write_text(html_path, html_report(found, truth_path, runs, others), overwrite)
    finally:  # a page that cannot be made loses no score
        click.echo(text_report(found, markdown))


@click.command(epilog=EXAMPLE + "bench validate predictions.h5 --truth rooms.h5")
@click.argument("submission", type=InputPath(), metavar="PREDICTIONS")
@TRUTH
@click.pass_context
def validate(ctx: click.Context, submission: str, truth: str | None) -> None:
    """List everything that is wrong with a submission, and hints at likely mistakes.

    The exit code is 2 if the submission cannot be scored.
    """
    from metrics.submissions.validation import validate as problems_of

    problems = problems_of(submission, truth)
    for problem in problems:
        print_line(f"{'hint' if problem.is_hint else 'wrong':5}  {problem}")
    wrong = sum(not problem.is_hint for problem in problems)
    told = f"{wrong} problems" if wrong > 1 else "1 problem"
    print_line(f"{submission}: {told if wrong else 'valid'}")
    ctx.exit(2 if wrong else 0)


@click.command(epilog=EXAMPLE + "bench compare baseline.json mine.json --metric chamfer")
@click.argument(
    "scores", nargs=-1, required=True, type=InputPath(), metavar="REFERENCE.json OTHER.json..."
)
@click.option(
    "--metric", "metrics", multiple=True,
    help="A score to compare; may be repeated [default: the headline scores].",
)  # fmt: skip
@click.option("--json", "json_path", type=OutputPath(), help="Write the comparison here.")
@click.option(
    "--html",
    "html_path",
    type=OutputPath(),
    help="Write a page: verdicts, headline, pictures of scenes, curves.",
)
@click.option(
    "--truth",
    type=InputPath(),
    help="The truth, for the page's pictures [default: the file that was scored against, where it"
    " still lies there].",
)
@click.option(
    "--predictions",
    multiple=True,
    type=InputPath(),
    metavar="PREDICTIONS",
    help="A submission that was scored, for the page's pictures; may be repeated [default: those"
    " that the score files name, where they still lie there].",
)
@MARKDOWN
@SEED
@click.option(
    "--allow-incomparable",
    is_flag=True,
    help="Compare files that say that they are not comparable, over the rows that all have.",
)
@OVERWRITE
def compare(
    scores: tuple[str, ...],
    metrics: tuple[str, ...],
    json_path: str | None,
    html_path: str | None,
    truth: str | None,
    predictions: tuple[str, ...],
    markdown: bool,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Compare methods with the first one, item by item.

    Prints the differences, their confidence intervals and significance tests, and the smallest
    difference that the test set could show.
    """
    from metrics.comparison.compare import compare as compare_files
    from metrics.comparison.report import text_report, to_json
    from metrics.score_file import read_scores
    from scenegen.common.new_file import check_writable, write_text

    for path in (json_path, html_path):
        if path:
            check_writable(Path(path), overwrite)
    if (truth or predictions) and html_path is None:
        raise click.UsageError("--truth and --predictions are for the page: give --html, too")
    files = [read_scores(path) for path in scores]
    found = compare_files(files, metrics or None, **settings)
    if json_path:
        write_text(json_path, to_json(found), overwrite)
    try:
        if html_path:
            from metrics.comparison.page import html_comparison

            given = Path(truth) if truth else None
            page = html_comparison(found, files, given, [Path(path) for path in predictions])
            write_text(html_path, page, overwrite)
    finally:
        click.echo(text_report(found, markdown))


@click.command(
    epilog=EXAMPLE + "bench leaderboard baseline.json mine.json --format html --out b.html"
)
@click.argument("scores", nargs=-1, type=InputPath(), metavar="[SCORES.json]...")
@click.option(
    "--metric", "metrics", multiple=True,
    help="A score to show; may be repeated, and the first one ranks [default: the headline"
    " scores].",
)  # fmt: skip
@click.option(
    "--format",
    "form",
    type=click.Choice(["markdown", "html", "latex"]),
    default="markdown",
    show_default=True,
    help="Format of the tables.",
)
@click.option("--out", type=OutputPath(), help="Write to this file instead of printing.")
@click.option(
    "--html",
    "folder",
    type=OutputFolder(),
    metavar="DIR",
    help="Write a static site to this folder, fit for GitHub Pages: the rankings with paired tests,"
    " a gallery, and a report of each score file.",
)
@click.option(
    "--recheck",
    is_flag=True,
    help="Recompute all means and intervals from the scores of the items first, and refuse files"
    " where they differ. The standard deviations over runs cannot be recomputed.",
)
@click.option(
    "--paper",
    type=click.Choice(["task", "all", "none"]),
    default="task",
    show_default=True,
    help="Which of the paper's own figures to show: those of the score files' tasks, all, or none.",
)
@click.option("--no-paper", is_flag=True, help="The same as --paper none.")
@OVERWRITE
def leaderboard(
    scores: tuple[str, ...],
    metrics: tuple[str, ...],
    form: str,
    out: str | None,
    folder: str | None,
    recheck: bool,
    paper: Any,
    no_paper: bool,
    overwrite: bool,
) -> None:
    """Rank score files in one table for each test set.

    The headline ranks: relief for rooms, skill for questions. Floors, and what the paper reported
    on its own data, stand below the methods, without a rank.
    """
    from metrics.leaderboard import text
    from metrics.leaderboard.ranking import leaderboard as rank
    from metrics.score_file import read_scores
    from scenegen.common.new_file import check_writable, write_text

    if out is not None:
        check_writable(Path(out), overwrite)
    files = [read_scores(path) for path in scores]
    if recheck:
        from metrics.leaderboard.recheck import recheck as recompute
        from metrics.leaderboard.recheck import steps

        with progress_bar(sum(map(steps, files)), "group") as bar:
            for file in files:
                recompute(file, bar.update)
    shown: Any = "none" if no_paper else paper
    if folder is not None:
        from metrics.leaderboard.site import write_site

        write_site(files, folder, metrics or None, paper=shown, overwrite=overwrite)
        print_line(f"{folder}: {len(scores)} score files; open {Path(folder) / 'index.html'}")
        if out is None:
            return
    tables = rank(files, metrics or None, paper=shown)
    page: str = getattr(text, f"to_{form}")(tables)
    if out is None:
        click.echo(page)
        return
    write_text(out, page, overwrite)
    print_line(f"{out}: {len(scores)} score files")


@click.command(epilog=EXAMPLE + "bench view predictions.h5 --truth rooms.h5 --open")
@click.argument("submission", type=InputPath(), metavar="PREDICTIONS")
@TRUTH
@click.option(
    "--scores", "scores_path", type=InputPath(),
    help="Score file of the submission, from `bench score --json` [default: the rows are scored].",
)  # fmt: skip
@click.option(
    "--items", type=Items(),
    help="Rows of the truth to show [default: all of --scores, or the first 100].",
)  # fmt: skip
@page_options
@MESHES
def view(
    submission: str,
    truth: str | None,
    scores_path: str | None,
    items: list[int] | None,
    port: int,
    host: str | None,
    public: bool,
    names: tuple[str, ...],
    open_browser: bool,
    **meshes: Any,
) -> None:
    """Show predictions of rooms in 3D, in the browser: the worst scenes first, by any score.

    Predicted surfels are beside the true ones, coloured by the error of their depth; a click on one
    tells both depths. The page asks for nothing outside this machine. Ctrl-C ends it.
    """
    needs("bench view", ("viser",), "view")
    from metrics.submissions.reader import open_predictions
    from metrics.submissions.truths import find_truth
    from metrics.viewing.order import MOST_SCORED, require_rooms, shown_scores
    from metrics.viewing.page import PredictionPage
    from scenegen.rooms.reader import RoomsFile
    from scenegen.viewing.geometry import shapes_of
    from scenegen.viewing.server import listening_host, serve, started

    where = listening_host(host, public), port, names
    with open_predictions(submission) as opened:
        predictions = require_rooms(opened)
        with RoomsFile(find_truth(predictions, truth).path) as rooms:
            shape_of = shapes_of(rooms.spec, **meshes)
            if not items and not scores_path and len(predictions) > MOST_SCORED:
                told = f"note: the first {MOST_SCORED} of {len(predictions)} rows are shown"
                print_line(f"{told}; --items or --scores shows others", err=True)
            count = len(items) if items else min(len(predictions), MOST_SCORED)
            with progress_bar(count, "image") as bar:
                scores = shown_scores(predictions, rooms, items, scores_path, bar.update)
            with started(f"{predictions.method}: {submission}", *where) as server:
                PredictionPage(server, rooms, predictions, scores, shape_of)
                serve(server, print_line, open_browser, public)


@click.command("describe-format", epilog=EXAMPLE + "bench describe-format")
def describe_format() -> None:
    """Print the format of submissions, and how to write one."""
    from metrics.submissions.layout import describe_format as text

    click.echo(text())


COMMANDS = (score, validate, view, compare, leaderboard, describe_format)

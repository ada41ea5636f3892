"""The `bench` commands on submissions: check, score and show them, and tell their format."""

from pathlib import Path
from typing import Any, cast

import click

from metrics.commands.options import FITS, MARKDOWN, SEED
from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import MOST_PROCESSES, OVERWRITE, SCHEDULER, Items
from scenegen.command_line.output import line_width, on_scheduler, print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputPath, refuse_inputs
from scenegen.commands.viewing import RECORDING, record

TRUTH = click.option(
    "--truth",
    type=InputPath(),
    help="The rooms file or the file of answers to score against [default: the file that the"
    " submission names; scores are then comparable only if it is a known test set].",
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
@click.option(
    "--all", "whole", is_flag=True, help="Print all scores and groups, not only the headline."
)
@MARKDOWN
@SEED
@click.option(
    "--resamples", type=click.IntRange(100, 100_000), default=2000, show_default=True,
    help="How many resamples the bootstrap draws.",
)  # fmt: skip
@click.option(
    "--floors",
    type=InputPath(),
    metavar="FLOORS.json",
    help="Floors of questions, from `iqtt floors` [default: those of the package].",
)
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
@click.option(
    "--protocol",
    default="",
    metavar="NAME",
    help="Of measured truth: a protocol of docs/real-data.md, or `all` for a table of all that suit"
    " [default: declared].",
)
@click.option(
    "--align",
    type=click.Choice(FITS),
    help="Score images after this alignment to the truth of each, as loose as the declared one or"
    " looser [default: the declared one].",
)
@click.option(
    "--figure", "figure_path", type=OutputPath(), help="Draw --protocol all here: .pdf, .svg, .png."
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
    whole: bool,
    markdown: bool,
    scheduler: str | None,
    overwrite: bool,
    protocol: str,
    figure_path: str | None,
    **settings: Any,
) -> None:
    """Score a submission, or several training runs of one method, and print the headline."""
    from metrics.score_file import write_scores
    from metrics.scoring.evaluate import open_runs, score_runs
    from metrics.scoring.runs import Settings, scorer_versions
    from metrics.submissions.validation import hints
    from metrics.views.report import html_report, read_beside
    from metrics.views.score_tables import text_report, write_csv
    from scenegen.files.new_file import check_writable, write_text

    paths = (json_path, csv_path, html_path, figure_path)
    outputs = [Path(path) for path in paths if path]
    for path in outputs:
        check_writable(path, overwrite)
    if beside and html_path is None:
        raise click.UsageError("--beside is for the page: give --html, too")
    if (protocol == "all") != bool(figure_path) and (figure_path or outputs):
        raise click.UsageError("--protocol all gives a table and --figure; keep one with NAME")
    if protocol == "all":
        _score_all(submissions, truth, Settings(**settings), figure_path, markdown, overwrite)
        return
    with open_runs(submissions, truth) as runs:
        refuse_inputs(outputs, [runs.truth.path])
        others = read_beside(beside, runs.truth)
        with (
            on_scheduler(scheduler, settings["processes"] or 0, scorer_versions) as cluster,
            progress_bar(len(runs.files[0]), "image") as bar,
        ):
            options = Settings(**settings, cluster=cluster, protocol=protocol)
            scores = score_runs(runs, options, bar.update)
        for file in runs.files:
            for hint in hints(file, runs.truth):
                print_line(f"hint: {file.path}: {hint}", err=True)
        if json_path:
            write_scores(scores, json_path, overwrite)
        if csv_path:
            write_csv(scores, csv_path, overwrite)
        try:
            if html_path:
                write_text(html_path, html_report(scores, runs, others), overwrite)
        finally:  # a page that cannot be made loses no score
            click.echo(text_report(scores, markdown, whole, line_width()))


def _score_all(
    submissions: tuple[str, ...], truth: str | None, settings: Any, figure: str | None,
    markdown: bool, overwrite: bool,
) -> None:  # fmt: skip
    """Print the scores under all protocols that suit, and draw them."""
    from metrics.scoring.evaluate import open_runs, score_protocols
    from metrics.views.protocols import draw_protocols, protocols_report

    with open_runs(submissions, truth) as runs:
        with progress_bar(len(runs.files[0]), "image") as bar:
            scores = score_protocols(runs, settings, bar.update)
        if figure:
            draw_protocols(figure, scores, overwrite)
    click.echo(protocols_report(scores, markdown, line_width()))


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
    counted = f"{wrong} problems" if wrong > 1 else "1 problem"
    print_line(f"{submission}: {counted if wrong else 'valid'}")
    ctx.exit(2 if wrong else 0)


@click.command(epilog=EXAMPLE + "bench view predictions.h5 --truth rooms.h5")
@click.argument("submission", type=InputPath(), metavar="PREDICTIONS")
@TRUTH
@click.option(
    "--scores", "scores_path", type=InputPath(),
    help="Score file of the submission, from `bench score --json` [default: it is scored].",
)  # fmt: skip
@click.option(
    "--items", type=Items(),
    help="Rows of the truth to show [default: the scenes with the worst scores, 100 rows].",
)  # fmt: skip
@RECORDING
@OVERWRITE
def view(
    submission: str,
    truth: str | None,
    scores_path: str | None,
    items: list[int] | None,
    out: str | None,
    overwrite: bool,
) -> None:
    """Write a recording of predictions of rooms beside the truth, for the 3D viewer Rerun.

    The scenes with the worst scores come first; each timeline is another score. Predicted points
    have the colour of the error of their depth.
    """
    needs("bench view", ("rerun",), "view")
    from metrics.measured.reader import Images
    from metrics.scoring.evaluate import open_runs, score_runs
    from metrics.scoring.runs import Settings
    from metrics.viewing import predicted_scenes, require_rooms, scores_of

    with open_runs([submission], truth) as runs:
        predictions, true = require_rooms(runs.files[0]), cast("Images", runs.truth)
        if scores_path:
            scores = scores_of(scores_path, predictions, true)
        else:
            settings = Settings(allow_partial=True, non_finite="penalise")
            with progress_bar(len(predictions), "image") as bar:
                scores = score_runs(runs, settings, bar.update)
        scenes = predicted_scenes(predictions, true, scores, items)
        record(submission, f"{predictions.method}: {submission}", scenes, out, overwrite)


@click.command("describe-format", epilog=EXAMPLE + "bench describe-format")
def describe_format() -> None:
    """Print the format of submissions, and how to write one."""
    from metrics.submissions.layout import describe_format as text

    click.echo(text())


COMMANDS = (score, validate, view, describe_format)

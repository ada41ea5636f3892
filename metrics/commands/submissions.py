"""The `bench` commands on submissions: check, score and show them, and print their format."""

from pathlib import Path
from typing import Any, cast

import click

from metrics.commands.options import FITS, MARKDOWN, SEED
from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import MOST_PROCESSES, OVERWRITE, SCHEDULER, Items, Renamed
from scenegen.command_line.output import line_width, on_scheduler, print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputPath, refuse_inputs
from scenegen.commands.viewing import RECORDING, record

TRUTH = click.option(
    "--truth",
    type=InputPath(),
    help="Ground truth: a file of rooms, or the answer key of questions [default: the path stored"
    " in PREDICTIONS; scores are then ranked only on named benchmarks].",
)


@click.command(
    epilog=EXAMPLE + "bench score predictions.h5 --truth rooms.h5 --json mine.json --html me.html"
)
@click.argument("submissions", nargs=-1, required=True, type=InputPath(), metavar="PREDICTIONS...")
@TRUTH
@click.option(
    "--json",
    "json_path",
    type=OutputPath(),
    help="Write a score file, with the scores of every image or question.",
)
@click.option(
    "--csv",
    "csv_path",
    type=OutputPath(),
    help="Write a CSV table with the scores of every image or question.",
)
@click.option(
    "--html",
    "html_path",
    type=OutputPath(),
    help="Write an HTML report with all metrics, charts and example images.",
)
@click.option(
    "--compare-with",
    "beside",
    cls=Renamed,
    former="--beside",
    multiple=True,
    type=InputPath(),
    metavar="SCORES.json",
    help="Score file of another method on the same ground truth. Its scores are added to the report"
    " of --html. Repeatable.",
)
@click.option(
    "--all",
    "whole",
    is_flag=True,
    help="Print all metrics, not only the main metrics. Also print scores by group, such as by"
    " view.",
)
@MARKDOWN
@SEED
@click.option(
    "--resamples", type=click.IntRange(100, 100_000), default=2000, show_default=True,
    help="Number of bootstrap resamples.",
)  # fmt: skip
@click.option(
    "--baselines",
    "floors",
    cls=Renamed,
    former="--floors",
    type=InputPath(),
    metavar="FLOORS.json",
    help="Accuracies of 2D-only baselines on questions, in a file that `iqtt floors` wrote"
    " [default: the file in this package].",
)
@click.option(
    "--allow-partial",
    is_flag=True,
    help="Score PREDICTIONS even if images or questions are missing. Such scores are not ranked.",
)
@click.option(
    "--non-finite",
    type=click.Choice(["error", "penalise"]),
    default="error",
    show_default=True,
    help="What to do with predicted values that are not finite. error: refuse the file; penalise:"
    " give the image the worst possible scores. Penalised scores are not ranked.",
)
@click.option(
    "--processes",
    type=click.IntRange(1, MOST_PROCESSES),
    help="Number of scoring processes [default: one per core].",
)
@click.option(
    "--protocol",
    default="",
    metavar="NAME",
    help="Evaluation protocol for sensor ground truth. docs/data/protocols.csv lists the names."
    " With the name `all`, the scores under every protocol that applies are printed [default:"
    " declared].",
)
@click.option(
    "--align",
    type=click.Choice(FITS),
    help="Alignment that is fitted to the ground truth of each image before scoring. It must have"
    " at least as many free parameters as the alignment that the submission declares [default:"
    " the declared alignment].",
)
@click.option(
    "--figure",
    "figure_path",
    type=OutputPath(),
    help="Write a figure with the scores under every protocol. Needs --protocol all. Formats:"
    " .pdf, .svg, .png.",
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
    """Score predictions against ground truth, and print the main metrics.

    PREDICTIONS is a submission. For a method with several training runs, pass one submission per
    run.
    """
    from metrics.score_file import write_scores
    from metrics.scoring.evaluate import open_runs, score_runs
    from metrics.scoring.runs import Settings, scorer_versions
    from metrics.submissions.hints.depth import SCALE
    from metrics.submissions.validation import hints
    from metrics.views.report import html_report, read_beside
    from metrics.views.score_tables import text_report, unit_warning, write_csv
    from scenegen.files.new_file import check_writable, write_text

    paths = (json_path, csv_path, html_path, figure_path)
    outputs = [Path(path) for path in paths if path]
    for path in outputs:
        check_writable(path, overwrite)
    if beside and html_path is None:
        raise click.UsageError("--compare-with adds to the page of --html: give --html as well")
    if (protocol == "all") != bool(figure_path) and (figure_path or outputs):
        raise click.UsageError(
            "--protocol all prints a table and writes --figure; other outputs need --protocol NAME"
        )
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
            found = hints(file, runs.truth)
            if unit_warning(scores):  # which the report begins with
                found = [hint for hint in found if not hint.found.startswith(SCALE)]
            for hint in found:
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
    """List all errors in a submission, and hints about likely mistakes.

    If the submission cannot be scored, the exit code is 2.
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
    help="Score file of PREDICTIONS, from `bench score --json` [default: compute the scores].",
)  # fmt: skip
@click.option(
    "--items", type=Items(),
    help="Images to show [default: up to 100 images of the scenes with the worst scores].",
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
    """Write a file for the 3D viewer Rerun that shows predictions next to the ground truth.

    Each timeline of the viewer sorts the scenes by one metric, worst first. The colour of a
    predicted point shows its depth error.
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
    """Print the file format of submissions, with example code that writes a submission."""
    from metrics.submissions.layout import describe_format as text

    click.echo(text())


COMMANDS = (score, validate, view, describe_format)

"""The `bench` commands: parse, one library call, print. Heavy imports happen inside them."""

from pathlib import Path
from typing import Any

import click

from scenegen.common.command_line import OVERWRITE, progress_bar


@click.command()
@click.argument("submissions", nargs=-1, required=True, metavar="PREDICTIONS...")
@click.option("--truth", help="Rooms file, or answers [default: as the submission says].")
@click.option("--json", "json_path", help="Write the scores of all items, and their means.")
@click.option("--csv", "csv_path", help="Write the scores of every item as a table.")
@click.option("--html", "html_path", help="Write a page with distributions and pictures.")
@click.option("--markdown", is_flag=True, help="Print Markdown.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Bootstrap.")
@click.option(
    "--resamples", type=click.IntRange(100, 100_000), default=2000, show_default=True,
    help="Of the bootstrap.",
)  # fmt: skip
@click.option(
    "--allow-partial", is_flag=True, help="Score the rows that are there; not comparable."
)
@click.option(
    "--non-finite",
    type=click.Choice(["error", "penalise"]),
    default="error",
    show_default=True,
    help="Values that are not finite: refuse, or score at the worst; not comparable.",
)
@click.option("--processes", type=click.IntRange(1), help="[default: one a core]")
@OVERWRITE
def score(
    submissions: tuple[str, ...],
    truth: str | None,
    json_path: str | None,
    csv_path: str | None,
    html_path: str | None,
    markdown: bool,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Score a submission, or several runs of one method, and print a table."""
    from metrics.report import text as report
    from metrics.scoring.runs import Settings
    from metrics.scoring.scoring import count_rows
    from metrics.scoring.scoring import score as score_files
    from scenegen.common.errors import SpecError
    from scenegen.common.new_file import check_writable, written_beside

    outputs = [Path(path) for path in (json_path, csv_path, html_path) if path]
    for path in outputs:
        check_writable(path, overwrite)
    if len({path.resolve() for path in outputs}) < len(outputs):
        raise SpecError(f"outputs: found {', '.join(map(str, outputs))}, expected different files")
    with progress_bar(count_rows(submissions[0]), "image") as bar:
        found = score_files(submissions, truth, Settings(**settings), bar.update)
    click.echo(report.markdown_report(found) if markdown else report.table(found))
    if json_path:
        from metrics.score_file import write_scores

        write_scores(found, json_path, overwrite)
    if csv_path:
        report.write_csv(found, csv_path, overwrite)
    if html_path:
        from metrics.report.page import html_report

        page = html_report(found, Path(found.meta.truth_path), [Path(p) for p in submissions])
        with written_beside(html_path, overwrite) as temporary:
            temporary.write_text(page, encoding="utf-8")


@click.command()
@click.argument("submission", metavar="PREDICTIONS")
@click.option("--truth", help="Rooms file, or answers [default: as the submission says].")
@click.pass_context
def validate(ctx: click.Context, submission: str, truth: str | None) -> None:
    """Say everything that is wrong with a submission, and what it looks like; exits with 2 if it
    cannot be scored.
    """
    from metrics.submissions.validation import validate as problems_of

    problems = problems_of(submission, truth)
    for problem in problems:
        click.echo(f"{'hint' if problem.is_hint else 'wrong':5}  {problem}")
    wrong = sum(not problem.is_hint for problem in problems)
    told = f"{wrong} problems" if wrong > 1 else "1 problem"
    click.echo(f"{submission}: {told if wrong else 'valid'}")
    ctx.exit(2 if wrong else 0)


@click.command()
@click.argument("scores", nargs=-1, required=True, metavar="REFERENCE.json OTHER.json...")
@click.option("--metric", "metrics", multiple=True, help="Scores to compare [default: headline].")
@click.option("--json", "json_path", help="Write the comparison.")
@click.option("--markdown", is_flag=True, help="Print Markdown.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Bootstrap.")
@click.option("--allow-incomparable", is_flag=True, help="Compare the rows that all hold.")
@OVERWRITE
def compare(
    scores: tuple[str, ...],
    metrics: tuple[str, ...],
    json_path: str | None,
    markdown: bool,
    seed: int,
    allow_incomparable: bool,
    overwrite: bool,
) -> None:
    """Compare methods with the first, item by item: differences, tests, and what could show."""
    from metrics.comparison import report as compare_report
    from metrics.comparison.compare import compare as compare_files
    from metrics.score_file import read_scores
    from scenegen.common.new_file import check_writable, written_beside

    if json_path:
        check_writable(Path(json_path), overwrite)
    found = compare_files(
        [read_scores(path) for path in scores],
        metrics or None,
        seed=seed,
        allow_incomparable=allow_incomparable,
    )
    click.echo(compare_report.markdown_report(found) if markdown else compare_report.table(found))
    if json_path:
        with written_beside(json_path, overwrite) as temporary:
            temporary.write_text(compare_report.to_json(found), encoding="utf-8")


@click.command()
@click.argument("scores", nargs=-1, metavar="[SCORES.json]...")
@click.option("--metric", "metrics", multiple=True, help="Columns, the first to rank by.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["markdown", "html", "latex"]),
    default="markdown",
    show_default=True,
    help="Of what is printed or written.",
)
@click.option("--out", help="Write to this file instead of printing.")
@click.option("--paper/--no-paper", default=True, help="The paper's own figures [default: yes].")
@OVERWRITE
def leaderboard(
    scores: tuple[str, ...],
    metrics: tuple[str, ...],
    form: str,
    out: str | None,
    paper: bool,
    overwrite: bool,
) -> None:
    """Put score files into tables, beside what the paper reported on its own data."""
    from metrics.leaderboard import text as leaderboard_text
    from metrics.leaderboard.leaderboard import leaderboard as rank
    from metrics.score_file import read_scores
    from scenegen.common.new_file import written_beside

    board = rank([read_scores(path) for path in scores], metrics or None, paper=paper)
    text: str = getattr(leaderboard_text, f"to_{form}")(board)
    if out is None:
        click.echo(text)
        return
    with written_beside(out, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
    click.echo(f"{out}: {len(scores)} score files")


@click.command("describe-format")
def describe_format() -> None:
    """Print the format of submissions, and how to write one."""
    from metrics.submissions.layout import describe_format as text

    click.echo(text())


COMMANDS = (score, validate, compare, leaderboard, describe_format)

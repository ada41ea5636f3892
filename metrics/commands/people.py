"""Commands on people's answers: the quiz that collects them, and the report on them.

`cli` puts them into the group `iqtt`; they stand here because both show scores beside the answers.
"""

from functools import partial
from pathlib import Path
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import LARGEST, OVERWRITE
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, NewHdf5, OutputPath, refuse_inputs
from scenegen.commands.viewing import host_options

option = partial(click.option, show_default=True)


# fmt: off
@click.command(epilog=f"{EXAMPLE}iqtt quiz iqtt-split/iqtt-test.h5 --db answers.db")
@click.argument("file", type=InputPath(), required=False, metavar="[SPLIT.h5]")
@option("--db", type=InputPath(), default="answers.db",
        help="SQLite file that keeps the answers; it is made, or taken up again.")
@host_options(8000)
@option("--questions", type=int, default=20, help="Questions that count, of each participant.")
@option("--calibration", "calibrations", type=int, default=2,
        help="Questions before them whose right answers are told. The paper had 1.")
@option("--participants", type=click.IntRange(1, 1_000_000), default=10_000,
        help="Most participants.")
@option("--seed", type=click.IntRange(0, LARGEST), default=0, help="Seed of the draws.")
@click.option("--part", type=click.Choice(["labeled"]), help="Part of a training file.")
@option("--contact", default="", help="Who runs the study; the first page shows it.")
@click.option("--export", "csv_path", type=OutputPath(),
              help="Write all answers to this CSV file instead.")
@click.option("--submission", type=NewHdf5(),
              help="Write people's answers to SPLIT as a file for `bench score` instead.")
@option("--whose", type=click.Choice(["one", "majority"]), default="one",
        help="Of --submission: of each question the answer of one participant, drawn with --seed,"
        " or what most answered.")
@OVERWRITE
def quiz(
    file: str | None, db: str, csv_path: str | None, submission: str | None, **settings: Any
) -> None:
    """Ask people the questions of SPLIT on web pages that this machine serves.

    Each participant answers a few questions for practice, and then 20 that are drawn for them, as
    in the paper. Every answer is on the disk before the next question shows. The answers to SPLIT
    are in SPLIT, or in a file such as iqtt-test-answers.h5 beside it. Ctrl-C ends the quiz; the
    same command goes on with it. With --export or --submission nothing is served.
    """
    refuse_inputs([db], [file] if file else [])
    if csv_path is None and submission is None:
        if file is None:
            raise click.UsageError("Missing argument 'SPLIT.h5'.")
        _serve(file, db, **settings)
    if csv_path is not None:
        _export(db, file, csv_path, settings["overwrite"])
    if submission is not None:
        if file is None:
            raise click.UsageError("--submission needs the argument 'SPLIT.h5'.")
        _submit(db, file, submission, settings)


def _serve(
    file: str, db: str, host: str | None, port: int, public: bool, names: tuple[str, ...],
    questions: int, calibrations: int, participants: int, seed: int, part: str | None,
    contact: str, **_: Any,
) -> None:
    needs("iqtt quiz", ("itsdangerous", "starlette", "uvicorn"), "quiz")
    from iqtt.floors import floors_of
    from iqtt.quiz.app import Quiz, make_app
    from iqtt.quiz.commits import Commits
    from iqtt.quiz.schema import open_answers, secret_of
    from iqtt.quiz.serve import serve
    from iqtt.quiz.study import Study
    from metrics.views.people.references import compare
    from scenegen.common.web_hosts import address_of, hosts_of, listen

    hosts = hosts_of(host, public, names)
    with (
        Study(file, part, questions, calibrations, seed) as study,
        listen(hosts, port) as listening,
    ):
        connection = open_answers(db, study.settings)
        key = secret_of(connection)
        with Commits(connection) as commits:
            floors = floors_of(study.pool.file.spec)
            shown = partial(compare, study.settings.answers, floors)
            tell = partial(print_line, err=True)
            made = Quiz(study, commits, key, shown, tell, contact, participants)
            address = address_of(hosts, listening.getsockname()[1])
            ready = f"{address} asks {file}; answers go to {db}; Ctrl-C ends it"
            serve(make_app(made, hosts), listening, lambda: print_line(ready))
    print_line(f"{db}: {_tally(db)}")


def _tally(db: str) -> str:
    from iqtt.quiz.answers import read_answers

    stored = read_answers(db)
    finished = len({answer.participant for answer in stored.answers if answer.finished})
    count = len(stored.answers)
    return f"{stored.participants} participants, {finished} finished, {count} answers"


def _export(db: str, file: str | None, path: str, overwrite: bool) -> None:
    from iqtt.quiz.answers import read_answers, to_csv
    from scenegen.files.new_file import write_text

    refuse_inputs([path], [db])
    stored = read_answers(db)
    if file is not None:
        _require_split(stored, file)
    write_text(path, to_csv(stored), overwrite)
    print_line(f"{path}: {len(stored.answers)} answers of {stored.participants} participants")


def _submit(db: str, file: str, path: str, settings: dict[str, Any]) -> None:
    from iqtt.quiz.answers import read_answers
    from metrics.views.people.submission import write_submission

    stored = read_answers(db)
    total = _require_split(stored, file)
    overwrite = settings["overwrite"]
    count = write_submission(stored, file, path, settings["whose"], settings["seed"], overwrite)
    left = "" if count == total else "; score it with bench score --allow-partial"
    print_line(f"{path}: answers to {count} of {total} questions{left}")


def _require_split(stored: Any, file: str) -> int:
    """Return how many questions a file has. Raises SpecError where `stored` belongs to another."""
    from iqtt.quiz.study import Pool
    from scenegen.common.errors import SpecError

    pool = Pool(file)
    pool.file.close()
    fingerprint = stored.settings.fingerprint
    if pool.fingerprint != fingerprint:
        found = f"answers to the split of fingerprint {fingerprint:.12}"
        raise SpecError(stored.path, found, f"{pool.fingerprint:.12}, that of {file}")
    return len(pool.right)


@click.command("quiz-report", epilog=f"{EXAMPLE}iqtt quiz-report answers.db --html people.html")
@click.argument("answers", type=InputPath(), metavar="ANSWERS.db")
@click.option("--model", type=InputPath(), metavar="PREDICTIONS",
              help="A submission of a model to the same split, to be compared with people.")
@click.option("--questions", type=InputPath(), metavar="SPLIT.h5",
              help="The questions that were asked: their floors are shown.")
@click.option("--json", "json_path", type=OutputPath(), help="Write all figures here.")
@click.option("--html", "html_path", type=OutputPath(), help="Write a page with charts.")
@OVERWRITE
def quiz_report(
    answers: str,
    model: str | None,
    questions: str | None,
    json_path: str | None,
    html_path: str | None,
    overwrite: bool,
) -> None:
    """Print what people answered in `iqtt quiz`: accuracy, times, tests as in the paper.

    Participants are the sample. Only those who finished count.
    """
    from iqtt.quiz.answers import read_answers
    from metrics.views.people.figures import compute
    from metrics.views.people.report import text_report, to_json
    from scenegen.files.new_file import check_writable, write_text

    for path in filter(None, (json_path, html_path)):
        check_writable(Path(path), overwrite)
    stored, floors = read_answers(answers), {}
    if questions is not None:
        from iqtt.files.reader import open_tables
        from iqtt.floors import floors_of

        _require_split(stored, questions)
        with open_tables(questions)[0] as table:
            floors = floors_of(table.spec)
    figures = compute(stored, model, floors)
    if json_path:
        write_text(json_path, to_json(figures), overwrite)
    if html_path:
        from metrics.views.people.report import html_report

        write_text(html_path, html_report(figures), overwrite)
    click.echo(text_report(figures))


# fmt: on
COMMANDS = (quiz, quiz_report)

"""The command that asks people the questions of a split, and exports what they answered."""

from functools import partial
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import LARGEST, OVERWRITE
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, OutputPath, refuse_inputs
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
@OVERWRITE
def quiz(
    file: str | None, db: str, csv_path: str | None, overwrite: bool, **settings: Any
) -> None:
    """Ask people the questions of SPLIT on web pages that this machine serves.

    Each participant answers a few questions for practice, and then 20 that are drawn for them, as
    in the paper. Every answer is on the disk before the next question shows. The answers to SPLIT
    are in SPLIT, or in a file such as iqtt-test-answers.h5 beside it. Ctrl-C ends the quiz; the
    same command goes on with it. With --export nothing is served.
    """
    refuse_inputs([db], [file] if file else [])
    if csv_path is not None:
        _export(db, file, csv_path, overwrite)
    elif file is None:
        raise click.UsageError("Missing argument 'SPLIT.h5'.")
    else:
        _serve(file, db, **settings)


def _serve(
    file: str, db: str, host: str | None, port: int, public: bool, names: tuple[str, ...],
    questions: int, calibrations: int, participants: int, seed: int, part: str | None,
    contact: str,
) -> None:
    needs("iqtt quiz", ("itsdangerous", "starlette", "uvicorn"), "quiz")
    from iqtt.quiz.app import Quiz, make_app
    from iqtt.quiz.commits import Commits
    from iqtt.quiz.schema import open_answers, secret_of
    from iqtt.quiz.serve import serve
    from iqtt.quiz.study import Study
    from scenegen.common.web_hosts import address_of, hosts_of, listen

    hosts = hosts_of(host, public, names)
    with (
        Study(file, part, questions, calibrations, seed) as study,
        listen(hosts, port) as listening,
    ):
        connection = open_answers(db, study.settings)
        key = secret_of(connection)
        with Commits(connection) as commits:
            tell = partial(print_line, err=True)
            made = Quiz(study, commits, key, tell, contact, participants)
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
    from iqtt.quiz.study import Pool
    from scenegen.files.new_file import write_text

    refuse_inputs([path], [db])
    stored = read_answers(db)
    if file is not None:
        with Pool(file) as pool:
            pool.require_asked(stored.path, stored.settings)
    write_text(path, to_csv(stored), overwrite)
    print_line(f"{path}: {len(stored.answers)} answers of {stored.participants} participants")


# fmt: on
COMMANDS = (quiz,)

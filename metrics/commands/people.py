"""The report on people's answers in `iqtt quiz`; `cli` puts it into the group `iqtt`."""

from pathlib import Path

import click

from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import OVERWRITE
from scenegen.command_line.paths import InputPath, OutputPath


# fmt: off
@click.command("quiz-report", epilog=f"{EXAMPLE}iqtt quiz-report answers.db --json people.json")
@click.argument("answers", type=InputPath(), metavar="ANSWERS.db")
@click.option("--questions", type=InputPath(), metavar="SPLIT.h5",
              help="The questions that were asked: their floors are shown.")
@click.option("--json", "json_path", type=OutputPath(), help="Write all figures here.")
@OVERWRITE
def quiz_report(
    answers: str, questions: str | None, json_path: str | None, overwrite: bool
) -> None:
    """Print what people answered in `iqtt quiz`: accuracy by kind, beside the paper's people.

    Participants are the sample. Only those who finished count.
    """
    from iqtt.floors import floors_of
    from iqtt.quiz.answers import read_answers
    from iqtt.quiz.study import Pool
    from metrics.views.people import compute, text_report, to_json
    from scenegen.files.new_file import check_writable, write_text

    if json_path:
        check_writable(Path(json_path), overwrite)
    stored, floors = read_answers(answers), {}
    if questions is not None:
        with Pool(questions) as pool:
            pool.require_asked(stored.path, stored.settings)
            floors = floors_of(pool.file.spec)
    figures = compute(stored, floors)
    if json_path:
        write_text(json_path, to_json(figures), overwrite)
    click.echo(text_report(figures))


# fmt: on
COMMANDS = (quiz_report,)

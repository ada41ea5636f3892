"""The command that writes the page on which people answer the questions of a file."""

from functools import partial
from pathlib import Path

import click

from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import LARGEST, OVERWRITE
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, OutputPath

option = partial(click.option, show_default=True)


# fmt: off
@click.command(epilog=f"{EXAMPLE}iqtt quiz iqtt-split/iqtt-test.h5 --out quiz.html")
@click.argument("file", type=InputPath(), metavar="QUESTIONS.h5")
@option("--out", type=OutputPath(), default="quiz.html", help="Page to write.")
@option("--questions", type=int, default=20, help="Questions that count, the same for everyone.")
@option("--practice", type=int, default=2,
        help="Questions before them whose right answers are told. The paper had 1.")
@option("--seed", type=click.IntRange(0, LARGEST), default=0, help="Seed of the draw.")
@click.option("--contact", default="", help="Who runs the study; the first page shows it.")
@click.option("--post", default="", metavar="URL",
              help="Send each participant's answers there [default: they save a file].")
@OVERWRITE
def quiz(
    file: str, out: str, questions: int, practice: int, seed: int, contact: str, post: str,
    overwrite: bool,
) -> None:
    """Write one page that asks people questions of QUESTIONS.h5, without a server.

    Open it, or put it on any web host. Each participant answers a few questions for practice, and
    then those that count, in a random order. The browser keeps the answers, and saves them as a
    JSON file at the end, for `bench import --quiz`. The right answers are not in the page, but for
    practice.
    """
    from iqtt.quiz.page import Study, write_quiz

    write_quiz(file, out, Study(questions, practice, seed, contact, post), overwrite)
    size = Path(out).stat().st_size
    print_line(f"{out}: {questions} questions and {practice} for practice, {size / 1e6:.1f} MB")


# fmt: on
COMMANDS = (quiz,)

"""The command that writes a page on which people answer the questions of a file."""

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
@option("--out", type=OutputPath(), default="quiz.html", help="Output file.")
@option("--questions", type=int, default=20, help="Number of scored questions. All participants"
                                                  " get the same questions.")
@option("--practice", type=int, default=2,
        help="Number of practice questions. They come first and give feedback. The paper used 1.")
@option("--seed", type=click.IntRange(0, LARGEST), default=0, help="Seed with which the"
                                                                   " questions are selected.")
@click.option("--contact", default="", help="Contact person or address of the study. The first page"
                                            " shows it.")
@click.option("--post", default="", metavar="URL",
              help="Send the responses of each participant to this URL [default: participants"
                   " save a file].")
@OVERWRITE
def quiz(
    file: str, out: str, questions: int, practice: int, seed: int, contact: str, post: str,
    overwrite: bool,
) -> None:
    """Write an HTML page on which people answer questions of QUESTIONS.h5.

    The page works without a server: open the file, or upload it to any web host. Each participant
    answers a few practice questions, then the scored questions in random order. At the end, the
    browser saves the responses as a JSON file for `bench import --quiz`. The page contains
    the correct options of the practice questions, but not of the scored questions.
    """
    from iqtt.quiz.page import Study, write_quiz

    write_quiz(file, out, Study(questions, practice, seed, contact, post), overwrite)
    size = Path(out).stat().st_size
    print_line(f"{out}: {questions} questions and {practice} for practice, {size / 1e6:.1f} MB")


# fmt: on
COMMANDS = (quiz,)

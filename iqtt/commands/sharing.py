"""The commands that hand on questions: a data card of a split, and files for data loaders."""

from pathlib import Path
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import ENCODING, OVERWRITE
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputFolder, refuse_command_inputs
from scenegen.commands.sharing import SHARE, publication_of, publication_options


# fmt: off
@click.command(
    epilog=f"{EXAMPLE}iqtt card iqtt-split --creator 'A. Person' --date 2026-01-31 --out card"
)
@click.argument("folder", type=InputPath(within=(".h5",)))
@click.option("--out", type=OutputFolder(), help="Folder to make [iqtt-split-card of iqtt-split].")
@click.option("--with-answers", is_flag=True,
              help="Hand out the answers of the test questions too, and the seed if their file"
              " tells it.")
@publication_options(title="that of the folder", license_="CC-BY-4.0")
@OVERWRITE
def card(
    folder: str,
    out: str | None,
    with_answers: bool,
    overwrite: bool,
    **options: Any,
) -> None:
    """Write a data card of the split in FOLDER: a page, Croissant metadata and an index.

    README.md is for people, croissant.json for programs, index.parquet has a line for each
    question. Hand them on with the files that the card lists: those of the test answers are not
    among them, and nothing in the card tells an answer of a test question. All values are read and
    must be those that were written.
    """
    needs("iqtt card", SHARE, "share")
    from iqtt.sharing.published import published_split
    from iqtt.sharing.questions import make_questions_card
    from scenegen.sharing.card import NAMES

    name = Path(folder).resolve().name
    publication = publication_of(options, name, lambda: "CC-BY-4.0")
    out = out or f"{name}-card"
    refuse_command_inputs(Path(out) / file for file in NAMES)
    count = published_split(folder, with_answers).count
    with progress_bar(count, "question") as bar:
        make_questions_card(
            folder, out, publication,
            with_answers=with_answers, overwrite=overwrite, progress=bar.update,
        )
    print_line(f"{out}: {', '.join(NAMES)} of {count} questions")


@click.command(epilog=f"{EXAMPLE}iqtt export iqtt-split/iqtt-val.h5 --format parquet")
@click.argument("file", type=InputPath())
@click.option("--format", "form", type=click.Choice(["parquet", "webdataset"]), required=True,
              help="What to write; datasets.load_dataset reads both.")
@click.option("--part", type=click.Choice(["labeled", "unlabeled"]),
              help="Part of a training file.")
@click.option("--out", type=OutputFolder(),
              help="Folder to make [iqtt-val-parquet of iqtt-val.h5; iqtt-train-labeled-parquet].")
@click.option("--rows-per-file", type=click.IntRange(1), default=1000, show_default=True,
              help="Most questions of a file.")
@ENCODING
@OVERWRITE
def export(
    file: str,
    form: str,
    part: str | None,
    out: str | None,
    rows_per_file: int,
    curve: str,
    overwrite: bool,
) -> None:
    """Write all that FILE tells of its questions in a format of data loaders.

    Images of 8 bits become PNG files, sRGB unless --encoding linear. The answers to test questions
    are in another file, and are not written.
    """
    if form == "parquet":
        needs("iqtt export --format parquet", SHARE, "share")
    from iqtt.files.reader import open_questions
    from iqtt.sharing.questions import export_questions

    with open_questions(file, part) as questions:
        count = len(questions)
    folder = out or "-".join(filter(None, (Path(file).stem, part, form)))
    with progress_bar(count, "question") as bar:
        written = export_questions(
            file, form, folder, part,
            encoding=curve, rows_per_file=rows_per_file, overwrite=overwrite, progress=bar.update,
        )
    megabytes = sum(path.stat().st_size for path in written) / 1e6
    print_line(f"{folder}: {count} questions in {len(written) - 1} files, {megabytes:.1f} MB")


# fmt: on
COMMANDS = (card, export)

"""The commands that publish questions: a data card of a split, and files for data loaders."""

from pathlib import Path
from typing import Any

import click

from iqtt.commands.models import model_options
from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import ENCODING, OVERWRITE, Renamed
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputFolder
from scenegen.commands.sharing import SHARE, publication_options
from scenegen.rooms.export.formats import DATA_FORMATS


@click.command(epilog=f"{EXAMPLE}iqtt card iqtt-split --creator 'A. Person'")
@click.argument("folder", type=InputPath(within=(".h5",)))
@click.option(
    "--with-answer-key",
    "with_answers",
    cls=Renamed,
    former="--with-answers",
    is_flag=True,
    help="Also list the answer key of the test questions. If a file has the seed, list the seed"
    " too.",
)
@publication_options(title="the name of the folder", license_="CC-BY-4.0")
@OVERWRITE
def card(
    folder: str,
    with_answers: bool,
    creators: tuple[str, ...],
    title: str | None,
    licence: str | None,
    out: str,
    overwrite: bool,
) -> None:
    """Write a data card for the split in FOLDER, with the metadata header of Hugging Face.

    The card lists the files that you can publish. The answer key of the test questions is not
    listed. If a listed file reveals the correct option of a test question, the command stops with
    an error.
    """
    needs("iqtt card", SHARE, "share")
    from iqtt.sharing.published import open_split
    from iqtt.sharing.questions import write_questions_card
    from scenegen.sharing.card import Publication

    named = title or Path(folder).resolve().name
    with open_split(folder, with_answers) as tables:
        publication = Publication(named, creators, licence or "CC-BY-4.0")
        write_questions_card(out, tables, publication, overwrite)
    print_line(f"{out}: {sum(map(len, tables))} questions")


# fmt: off
@click.command(
    epilog=f"{EXAMPLE}iqtt export iqtt-split/iqtt-val.h5 --format parquet\n"
    "  iqtt export iqtt-split/iqtt-val.h5 --format vlm --rotations 3 --out val-vlm"
)
@click.argument("file", type=InputPath())
@click.option("--format", "form", type=click.Choice([*DATA_FORMATS, "vlm"]),
              required=True,
              help="Output format. parquet, webdataset: files for data loaders; vlm: prompts for"
              " vision-language models, in files for Inspect, VLMEvalKit and lmms-eval.")
@click.option("--part", type=click.Choice(["labeled", "unlabeled"]),
              help="Part of a training file to export.")
@click.option("--out", type=OutputFolder(),
              help="Output folder [named after FILE and the format, such as iqtt-val-parquet].")
@click.option("--rows-per-file", type=click.IntRange(1), default=1000, show_default=True,
              help="For parquet and webdataset: maximum number of questions per file.")
@ENCODING
@model_options
@OVERWRITE
def export(
    file: str,
    form: str,
    part: str | None,
    out: str | None,
    rows_per_file: int,
    curve: str,
    overwrite: bool,
    **how: Any,
) -> None:
    """Export the questions of FILE for data loaders or for vision-language models.

    8-bit images become PNG files in sRGB. With --encoding linear, the PNG files have linear
    radiance. The answer key of test questions is exported only with --with-answer-key.
    """
    if form != "webdataset":
        needs(f"iqtt export --format {form}", SHARE, "share")
    folder = out or "-".join(filter(None, (Path(file).stem, part, form)))
    if form == "vlm":
        _export_for_models(file, part, folder, overwrite, how)
        return
    from iqtt.files.reader import open_questions
    from iqtt.sharing.questions import QUESTIONS
    from scenegen.sharing.export import write_export

    with open_questions(file, part) as questions, progress_bar(len(questions), "question") as bar:
        count = len(questions)
        written = write_export(
            questions, QUESTIONS, form, folder,
            encoding=curve, rows_per_file=rows_per_file, overwrite=overwrite, progress=bar.update,
        )
    megabytes = sum(path.stat().st_size for path in written) / 1e6
    print_line(f"{folder}: {count} questions in {len(written) - 1} files, {megabytes:.1f} MB")


def _export_for_models(
    file: str, part: str | None, folder: str, overwrite: bool, how: dict[str, Any]
) -> None:
    from iqtt.vlm.export import export_for_models
    from iqtt.vlm.rows import Asked, count_rows

    asked = Asked(file, part, **how)
    count = count_rows(asked)
    with progress_bar(count, "question") as bar:
        written = export_for_models(asked, folder, overwrite=overwrite, progress=bar.update)
    megabytes = sum(path.stat().st_size for path in written) / 1e6
    names = ", ".join(path.name for path in written)
    print_line(f"{folder}: {count} prompts, {megabytes:.1f} MB: {names}")


# fmt: on
COMMANDS = (card, export)

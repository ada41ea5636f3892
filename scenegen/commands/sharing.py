"""The command that writes a data card. `scenegen export` is with the commands on rooms."""

import datetime
import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import OVERWRITE, Command, together
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputFolder, refuse_command_inputs
from scenegen.common.errors import SpecError

if TYPE_CHECKING:
    from scenegen.sharing.publication import Publication

SHARE = ("datasets", "mlcroissant", "pyarrow")  # libraries that a card needs


def publication_options(title: str, license_: str) -> Callable[[Command], Command]:
    """Return options for what only the publisher knows; the texts name two of their defaults."""
    return together(
        click.option("--creator", "creators", multiple=True, required=True,
                     help="Who made the data; may be said several times."),
        click.option("--title", help=f"Name of the data [{title}]."),
        click.option("--date",
                     help="Day of publication, as 2026-01-31 [that of SOURCE_DATE_EPOCH]."),
        click.option("--license",
                     help=f"SPDX identifier of the data's licence, or its address [{license_}]."),
        click.option("--data-version", "version", default="1.0.0", show_default=True,
                     help="Version of the data."),
        click.option("--url", default="", help="Page where the data will be."),
    )  # fmt: skip


def publication_of(
    options: dict[str, Any], title: str, licence: Callable[[], str]
) -> "Publication":
    """Return what the publication options say, with these defaults. Raises SpecError."""
    from scenegen.sharing.publication import Publication

    defaults = {"title": lambda: title, "date": source_date, "license": licence}
    for name, default in defaults.items():
        if options[name] is None:
            options = {**options, name: default()}
    return Publication(**options)


def source_date() -> str:
    """Return the day that SOURCE_DATE_EPOCH tells, in UTC. Raises SpecError where it tells none."""
    seconds = os.environ.get("SOURCE_DATE_EPOCH", "")
    try:
        return datetime.datetime.fromtimestamp(int(seconds), datetime.UTC).date().isoformat()
    except (ValueError, OverflowError, OSError) as error:
        found = f"none, and SOURCE_DATE_EPOCH {seconds!r:.40}" if seconds else "none"
        raise SpecError("date", found, "the day of publication, as 2026-01-31") from error


@click.command(epilog=f"{EXAMPLE}scenegen card train.h5 test.h5 --creator 'A. Person' --out card")
@click.argument("files", type=InputPath(), nargs=-1, required=True)
@click.option("--out", type=OutputFolder(), required=True, help="Folder to make.")
@publication_options(
    title="that of the first file", license_="CC-BY-4.0; none where rooms show meshes from a folder"
)
@OVERWRITE
def card(files: tuple[str, ...], out: str, overwrite: bool, **options: Any) -> None:
    """Write a data card of files of rooms: a page, Croissant metadata and an index.

    README.md is for people, croissant.json for programs, index.parquet has a line for each row.
    Hand them on in one folder with the files. All values are read and must be those that were
    written.
    """
    needs("scenegen card", SHARE, "share")
    from scenegen.rooms.reader import RoomsFile
    from scenegen.sharing.card import NAMES
    from scenegen.sharing.rooms import default_license, make_rooms_card

    title = Path(files[0]).stem
    with ExitStack() as stack:
        rooms = [stack.enter_context(RoomsFile(file)) for file in files]
        publication = publication_of(options, title, lambda: default_license(rooms))
        refuse_command_inputs(Path(out) / name for name in NAMES)
        count = sum(map(len, rooms))
        with progress_bar(count, "image") as bar:
            make_rooms_card(rooms, out, publication, overwrite=overwrite, progress=bar.update)
    print_line(f"{out}: {', '.join(NAMES)} of {count} images")


COMMANDS = (card,)

"""The command that writes a data card. `scenegen export` is with the commands on rooms."""

import datetime
import os
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import OVERWRITE
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputFolder, refuse_command_inputs
from scenegen.common.errors import SpecError

Command = Callable[..., Any]


def publication_options(title: str, license_: str) -> Callable[[Command], Command]:
    """Return options for what only the publisher knows; the texts name two of their defaults."""
    options = (
        click.option("--creator", "creators", multiple=True, required=True,
                     help="Who made the data; may be said several times."),
        click.option("--title", help=f"Name of the data [{title}]."),
        click.option("--date",
                     help="Day of publication, as 2026-01-31 [that of SOURCE_DATE_EPOCH]."),
        click.option("--license", "license_",
                     help=f"SPDX identifier of the data's licence, or its address [{license_}]."),
        click.option("--data-version", default="1.0.0", show_default=True,
                     help="Version of the data."),
        click.option("--url", default="", help="Page where the data will be."),
    )  # fmt: skip
    return lambda command: reduce(lambda made, option: option(made), reversed(options), command)


# fmt: off
@click.command(
    epilog=f"{EXAMPLE}scenegen card train.h5 test.h5 --creator 'A. Person' --out card"
)
@click.argument("files", type=InputPath(), nargs=-1, required=True)
@click.option("--out", type=OutputFolder(), required=True, help="Folder to make.")
@publication_options(
    title="that of the first file",
    license_="CC-BY-4.0; none where rooms show meshes from a folder",
)
@OVERWRITE
def card(
    files: tuple[str, ...],
    out: str,
    creators: tuple[str, ...],
    title: str | None,
    date: str | None,
    license_: str | None,
    data_version: str,
    url: str,
    overwrite: bool,
) -> None:
    """Write a data card of files of rooms: a page, Croissant metadata and an index.

    README.md is for people, croissant.json for programs, index.parquet has a line for each row.
    Hand them on in one folder with the files. All values are read and must be those that were
    written.
    """
    needs("scenegen card", ("pyarrow",), "share")
    from scenegen.rooms.reader import RoomsFile
    from scenegen.sharing.description import Publication
    from scenegen.sharing.make import NAMES, make_rooms_card
    from scenegen.sharing.rooms import default_license

    publication = Publication(
        title=Path(files[0]).stem if title is None else title,
        creators=creators,
        date=source_date() if date is None else date,
        license=default_license(files) if license_ is None else license_,
        version=data_version,
        url=url,
    )
    refuse_command_inputs(Path(out) / name for name in NAMES)
    count = 0
    for file in files:
        with RoomsFile(file) as rooms:
            count += len(rooms)
    with progress_bar(count, "image") as bar:
        make_rooms_card(files, out, publication, overwrite=overwrite, progress=bar.update)
    print_line(f"{out}: {', '.join(NAMES)} of {count} images")


# fmt: on
def source_date() -> str:
    """Return the day that SOURCE_DATE_EPOCH tells, in UTC. Raises SpecError where it tells none."""
    told = os.environ.get("SOURCE_DATE_EPOCH", "")
    try:
        return datetime.datetime.fromtimestamp(int(told), datetime.UTC).date().isoformat()
    except (ValueError, OverflowError, OSError) as error:
        found = f"none, and SOURCE_DATE_EPOCH {told!r:.40}" if told else "none"
        raise SpecError("date", found, "the day of publication, as 2026-01-31") from error


COMMANDS = (card,)

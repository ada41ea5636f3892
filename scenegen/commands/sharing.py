"""The command that writes a data card. `scenegen export` is with the commands on rooms."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import OVERWRITE, Command, together
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, OutputPath

SHARE = ("datasets", "huggingface_hub", "pyarrow")  # libraries of the extra `share`


def publication_options(title: str, license_: str) -> Callable[[Command], Command]:
    """Return options for what only the publisher knows; the texts name two of their defaults."""
    return together(
        click.option("--creator", "creators", multiple=True, required=True,
                     help="Who made the data; may be said several times."),
        click.option("--title", help=f"Name of the data [{title}]."),
        click.option("--license", "licence",
                     help=f"SPDX identifier of the data's licence, or its address [{license_}]."),
        click.option("--out", type=OutputPath(), default="README.md", show_default=True,
                     help="Page to write."),
    )  # fmt: skip


@click.command(epilog=f"{EXAMPLE}scenegen card train.h5 test.h5 --creator 'A. Person'")
@click.argument("files", type=InputPath(), nargs=-1, required=True)
@publication_options(
    title="that of the first file", license_="CC-BY-4.0; none where rooms show meshes from a folder"
)
@OVERWRITE
def card(
    files: tuple[str, ...],
    creators: tuple[str, ...],
    title: str | None,
    licence: str | None,
    out: str,
    overwrite: bool,
) -> None:
    """Write a data card of files of rooms: a page with the header that Hugging Face reads.

    Hand it on in one folder with the files, or with Parquet files of `scenegen export`, of which
    Hugging Face makes Croissant metadata.
    """
    needs("scenegen card", SHARE, "share")
    from scenegen.rooms.reader import RoomsFile
    from scenegen.sharing.card import Publication
    from scenegen.sharing.rooms import default_license, write_rooms_card

    with ExitStack() as stack:
        rooms = [stack.enter_context(RoomsFile(file)) for file in files]
        named = title or Path(files[0]).stem
        publication = Publication(named, creators, licence or default_license(rooms))
        write_rooms_card(out, rooms, publication, overwrite)
    print_line(f"{out}: {sum(map(len, rooms))} images")


COMMANDS = (card,)

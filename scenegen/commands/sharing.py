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
                     help="Creator of the data. For several creators, repeat the option."),
        click.option("--title", help=f"Title of the data set [{title}]."),
        click.option("--license", "licence",
                     help=f"Licence of the data, as an SPDX identifier or a URL [{license_}]."),
        click.option("--out", type=OutputPath(), default="README.md", show_default=True,
                     help="Output page."),
    )  # fmt: skip


@click.command(epilog=f"{EXAMPLE}scenegen card train.h5 test.h5 --creator 'A. Person'")
@click.argument("files", type=InputPath(), nargs=-1, required=True)
@publication_options(
    title="the name of the first file", license_="CC-BY-4.0; none if meshes come from a folder"
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
    """Write a data card for rooms files, with the metadata header of Hugging Face.

    Publish the card in the folder of FILES, or in the folder of the Parquet files that `scenegen
    export` wrote. From Parquet files, Hugging Face generates Croissant metadata.
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

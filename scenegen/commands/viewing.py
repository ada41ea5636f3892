"""The command that shows rooms in 3D, and what it shares with `bench view`."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import OVERWRITE, Items
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, OutputPath, refuse_command_inputs

if TYPE_CHECKING:
    from scenegen.viewing import RecordedScene


RECORDING = click.option(
    "--out", type=OutputPath(), metavar="FILE.rrd",
    help="Output file [default: rooms.rrd for rooms.h5].",
)  # fmt: skip


def record(
    source: str, title: str, scenes: "Iterable[RecordedScene]", out: str | None, overwrite: bool
) -> None:
    """Write a recording of scenes, by default in this folder and named after `source`."""
    from scenegen.viewing import write_recording

    path = Path(out or f"{Path(source).stem}.rrd")
    refuse_command_inputs([path])
    count = write_recording(path, title, scenes, overwrite)
    megabytes = path.stat().st_size / 1e6
    print_line(f"{path}: {count} images, {megabytes:.1f} MB; open it with `rerun {path}`")


@click.command(epilog=f"{EXAMPLE}scenegen view rooms.h5")
@click.argument("file", type=InputPath())
@click.option("--items", type=Items(), help="Images to show [default: the first 100].")
@RECORDING
@OVERWRITE
def view(file: str, items: list[int] | None, out: str | None, overwrite: bool) -> None:
    """Write the scenes of FILE to a recording, which the 3D viewer Rerun can open.

    The recording has the points, camera, image, depth, normals and object ids of every view. The
    viewer shows the values under the mouse pointer.
    """
    needs("scenegen view", ("rerun",), "view")
    from scenegen.rooms.reader import RoomsFile
    from scenegen.viewing import room_scenes, scene_rows

    with RoomsFile(file) as rooms:
        record(file, file, room_scenes(rooms, scene_rows(rooms, items)), out, overwrite)


COMMANDS = (view,)

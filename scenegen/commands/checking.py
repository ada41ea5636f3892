"""The command that checks folders of data that others made. Heavy imports happen inside it."""

from pathlib import Path

import click

from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.output import print_checks, print_line
from scenegen.command_line.paths import InputPath


@click.command(epilog=f"{EXAMPLE}scenegen check rooms-nerfstudio")
@click.argument("folder", type=InputPath())
@click.pass_context
def check(ctx: click.Context, folder: str) -> None:
    """Cross-check depth, cameras, normals and images of FOLDER, in the layout of another tool.

    Layouts are nerfstudio, COLMAP (text), BOP, MoGe and Hypersim. Known faults are named with their
    size: distance along the ray for planar depth, wrong focal length, principal point or unit,
    inverse poses, wrong axes, mirrored maps. The exit code is 1 if there is a fault.
    """
    from scenegen.checking.folders import check_folder

    report = check_folder(Path(folder))
    print_line(f"{folder}: {report.layout}, {report.views} views compared")
    ctx.exit(print_checks(folder, report.checks))


COMMANDS = (check,)

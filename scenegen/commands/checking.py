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
    """Check whether the depth, cameras, normals and images of FOLDER agree with each other.

    FOLDER has the layout of nerfstudio, COLMAP (text), BOP, MoGe or Hypersim. The command detects
    these faults, and prints their size: distance along the ray instead of planar depth, wrong focal
    length, wrong principal point, wrong unit, inverse poses, wrong axes, mirrored maps. If there is
    a fault, the exit code is 1.
    """
    from scenegen.checking.folders import check_folder

    report = check_folder(Path(folder))
    print_line(f"{folder}: {report.layout}, {report.views} views compared")
    ctx.exit(print_checks(folder, report.checks))


COMMANDS = (check,)

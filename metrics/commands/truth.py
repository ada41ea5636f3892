"""The `bench` command that makes a file of measured truth."""

import shlex
from pathlib import Path
from typing import Any

import click

from metrics.commands.intake import DEPTH_KINDS, read_as, reading_options
from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import OVERWRITE
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, NewHdf5

LAYOUTS = ("moge", "nyu", "nyu-raw", "kitti", "diode", "hypersim", "sintel")


# fmt: off
@click.command(epilog=f"{EXAMPLE}bench truth --images 'rgb/*.png' --depth 'gt/*.png' --unit mm"
                      " --invalid 0 --out mine.h5")
@click.option("--images", metavar="FILES", help="Pictures: a folder, or a pattern in quotes.")
@click.option("--depth", metavar="FILES",
              help="Their depth: PNG, TIFF, EXR, PFM, NPY or NPZ, in the size of the picture.")
@reading_options(*DEPTH_KINDS)
@click.option("--intrinsics", type=InputPath(), metavar="K.json",
              help="Pinhole matrix in pixels, whose first pixel has its centre at 0.5; or an object"
              " of them by picture.")
@click.option("--groups", type=InputPath(), metavar="GROUPS.csv",
              help="Lines `picture,group`: frames of one scene or drive are a group.")
@click.option("--mask", metavar="FILES", help="Images that are 0 where depth does not count.")
@click.option("--layout", type=click.Choice(LAYOUTS), help="A public set, as it is downloaded.")
@click.option("--data", type=InputPath(), metavar="FOLDER", help="Its folder, or its file.")
@click.option("--split", type=InputPath(), help="splits.mat of NYU, or a list of KITTI's frames.")
@click.option("--source", default="", help="Where the data come from, to keep in the file.")
@click.option("--license", "licence", default="", help="Their licence, to keep in the file.")
@click.option("--out", type=NewHdf5(), required=True, metavar="TRUTH.h5", help="File to write.")
@OVERWRITE
def truth(
    images: str | None, depth: str | None, normals: str | None, intrinsics: str | None,
    groups: str | None, mask: str | None, layout: str | None, data: str | None, split: str | None,
    source: str, licence: str, out: str, overwrite: bool, **numbers: Any,
) -> None:
    """Make a file of truth that others measured, from files or from a public set.

    It is predicted and scored as a file of rooms: bench import, run, validate, score, compare,
    leaderboard.
    """
    from metrics.intake.truth_files import (
        Beside,
        read_groups,
        read_matrices,
        truth_of_files,
        unknown_unit,
    )
    from metrics.intake.truth_layouts import LAYOUTS as SETS
    from metrics.intake.truth_layouts import read_layout
    from metrics.measured.writer import write_measured
    from scenegen.files.new_file import check_writable

    hints: list[str] = []
    check_writable(Path(out), overwrite)
    if bool(layout) != bool(data) or bool(images) != bool(depth) or bool(layout) == bool(images):
        raise click.UsageError("give --images and --depth, or --layout and --data")
    if layout and data:
        told = [numbers[name] for name in ("unit", "scale", "invalid", "array")]
        if any((*told, intrinsics, groups, normals, mask)):
            raise click.UsageError("--layout knows its units, cameras and groups")
        source, licence = source or SETS[layout].source, licence or SETS[layout].licence
        rows = read_layout(layout, Path(data), Path(split) if split else None)
    else:
        assert images, "the options were checked"
        assert depth, "the options were checked"
        reading = read_as(**numbers)
        if numbers["unit"] is None and numbers["scale"] is None:
            raise unknown_unit(depth, reading)
        beside = Beside(
            read_matrices(intrinsics) if intrinsics else {}, read_groups(groups) if groups else {},
            normals, mask,
        )
        rows = truth_of_files(images, depth, reading, beside, hints.append)
    with progress_bar(len(rows), "image") as bar:
        write_measured(out, rows, source=source, licence=licence, overwrite=overwrite,
                       progress=bar.update)
    for text in hints[:1]:
        print_line(f"hint: {text} (in {len(hints)} of {len(rows)} images)", err=True)
    print_line(f"{out}: {len(rows)} images in {len({row.group for row in rows})} groups")
    command = ["bench", "run", "MODEL", "--data", out, "--out", "predictions.h5"]
    print_line(f"now: {shlex.join(command)}")


@click.command(epilog=f"{EXAMPLE}bench info mine.h5")
@click.argument("file", type=InputPath())
def info(file: str) -> None:
    """Print what a file of measured truth holds: sizes, depths, groups, source, digest."""
    from metrics.measured.describe import describe

    click.echo(describe(file))


# fmt: on
COMMANDS = (truth, info)

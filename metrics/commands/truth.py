"""The `bench` commands that make files of measured ground truth, and corrupted images."""

import shlex
from pathlib import Path
from typing import Any

import click

from metrics.commands.intake import DEPTH_KINDS, Factor, read_as, reading_options
from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import OVERWRITE
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, NewHdf5

LAYOUTS = ("moge", "nyu", "nyu-raw", "kitti", "diode", "hypersim", "sintel")


# fmt: off
@click.command(epilog=f"{EXAMPLE}bench truth --images 'rgb/*.png' --depth 'gt/*.png' --unit mm"
                      " --invalid 0 --out mine.h5")
@click.option("--images", metavar="FILES", help="Image files: a folder, or a quoted pattern such as"
              " 'rgb/*.png'.")
@click.option("--depth", metavar="FILES",
              help="Depth files: a folder, or a quoted pattern. A depth map has the size of its"
                   " image. Formats: PNG, TIFF, EXR, PFM, NPY and NPZ.")
@reading_options(*DEPTH_KINDS)
@click.option("--focal-baseline", type=Factor(), metavar="N",
              help="If the disparity is in pixels: focal length in pixels, times distance between"
                   " the two cameras in metres. Depth is N / disparity.")
@click.option("--disparity-offset", type=float, default=0.0, metavar="PIXELS",
              help="Offset that is added to each disparity, such as the difference between the"
                   " principal points of the two cameras.")
@click.option("--intrinsics", type=InputPath(), metavar="K.json",
              help="JSON file with the camera matrix of all images, or with one matrix per image"
              " name. Matrices are in pixels, with the centre of the first pixel at 0.5.")
@click.option("--groups", type=InputPath(), metavar="GROUPS.csv",
              help="CSV file with one line `image,group` per image. The images of one scene or"
                   " drive form a group.")
@click.option("--mask", metavar="FILES", help="Mask images. Pixels with the value 0 are ignored.")
@click.option("--layout", type=click.Choice(LAYOUTS), help="Name of the public data set in --data."
              " The folder layout is that of the download.")
@click.option("--data", type=InputPath(), metavar="FOLDER", help="Folder or file of the public"
                                                                 " data set.")
@click.option("--split", type=InputPath(),
              help="File that selects images of the public data set: splits.mat for NYU, or a list"
                   " of frames for KITTI.")
@click.option("--source", default="", help="Source of the data, stored in the file.")
@click.option("--license", "licence", default="", help="Licence of the data, stored in the file.")
@click.option("--out", type=NewHdf5(), required=True, metavar="TRUTH.h5", help="Output file.")
@OVERWRITE
def truth(
    images: str | None, depth: str | None, normals: str | None, intrinsics: str | None,
    groups: str | None, mask: str | None, layout: str | None, data: str | None, split: str | None,
    source: str, licence: str, focal_baseline: float | None, disparity_offset: float, out: str,
    overwrite: bool, **numbers: Any,
) -> None:
    """Make a file of sensor ground truth, from image and depth files or from a public data set.

    `bench import`, `run`, `validate`, `score`, `compare` and `leaderboard` accept this file in
    place of a file of rooms.
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
        if any((*told, focal_baseline, disparity_offset, intrinsics, groups, normals, mask)):
            raise click.UsageError("--layout sets units, cameras and groups: leave out their"
                                   " options")
        source, licence = source or SETS[layout].source, licence or SETS[layout].licence
        rows = read_layout(layout, Path(data), Path(split) if split else None)
    else:
        assert images, "the options were checked"
        assert depth, "the options were checked"
        disparity = numbers["kind"] == "disparity"
        if not disparity and (focal_baseline or disparity_offset):
            raise click.UsageError("--focal-baseline and --disparity-offset need --kind disparity")
        if disparity and (numbers["unit"] or (numbers["scale"] and focal_baseline)):
            raise click.UsageError("disparity has no unit of length: give --focal-baseline, or"
                                   " --scale for 1 / metres of each step")
        if focal_baseline is not None:
            numbers["scale"] = 1.0 / focal_baseline
        reading = read_as(**numbers, offset=disparity_offset)
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
    """Print the image sizes, depths, groups and source of a file of sensor ground truth."""
    from metrics.measured.describe import describe

    click.echo(describe(file))


@click.command(epilog=f"{EXAMPLE}bench corrupt rooms.h5 --kind jpeg --severity 3 --out jpeg-3.h5")
@click.argument("data", type=InputPath(), metavar="ROOMS.h5")
@click.option("--kind", required=True, metavar="NAME",
              help="Corruption: noise, shot, impulse, blur, motion, fog, brightness, dark,"
                   " contrast,"
              " pixelate, jpeg or quantize.")
@click.option("--severity", type=click.IntRange(1, 5), required=True, help="Severity of the"
                                                                           " corruption, 1 to 5.")
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=0, show_default=True,
              help="Random seed of the corruption.")
@click.option("--out", type=NewHdf5(), required=True, metavar="FILE.h5", help="Output file.")
@OVERWRITE
def corrupt(data: str, kind: str, severity: int, seed: int, out: str, overwrite: bool) -> None:
    """Corrupt the images of a file, and write them to a new file with the same ground truth.

    Run a model on both files. Then compare the two submissions with `bench compare --truth
    ROOMS.h5`. The difference between the scores is the effect of the corruption.
    """
    from metrics.corruptions import write_corrupted
    from metrics.measured.reader import open_images
    from scenegen.command_line.paths import refuse_inputs

    refuse_inputs([Path(out)], [Path(data)])
    with open_images(data) as images:
        count = len(images)
    with progress_bar(count, "image") as bar:
        write_corrupted(data, out, kind, severity, seed=seed, overwrite=overwrite,
                        progress=bar.update)
    print_line(f"{out}: {count} images, {kind} of severity {severity}")
    command = ["bench", "run", "MODEL", "--data", out, "--out", f"{Path(out).stem}-predictions.h5"]
    print_line(f"now: {shlex.join(command)}")
    print_line(f"then: bench score {Path(out).stem}-predictions.h5 --truth {shlex.quote(data)}")


# fmt: on
COMMANDS = (truth, info, corrupt)

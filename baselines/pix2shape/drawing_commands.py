"""`pix2shape sample`, `interpolate` and `rotate`: the commands that draw what a model has learned.

Heavy imports happen inside the commands, as in `commands.py`.
"""

from typing import Any

import click

from baselines.pix2shape.commands import A_MODEL, WEIGHTS, WEIGHTS_PATH, needs_torch, number
from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import OVERWRITE, Items
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, OutputPath

ROOMS = click.option(
    "--data", type=InputPath(), required=True, help="Rooms whose images are encoded."
)


def _picture(name: str, text: str = "Picture to write.") -> Any:
    """Return the option `--out` of a command that draws."""
    return click.option("--out", type=OutputPath(), default=name, show_default=True, help=text)


@click.command(epilog=f"{EXAMPLE}pix2shape sample --weights shapes-rays --out samples.png")
@click.option(
    "--weights", type=WEIGHTS_PATH, default="shapes-rays", show_default=True, help=f"{A_MODEL}."
)
@_picture("samples.png")
@number("--n", "count", least=1, most=256, default=16, text="Number of samples.")
@click.option("--class", "label", help="Class that a conditional model samples  [each in turn].")
@number("--seed", least=0, default=0, text="Seed of codes, cameras and lights.")
@OVERWRITE
def sample(
    weights: str, out: str, count: int, label: str | None, seed: int, overwrite: bool
) -> None:
    """Draw samples of the model's prior, as images, depths and normals."""
    needs_torch()
    from baselines.pix2shape.pictures import check_picture, sample_sheet, save_pictures
    from baselines.pix2shape.weights import open_weights

    check_picture(out, False, overwrite)
    model, card = open_weights(weights)
    save_pictures([sample_sheet(model, card, count, seed, label)], out, overwrite)
    print_line(f"{out}: {count} samples")


@click.command(
    epilog=f"{EXAMPLE}pix2shape interpolate --data rooms.h5 --items 0,5 --out interpolation.png"
)
@WEIGHTS
@ROOMS
@click.option(
    "--items", type=Items(), default="0,1", show_default=True, help="The two rows to go between."
)
@number("--steps", least=2, most=64, default=8, text="Number of codes.")
@_picture("interpolation.png")
@OVERWRITE
def interpolate(
    weights: str | None, data: str, items: list[int], steps: int, out: str, overwrite: bool
) -> None:
    """Draw the way from one room's code to another's, seen from the first room's camera."""
    if len(items) != 2:
        raise click.UsageError(f"--items: found {len(items)} rows, expected two such as 0,1")
    model, rooms, items = _model_and_rooms(weights, data, items, out, overwrite)
    from baselines.pix2shape.pictures import interpolation_sheet, save_pictures

    save_pictures([interpolation_sheet(model, rooms, items[0], items[1], steps)], out, overwrite)
    print_line(f"{out}: from row {items[0]} to row {items[1]} of {data}")


@click.command(epilog=f"{EXAMPLE}pix2shape rotate --data rooms.h5 --items 0-5 --out rotation.gif")
@WEIGHTS
@ROOMS
@click.option(
    "--items", type=Items(), default="0-5", show_default=True, help="Rows of the rooms to turn."
)
@number("--degrees", least=0, most=90, default=80, text="Camera's turn about the vertical axis.")
@number("--frames", least=2, most=200, default=33, text="Number of pictures on the way there.")
@_picture("rotation.gif", "GIF or WebP to write.")
@OVERWRITE
def rotate(
    weights: str | None,
    data: str,
    items: list[int],
    degrees: int,
    frames: int,
    out: str,
    overwrite: bool,
) -> None:
    """Draw an animation in which the camera turns around rooms that the model saw in one image."""
    model, rooms, items = _model_and_rooms(weights, data, items, out, overwrite, animated=True)
    from baselines.pix2shape.pictures import rotation_frames, save_pictures

    angles = [degrees * i / (frames - 1) for i in range(frames)]
    save_pictures(rotation_frames(model, rooms, items, angles), out, overwrite)
    print_line(f"{out}: {len(items)} scenes turned by {degrees} degrees")


def _model_and_rooms(
    weights: str | None,
    data: str,
    items: list[int],
    out: str,
    overwrite: bool,
    animated: bool = False,
) -> tuple[Any, Any, list[int]]:
    """Check the picture's name; return model, rooms and the rows, which are checked, too."""
    needs_torch()
    from baselines.pix2shape.pictures import check_picture, open_known_rooms
    from baselines.pix2shape.weights import open_weights, suited
    from scenegen.files.pictures import pick_rows

    check_picture(out, animated, overwrite)
    model, card = open_weights(weights or suited(data))
    rooms = open_known_rooms(data, card)
    return model, rooms, pick_rows(len(rooms), items)


COMMANDS = (sample, interpolate, rotate)

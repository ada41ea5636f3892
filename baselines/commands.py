"""`bench baseline`: reads the options and makes one library call. Heavy imports happen inside."""

import click

from baselines.pix2shape.commands import predict_to
from scenegen.common.command_line import EXAMPLE, OVERWRITE, progress_bar

BASELINES = """\b
Baselines:
  constant    one depth everywhere, the mean of the training rooms
  mean-depth  the mean depth of the training rooms at each pixel
  empty-room  the room's walls and floor, which it is told, without objects
  chance      random answers to questions
  oracle      the truth itself, which must score perfectly
  pix2shape   the reference model, with trained weights

"""


@click.command(
    epilog=f"{BASELINES}{EXAMPLE}bench baseline empty-room --data rooms.h5 --out empty-room.h5"
)
@click.argument(
    "name",
    type=click.Choice(["constant", "mean-depth", "empty-room", "chance", "oracle", "pix2shape"]),
)
@click.option("--data", required=True, help="Rooms; or questions, for chance and pix2shape.")
@click.option("--train", help="Rooms that constant and mean-depth take their means from.")
@click.option("--out", default="predictions.h5", show_default=True, help="Submission to write.")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of chance's answers."
)
@click.option(
    "--weights",
    help="Weights of pix2shape: a .safetensors file or a bundled name"
    "  [the bundled ones that suit the data].",
)
@OVERWRITE
def baseline(
    name: str,
    data: str,
    train: str | None,
    out: str,
    seed: int,
    weights: str | None,
    overwrite: bool,
) -> None:
    """Write the submission of a baseline for rooms or questions."""
    if weights is not None and name != "pix2shape":
        raise click.UsageError(f"--weights: {name} has none; they are pix2shape's")
    if train is not None and name == "pix2shape":
        raise click.UsageError("--train: pix2shape is trained already; see pix2shape train")
    method = name
    if name == "pix2shape":
        method += f", weights {predict_to(out, weights, data, overwrite=overwrite)},"
    elif name == "chance":
        from baselines.trivial import write_chance

        write_chance(data, out, seed, overwrite)
    else:
        from baselines.trivial import write_room_baseline
        from scenegen.rooms.reader import RoomsFile

        with RoomsFile(data) as rooms, progress_bar(len(rooms), "image") as bar:
            how = {"overwrite": overwrite, "progress": bar.update}
            write_room_baseline(name, data, out, train=train, **how)
    click.echo(f"{out}: {method} on {data}; score it with `bench score {out} --truth {data}`")


COMMANDS = (baseline,)

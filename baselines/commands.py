"""`bench baseline`: parse, one library call, print. Heavy imports happen inside it."""

import click

from scenegen.common.command_line import OVERWRITE, progress_bar


@click.command()
@click.argument(
    "name",
    type=click.Choice(["constant", "mean-depth", "empty-room", "chance", "oracle", "pix2shape"]),
)
@click.option("--data", required=True, help="Rooms file; questions for chance or pix2shape.")
@click.option("--train", help="Rooms file that constant and mean-depth learn their means from.")
@click.option("--out", default="predictions.h5", show_default=True, help="Submission to write.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of chance.")
@click.option("--weights", help="Of pix2shape.  [the bundled ones that suit the data]")
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
    """Write a submission of ours: those that learn little or nothing, which every model has to
    beat; the reference model, pix2shape; the oracle, which is the truth itself.
    """
    if weights is not None and name != "pix2shape":
        raise click.UsageError(f"--weights: {name} has none; they are pix2shape's")
    if name == "pix2shape":
        _reference_model(weights, data, out, train, overwrite)
        return
    from baselines.trivial import write_chance, write_room_baseline
    from scenegen.rooms.reader import RoomsFile

    if name == "chance":
        write_chance(data, out, seed, overwrite)
    else:
        with RoomsFile(data) as rooms:
            count = len(rooms)
        with progress_bar(count, "image") as bar:
            write_room_baseline(
                name, data, out, train=train, overwrite=overwrite, progress=bar.update
            )
    click.echo(f"{out}: {name} on {data}; score it with `bench score {out}`")


def _reference_model(
    weights: str | None, data: str, out: str, train: str | None, overwrite: bool
) -> None:
    from baselines.pix2shape.commands import needs_torch, show_progress

    if train is not None:
        raise click.UsageError("--train: pix2shape is trained already; see pix2shape train")
    needs_torch()
    from baselines.pix2shape.use.predict import predict_file
    from baselines.pix2shape.weights.bundled import suited

    weights = weights or suited(data)
    with show_progress("row") as bar:
        predict_file(weights, data, out, overwrite=overwrite, progress=bar)
    click.echo(f"{out}: pix2shape, weights {weights}, on {data}; score it with `bench score {out}`")


COMMANDS = (baseline,)

"""`bench baseline`: parse, one library call, print. Heavy imports happen inside it."""

import click


@click.command()
@click.argument(
    "name", type=click.Choice(["constant", "mean-depth", "empty-room", "chance", "oracle"])
)
@click.option("--data", required=True, help="Rooms file, or questions for chance.")
@click.option("--train", help="Rooms file that constant and mean-depth learn their means from.")
@click.option("--out", default="predictions.h5", show_default=True, help="Submission to write.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of chance.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def baseline(name: str, data: str, train: str | None, out: str, seed: int, overwrite: bool) -> None:
    """Write a submission that learns little or nothing: what every model has to beat; the oracle is
    the truth itself.
    """
    from tqdm import tqdm

    from baselines.trivial import write_chance, write_room_baseline
    from scenegen.scene_file import RoomsFile

    if name == "chance":
        write_chance(data, out, seed, overwrite)
    else:
        with RoomsFile(data) as rooms:
            count = len(rooms)
        with tqdm(total=count, unit="image", disable=None, leave=False) as bar:
            write_room_baseline(
                name, data, out, train=train, overwrite=overwrite, progress=bar.update
            )
    click.echo(f"{out}: {name} on {data}; score it with `bench score {out}`")


COMMANDS = (baseline,)

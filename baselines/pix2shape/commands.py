"""`pix2shape ...`: parse, one library call, print. Heavy imports happen inside the commands."""

import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from scenegen.common.command_line import OVERWRITE, Items, UserError

PACKAGES = ("torch", "lightning_fabric", "safetensors", "tensorboard")

WEIGHTS = click.option(
    "--weights",
    help="A .safetensors file with its .json beside, or the name of bundled weights."
    "  [those that suit the data]",
)
DATA = click.option("--data", required=True, help="Rooms, or questions.")
DEVICE = click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    default="auto",
    show_default=True,
    help="auto: a GPU where there is one.",
)


class Setting(click.ParamType):  # type: ignore[type-arg]
    """`name=value`, the value as JSON."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse."""
        import json

        name, _, text = str(value).partition("=")
        try:
            return name.strip(), json.loads(text)
        except ValueError:
            self.fail(f"found {value!r}, expected a number, such as batch=8", param, ctx)


@click.command()
@click.option("--data", required=True, help="Rooms, or iqtt-train.h5, to train on.")
@click.option("--out", required=True, help="Folder of the run.")
@click.option(
    "--config",
    type=click.Choice(["compact", "paper"]),
    help="compact: 40 minutes on a CPU; paper: the paper's.  [compact]",
)
@click.option(
    "--set",
    "settings",
    type=Setting(),
    multiple=True,
    help="Change one setting, such as batch=8; weights.json lists all.",
)
@click.option("--seed", type=click.IntRange(0), help="Of weights and every random choice.  [0]")
@click.option("--labels", type=click.IntRange(0), default=0, help="Answers to learn from.  [0]")
@click.option("--conditional", is_flag=True, help="Tell the networks the class of the one object.")
@click.option("--resume", is_flag=True, help="Go on from the folder's checkpoint.")
@click.option(
    "--workers", type=click.IntRange(0), default=1, show_default=True, help="Processes that read."
)
@click.option(
    "--every",
    type=click.IntRange(1),
    default=500,
    show_default=True,
    help="Iterations between checkpoints.",
)
@DEVICE
@click.option("--devices", type=click.IntRange(1), default=1, show_default=True)
@click.option("--precision", type=click.Choice(["32", "bf16"]), default="32", show_default=True)
def train(
    data: str,
    out: str,
    config: str | None,
    settings: tuple[tuple[str, Any], ...],
    seed: int | None,
    labels: int,
    conditional: bool,
    resume: bool,
    workers: int,
    every: int,
    device: str,
    devices: int,
    precision: str,
) -> None:
    """Train the model; `tensorboard --logdir OUT/logs` shows how it goes, OUT/pictures.png too."""
    needs_torch()
    from tqdm import tqdm

    from baselines.pix2shape.network.config import model_config
    from baselines.pix2shape.training.runs import Machine, train_run
    from baselines.pix2shape.use.predict import chosen_device

    chosen = dict(settings) | ({} if seed is None else {"seed": seed})
    if resume and (config or chosen or labels or conditional):
        own = "--config, --set, --seed, --labels and --conditional"
        raise click.UsageError(f"--resume goes on with the run's own {own}; leave them out")
    accelerator = "gpu" if chosen_device(device, devices).type == "cuda" else "cpu"
    numbers = {"32": "32-true", "bf16": "bf16-mixed"}[precision]
    bars: list[Any] = []

    def show(state: Any, losses: dict[str, float]) -> None:
        last = state.model.config.iterations
        if not bars:
            bars.append(tqdm(total=last, initial=state.iteration - 1, unit="it", disable=None))
        told = {name: f"{value:.3g}" for name, value in losses.items()}
        bars[0].set_postfix(told, refresh=False)
        bars[0].update(1)
        if bars[0].disable and state.iteration % every == 0:  # not a terminal: a log
            losses_told = ", ".join(f"{name} {value}" for name, value in told.items())
            click.echo(f"{state.iteration} of {last}, {state.seconds:.0f} s: {losses_told}")

    try:
        weights = train_run(
            out,
            data,
            None if resume else model_config(config or "compact", **chosen),
            Machine(accelerator, devices, numbers, workers, every),
            labels=labels,
            conditional=conditional,
            progress=show,
        )
    except KeyboardInterrupt:
        click.echo(f"\nStopped; `--resume` goes on from {out}'s last checkpoint, if it got one.")
        raise
    finally:
        for bar in bars:
            bar.close()
    if weights is not None:  # the first of several processes
        click.echo(f"{weights}: trained on {data}; now `pix2shape predict --weights {weights} ...`")


@click.command()
@WEIGHTS
@DATA
@click.option("--out", default="predictions.h5", show_default=True, help="Submission to write.")
@click.option("--run", default="", help="Name of this run among several of the method.")
@DEVICE
@OVERWRITE
def predict(
    weights: str | None, data: str, out: str, run: str, device: str, overwrite: bool
) -> None:
    """Predict every view of each room from its input view alone, or answer questions."""
    needs_torch()
    from baselines.pix2shape.use.predict import predict_file
    from baselines.pix2shape.weights.bundled import suited

    weights = weights or suited(data)
    with show_progress("row") as bar:
        predict_file(weights, data, out, run=run, device=device, overwrite=overwrite, progress=bar)
    click.echo(f"{out}: {weights} on {data}; score it with `bench score {out}`")


@click.command()
@click.option(
    "--weights",
    default="shapes",
    show_default=True,
    help="A .safetensors file with its .json beside, or the name of bundled weights.",
)
@click.option("--out", default="samples.png", show_default=True, help="Picture to write.")
@click.option("--n", "count", type=click.IntRange(1, 256), default=16, show_default=True)
@click.option("--class", "label", help="Of a conditional model; without, each in turn.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def sample(weights: str, out: str, count: int, label: str | None, seed: int) -> None:
    """Draw scenes that never were: lines of images, depths and normals."""
    needs_torch()
    from baselines.pix2shape.pictures import check_picture, save_pictures
    from baselines.pix2shape.use.explore import sample_sheet
    from baselines.pix2shape.weights.bundled import open_weights

    check_picture(out)
    model, card = open_weights(weights)
    save_pictures([sample_sheet(model, card, count, seed, label)], out)
    click.echo(f"{out}: {count} samples")


@click.command()
@WEIGHTS
@DATA
@click.option("--items", type=Items(), default="0,1", show_default=True, help="Two rows.")
@click.option("--steps", type=click.IntRange(2, 64), default=8, show_default=True)
@click.option("--out", default="interpolation.png", show_default=True, help="Picture to write.")
def interpolate(weights: str | None, data: str, items: list[int], steps: int, out: str) -> None:
    """Go from one image's scene to another's, seen from the first one's camera."""
    needs_torch()
    from baselines.pix2shape.pictures import check_picture, save_pictures
    from baselines.pix2shape.use.explore import interpolation_sheet, known_rooms
    from baselines.pix2shape.weights.bundled import open_weights, suited
    from scenegen.rooms.preview import pick_rows

    check_picture(out)
    model, card = open_weights(weights or suited(data))
    if len(items) != 2:
        raise click.UsageError(f"--items: found {len(items)} rows, expected two such as 0,1")
    rooms = known_rooms(data, card)
    items = pick_rows(len(rooms), items)
    save_pictures([interpolation_sheet(model, rooms, items[0], items[1], steps)], out)
    click.echo(f"{out}: from row {items[0]} to row {items[1]} of {data}")


@click.command()
@WEIGHTS
@DATA
@click.option("--items", type=Items(), default="0-5", show_default=True, help="Rows to turn.")
@click.option("--degrees", type=click.IntRange(0, 90), default=80, show_default=True)
@click.option("--frames", type=click.IntRange(2, 200), default=33, show_default=True)
@click.option("--out", default="rotation.gif", show_default=True, help="GIF or WebP to write.")
def rotate(
    weights: str | None, data: str, items: list[int], degrees: int, frames: int, out: str
) -> None:
    """Turn the camera around scenes that were seen from one side."""
    needs_torch()
    from baselines.pix2shape.pictures import check_picture, save_pictures
    from baselines.pix2shape.use.explore import known_rooms, rotation_frames
    from baselines.pix2shape.weights.bundled import open_weights, suited
    from scenegen.rooms.preview import pick_rows

    check_picture(out, animated=True)
    model, card = open_weights(weights or suited(data))
    rooms = known_rooms(data, card)
    items = pick_rows(len(rooms), items)
    angles = [degrees * i / (frames - 1) for i in range(frames)]
    save_pictures(rotation_frames(model, rooms, items, angles), out)
    click.echo(f"{out}: {len(items)} scenes turned by {degrees} degrees")


def needs_torch() -> None:
    """Raise UserError where the optional packages are missing."""
    missing = [name for name in PACKAGES if importlib.util.find_spec(name) is None]
    if missing:
        raise UserError(
            f"pix2shape needs {', '.join(missing)}: pip install 'pix2shape-bench[model]'"
        )


@contextmanager
def show_progress(unit: str) -> Iterator[Callable[[int, int], Any]]:
    """Show a bar whose total is told with each step."""
    from tqdm import tqdm

    with tqdm(unit=unit, disable=None, leave=False) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done)

        yield show


COMMANDS = (train, predict, sample, interpolate, rotate)

"""The commands `pix2shape`: each reads its options and makes one library call.

Heavy imports happen inside the commands, so that `--help` is quick and works without torch.
"""

import shlex
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import LARGEST, MOST_PROCESSES, OVERWRITE, Items
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, NewHdf5, OutputFolder, OutputPath

PACKAGES = ("torch", "safetensors", "tensorboard")
A_MODEL = "Weights: a .safetensors file, or the name of bundled weights"

WEIGHTS_PATH = InputPath()
WEIGHTS = click.option(
    "--weights", type=WEIGHTS_PATH, help=f"{A_MODEL} [the bundled weights for this kind of data]."
)
SUBMISSION = click.option(
    "--out",
    type=NewHdf5(),
    default="predictions.h5",
    show_default=True,
    help="Output file of predictions.",
)
DEVICE = click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    default="auto",
    show_default=True,
    help="Device to compute on. auto selects a GPU if there is one.",
)
MINUTES = click.option(
    "--minutes",
    type=click.FloatRange(0, 1e6, min_open=True),
    help="Duration of training in minutes. Training has as many iterations as fit into this time.",
)
ALLOW_TEST_SET = click.option(
    "--allow-test-set", is_flag=True, help="Allow training on a named benchmark or its scenes."
)
ROOMS = click.option(
    "--data", type=InputPath(), required=True, help="File of rooms whose images are encoded."
)


def number(*names: str, least: int, default: int, text: str, most: int = LARGEST) -> Any:
    """Return an option that takes a whole number and shows its default."""
    kind = click.IntRange(least, most)
    return click.option(*names, type=kind, default=default, show_default=True, help=text)


class Setting(click.ParamType):  # type: ignore[type-arg]
    """`name=value`, where the value is written as in JSON; what is no JSON is a text."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return name and value."""
        import json

        name, equals, text = str(value).partition("=")
        if not equals:
            self.fail(f"found {value!r:.100}, expected {self.name} such as batch=8", param, ctx)
        try:
            return name.strip(), json.loads(text)
        except ValueError:
            return name.strip(), text
        except RecursionError:
            self.fail(f"found {value!r:.100}, expected a simpler value", param, ctx)


def named_once(settings: tuple[tuple[str, Any], ...], **options: Any) -> dict[str, Any]:
    """Return the settings of --set and of other options, unless one comes twice: UsageError."""
    chosen = dict(options)
    for name, value in settings:
        if name in chosen:
            raise click.UsageError(f"--set: {name!r:.40} is given twice")
        chosen[name] = value
    return chosen


@click.command(epilog=f"{EXAMPLE}pix2shape train --data rooms.h5 --out run")
@ALLOW_TEST_SET
@click.option(
    "--data", type=InputPath(), required=True, help="Training file: rooms, or iqtt-train.h5."
)
@click.option("--out", type=OutputFolder(), required=True, help="Output folder of the run.")
@click.option(
    "--config",
    type=click.Choice(["rays", "views", "paper"]),
    help="Configuration. rays: rooms with several views; takes 40 minutes on a CPU. views:"
    " questions. paper: the paper's size and losses; needs a GPU [rays for rooms, views for"
    " questions].",
)
@click.option(
    "--set",
    "settings",
    type=Setting(),
    multiple=True,
    help="A setting of the configuration, such as batch=8 or networks.size=128. docs/pix2shape.md"
    " lists the settings. Repeatable.",
)
@click.option("--seed", type=click.IntRange(0, LARGEST), help="Random seed [0].")
@number("--labels", least=0, default=0, text="Number of labelled questions to use.")
@click.option(
    "--conditional",
    is_flag=True,
    help="Condition the networks on the category of the object. Each room must have one object.",
)
@click.option(
    "--start",
    type=WEIGHTS_PATH,
    help="Initial weights, from an earlier run of the same networks.",
)
@click.option("--resume", is_flag=True, help="Resume from the checkpoint in --out.")
@number(
    "--workers", least=0, most=MOST_PROCESSES, default=1, text="Number of data loading processes."
)
@number("--every", least=1, default=500, text="Number of iterations between checkpoints.")
@MINUTES
@DEVICE
@click.option(
    "--precision",
    type=click.Choice(["32", "bf16"]),
    help="Precision of the networks. Losses and renderer always use 32 bits [32; with --resume,"
    " that"
    " of the run].",
)
def train(
    data: str,
    out: str,
    config: str | None,
    settings: tuple[tuple[str, Any], ...],
    seed: int | None,
    labels: int,
    conditional: bool,
    start: str | None,
    resume: bool,
    workers: int,
    every: int,
    minutes: float | None,
    device: str,
    precision: str | None,
    allow_test_set: bool,
) -> None:
    """Train the model on rooms or questions, and write weights and checkpoints to a folder.

    OUT/pictures.png and `tensorboard --logdir OUT/logs` show the progress.
    """
    needs_torch()
    from baselines.pix2shape.network.config import model_config
    from baselines.pix2shape.training.run import train_run
    from baselines.training.machine import Machine

    chosen = named_once(settings, **({} if seed is None else {"seed": seed}))
    if resume and (config or chosen or labels or conditional or start):
        options = "--config, --set, --seed, --labels, --conditional and --start"
        raise click.UsageError(f"--resume uses the {options} of the run: leave them out")
    machine = Machine(device, workers, every, minutes)
    opened = training_data((data,), allow_test_set)
    with opened as files, shown_training(out, every) as show:
        name = config or ("views" if files.hold_questions else "rays")
        weights = train_run(
            out,
            files,
            None if resume else model_config(name, **chosen),
            machine,
            labels=labels,
            conditional=conditional,
            start=start,
            precision=precision,
            chosen=chosen,
            progress=show,
        )
    print_line(f"{weights}: trained on {files.where}")
    print_line(f"now: pix2shape predict --weights {shlex.quote(str(weights))} --data ...")


@contextmanager
def training_data(paths: tuple[str, ...], allow_test_set: bool) -> Iterator[Any]:
    """Open files to learn from. Raises UsageError without any, SpecError for a named test set."""
    from baselines.training.data import TrainingFiles, refuse_test_set

    if not paths:
        raise click.UsageError("give --data to train on")
    with TrainingFiles(*paths) as files:
        for opened in () if allow_test_set else files.opened:
            refuse_test_set(opened)
        yield files


@contextmanager
def shown_training(
    out: str, every: int
) -> Iterator[Callable[[int, int, Mapping[str, float]], None]]:
    """Give a function that shows iterations done, in all, and losses: as a bar, or in lines.

    Lines come every `every` iterations where there is no terminal, but perhaps a log.
    """
    bar: Any = None

    def show(done: int, total: int, losses: Mapping[str, float]) -> None:
        nonlocal bar
        text = ", ".join(f"{name} {value:.3g}" for name, value in losses.items())
        if bar is None:  # the first iteration, of a resumed run too
            bar = progress_bar(total, "it")
            bar.initial = bar.n = max(0, done - 1)
        bar.total = total
        bar.set_postfix_str(text, refresh=False)
        bar.update(done - bar.n)  # none while images are matched
        if bar.disable and done and (done % every == 0 or done == total):
            print_line(f"{done} of {total}: {text}")

    try:
        yield show
    except KeyboardInterrupt:
        click.echo()
        where = f" after {bar.n} of {bar.total} iterations of its schedule" if bar else ""
        print_line(f"stopped{where}; --resume continues from the last checkpoint in {out}, if any")
        raise
    finally:
        if bar is not None:
            bar.close()


@click.command(epilog=f"{EXAMPLE}pix2shape predict --data rooms.h5 --out predictions.h5")
@WEIGHTS
@click.option(
    "--data", type=InputPath(), required=True, help="File of rooms or questions to predict."
)
@SUBMISSION
@click.option("--run", default="", help="Name of the training run, such as its seed.")
@DEVICE
@OVERWRITE
def predict(
    weights: str | None, data: str, out: str, run: str, device: str, overwrite: bool
) -> None:
    """Predict depth and normals of rooms, or responses to questions, and write the predictions.

    All views of a room are predicted from its first view and the cameras.
    """
    weights = predict_to(out, weights, data, run=run, device=device, overwrite=overwrite)
    print_line(f"{out}: {weights} on {data}")
    print_line(how_to_score(out, data))


def predict_to(
    out: str, weights: str | None, data: str, *, method: str | None = None, **how: Any
) -> str:
    """Write a submission with `predict_file`, and a progress bar; return the weights used.

    Args:
        weights: None for the bundled ones that suit the data.
        method: as `bundled.suited`; the name that the submission must have.
    """
    needs_torch()
    from baselines.pix2shape.predict import predict_file
    from baselines.pix2shape.weights import suited

    weights = weights or suited(data, method)
    with shown_rows() as show:
        predict_file(weights, data, out, **how, method=method, progress=show)
    return weights


@contextmanager
def shown_rows() -> Iterator[Callable[[int, int], None]]:
    """Give a function that shows, as a bar, rows done since its last call, and rows in all."""
    with progress_bar(None, "row") as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done)

        yield show


def how_to_score(out: str, data: str) -> str:
    """Return the next command, which is printed after predictions."""
    return f"now: {shlex.join(['bench', 'score', out, '--truth', data])}"


def needs_torch(who: str = "pix2shape", packages: tuple[str, ...] = PACKAGES) -> None:
    """Raise UserError where an optional package is missing."""
    needs(who, packages, "model")


def _picture(name: str, text: str = "Output image.") -> Any:
    """Return the option `--out` of a command that draws."""
    return click.option("--out", type=OutputPath(), default=name, show_default=True, help=text)


@click.command(epilog=f"{EXAMPLE}pix2shape sample --weights shapes-rays --out samples.png")
@click.option(
    "--weights", type=WEIGHTS_PATH, default="shapes-rays", show_default=True, help=f"{A_MODEL}."
)
@_picture("samples.png")
@number("--n", "count", least=1, most=256, default=16, text="Number of samples.")
@click.option(
    "--class", "label", help="Category to sample from a conditional model [each in turn]."
)
@number("--seed", least=0, default=0, text="Seed of codes, cameras and lights.")
@OVERWRITE
def sample(
    weights: str, out: str, count: int, label: str | None, seed: int, overwrite: bool
) -> None:
    """Draw samples from the prior of the model: images, depths and normals."""
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
    "--items",
    type=Items(),
    default="0,1",
    show_default=True,
    help="The two images to interpolate between.",
)
@number("--steps", least=2, most=64, default=8, text="Number of codes.")
@_picture("interpolation.png")
@OVERWRITE
def interpolate(
    weights: str | None, data: str, items: list[int], steps: int, out: str, overwrite: bool
) -> None:
    """Draw an interpolation between the codes of two rooms, seen from the camera of the first."""
    if len(items) != 2:
        raise click.UsageError(f"--items: found {len(items)} images, expected two such as 0,1")
    model, rooms, items = _model_and_rooms(weights, data, items, out, overwrite)
    from baselines.pix2shape.pictures import interpolation_sheet, save_pictures

    save_pictures([interpolation_sheet(model, rooms, items[0], items[1], steps)], out, overwrite)
    print_line(f"{out}: from image {items[0]} to image {items[1]} of {data}")


@click.command(epilog=f"{EXAMPLE}pix2shape rotate --data rooms.h5 --items 0-5 --out rotation.gif")
@WEIGHTS
@ROOMS
@click.option(
    "--items", type=Items(), default="0-5", show_default=True, help="Images of the rooms to rotate."
)
@number(
    "--degrees",
    least=0,
    most=90,
    default=80,
    text="Rotation of the camera about the vertical axis.",
)
@number("--frames", least=2, most=200, default=33, text="Number of frames in each direction.")
@_picture("rotation.gif", "Output GIF or WebP.")
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
    """Draw an animation of a camera that rotates around rooms, each predicted from one image."""
    model, rooms, items = _model_and_rooms(weights, data, items, out, overwrite, animated=True)
    from baselines.pix2shape.pictures import rotation_frames, save_pictures

    angles = [degrees * i / (frames - 1) for i in range(frames)]
    save_pictures(rotation_frames(model, rooms, items, angles), out, overwrite)
    print_line(f"{out}: {len(items)} scenes, rotated by {degrees} degrees")


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
    from scenegen.files.images.pictures import pick_rows

    check_picture(out, animated, overwrite)
    model, card = open_weights(weights or suited(data))
    rooms = open_known_rooms(data, card)
    return model, rooms, pick_rows(len(rooms), items)


COMMANDS = (train, predict, sample, interpolate, rotate)

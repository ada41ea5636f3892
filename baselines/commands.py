"""`bench baseline` and `bench train`: each reads its options and makes one library call.

Heavy imports happen inside the commands, so that `--help` is quick and works without torch.
"""

import inspect
import shlex
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click

from baselines.pix2shape.commands import (
    SUBMISSION,
    WEIGHTS_PATH,
    Setting,
    named_once,
    needs_torch,
    predict_to,
    score_it,
)
from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import LARGEST, OVERWRITE
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputFolder

UNTRAINED = {
    "constant": "one depth everywhere, the mean of the training rooms",
    "mean-depth": "the mean depth of the training rooms at each pixel",
    "empty-room": "the room's walls and floor, which it is told; no objects",
    "oracle": "the truth itself, which must score perfectly",
    "chance": "random answers to questions",
    "outline": "questions: the nearest outline, without labels or 3D",
    "outline-trees": "questions: trees on outline features, from --train",
    "pix2shape": "the reference model, trained by the paper's losses",
    "pix2shape-compact": "the same, trained by other losses",
    "pix2shape-rays": "rooms: the same, told walls; learned from several views",
    "pix2shape-views": "questions: the same, with an encoder of its own",
}
REFERENCE = ("pix2shape", "pix2shape-compact", "pix2shape-rays", "pix2shape-views")
# Packages `baselines.<name>`, - written as _, whose functions `train` and `write_submission` make
# a baseline that is trained with `bench train NAME`. A new one is a line here.
TRAINED = {
    "cnn": "questions: ResNets and a softmax over the answers",
    "depth-supervised": "rooms: a network trained with true depth, as a ceiling",
    "ptn": "rooms and questions: voxels, learned from silhouettes",
    "rezende": "questions: meshes, by a renderer without gradients",
    "siamese": "questions: the answer whose features are nearest",
    "view-pairs": "rooms: a network trained with pairs of images, no depth",
}
ALL = {**UNTRAINED, **TRAINED}


def _listed(baselines: Mapping[str, str]) -> str:
    wide = max(map(len, baselines))
    lines = (f"  {name:{wide}}  {text}" for name, text in baselines.items())
    return "\n".join(("\b", "Baselines:", *lines, "", ""))


@click.command(
    epilog=f"{_listed(ALL)}{EXAMPLE}bench baseline empty-room --data rooms.h5 --out empty-room.h5"
)
@click.argument("name", type=click.Choice(list(ALL)))
@click.option("--data", type=InputPath(), required=True, help="Rooms or questions to predict.")
@click.option(
    "--train",
    type=InputPath(),
    help="What is learned from: rooms for constant and mean-depth, questions for outline-trees.",
)
@click.option(
    "--labels",
    type=click.IntRange(1, LARGEST),
    help="Labelled questions of --train that outline-trees learns from  [all].",
)
@SUBMISSION
@click.option(
    "--seed",
    type=click.IntRange(0, LARGEST),
    default=0,
    show_default=True,
    help="Seed of chance's answers.",
)
@click.option(
    "--weights",
    type=WEIGHTS_PATH,
    help="Weights of a trained baseline: a .safetensors file, or for the reference model a bundled"
    " name  [the bundled ones that suit the data].",
)
@OVERWRITE
def baseline(
    name: str,
    data: str,
    train: str | None,
    labels: int | None,
    out: str,
    seed: int,
    weights: str | None,
    overwrite: bool,
) -> None:
    """Write the submission of a baseline for rooms or questions."""
    if weights is not None and name not in (*REFERENCE, *TRAINED):
        raise click.UsageError(f"--weights: {name} has none")
    if train is not None and name in (*REFERENCE, *TRAINED):
        command = "pix2shape train" if name in REFERENCE else f"bench train {name}"
        raise click.UsageError(f"--train: {name} is trained already; see {command}")
    if labels is not None and name != "outline-trees":
        raise click.UsageError(f"--labels: {name} learns from none")
    method = name
    if name in ("outline", "outline-trees"):
        _answer_by_outline(name, data, out, train, labels, overwrite)
    elif name in REFERENCE:
        used = predict_to(out, weights, data, method=name, overwrite=overwrite)
        method += f", weights {used},"
    elif name in TRAINED:
        with progress_bar(None, "row") as bar:

            def show(done: int, total: int) -> None:
                bar.total = total
                bar.update(done)

            write = _package(name).write_submission
            given = {} if weights is None else {"weights": weights}
            write(data, out, **given, overwrite=overwrite, progress=show)
    elif name == "chance":
        from baselines.trivial import write_chance

        write_chance(data, out, seed, overwrite)
    else:
        from baselines.trivial import write_room_baseline
        from scenegen.rooms.reader import RoomsFile

        with RoomsFile(data) as rooms, progress_bar(len(rooms), "image") as bar:
            how = {"overwrite": overwrite, "progress": bar.update}
            write_room_baseline(name, data, out, train=train, **how)
    print_line(f"{out}: {method} on {data}; {score_it(out, data)}")


def _answer_by_outline(
    name: str, data: str, out: str, train: str | None, labels: int | None, overwrite: bool
) -> None:
    from baselines.outline.submission import write_outline, write_outline_trees

    if (train is None) == (name == "outline-trees"):
        needs = "needs" if train is None else "uses no"
        raise click.UsageError(f"--train: {name} {needs} labelled questions")
    with progress_bar(None, "question") as bar:
        if train is None:
            write_outline(data, out, overwrite=overwrite, progress=bar.update)
        else:
            write_outline_trees(data, out, train, labels, overwrite=overwrite, progress=bar.update)


@click.command(
    name="train",
    epilog=f"{_listed(TRAINED)}{EXAMPLE}bench train cnn --data iqtt-split/iqtt-train.h5 --out run",
)
@click.argument("name", type=click.Choice(list(TRAINED)))
@click.option("--data", type=InputPath(), required=True, help="Rooms or questions to train on.")
@click.option("--out", type=OutputFolder(), required=True, help="Folder of the run.")
@click.option(
    "--labels",
    type=click.IntRange(0, LARGEST),
    help="Labelled questions whose answers may be used  [the baseline's own].",
)
@click.option(
    "--seed", type=click.IntRange(0, LARGEST), help="Seed of every random choice  [the run's; 0]."
)
@click.option(
    "--iterations", type=click.IntRange(1, LARGEST), help="Steps of training  [the baseline's own]."
)
@click.option(
    "--set",
    "settings",
    type=Setting(),
    multiple=True,
    help="Change another setting of the baseline, such as depth=50; docs/baselines.md lists them.",
)
@click.option("--resume", is_flag=True, help="Go on from the checkpoint of --out.")
def train_baseline(
    name: str,
    data: str,
    out: str,
    labels: int | None,
    seed: int | None,
    iterations: int | None,
    settings: tuple[tuple[str, Any], ...],
    resume: bool,
) -> None:
    """Train a baseline; weights and checkpoint are written to a folder."""
    options = {"labels": labels, "seed": seed, "iterations": iterations}
    given = {key: value for key, value in options.items() if value is not None}
    if resume and (given or settings):
        own = "--labels, --seed, --iterations and --set"
        raise click.UsageError(f"--resume goes on with the run's own {own}; leave them out")
    train = _package(name).train
    parameters = inspect.signature(train).parameters.values()
    known = {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}
    for key in given:
        if key not in known:
            raise click.UsageError(f"--{key}: {name} has no such setting")
    others = {key: known[key] for key in sorted(known.keys() - {*options, "resume", "progress"})}
    for key, value in named_once(settings).items():
        if key not in others:
            raise click.UsageError(f"--set: found {key!r:.40}, expected one of {', '.join(others)}")
        like = type(others[key])
        if like not in (type(value), type(None)) and (like, type(value)) != (float, int):
            text = f"--set: {key}: found {value!r:.40}, expected one like {others[key]!r}"
            raise click.UsageError(text)
        given[key] = value
    bar, told = progress_bar(None, "it"), ""

    def show(done: int, total: int, numbers: Mapping[str, float]) -> None:
        nonlocal told
        told = ", ".join(f"{key} {value:.3g}" for key, value in numbers.items())
        if bar.total is None:  # the first iteration, of a resumed run too
            bar.total, bar.initial, bar.n = total, done - 1, done - 1
        bar.set_postfix_str(told, refresh=False)
        bar.update(done - bar.n)
        if bar.disable and (done % 100 == 0 or done == total):  # no terminal, but perhaps a log
            print_line(f"{done} of {total}: {told}")

    try:
        weights = train(data, out, **given, resume=resume, progress=show)
    except KeyboardInterrupt:
        click.echo()
        print_line(f"Stopped; `--resume` goes on from {out}'s last checkpoint, if it got one.")
        raise
    finally:
        bar.close()
    more = f" ({told})" if told else ""
    use = f"bench baseline {name} --weights {shlex.quote(str(weights))} --data ..."
    print_line(f"{weights}: {name} trained on {data}{more}; now `{use}`")


def _package(name: str) -> Any:
    """Return the package of a trained baseline. Raises UserError where torch is missing."""
    needs_torch(name, ("torch", "safetensors"))
    return import_module(f"baselines.{name.replace('-', '_')}")


COMMANDS = (baseline, train_baseline)

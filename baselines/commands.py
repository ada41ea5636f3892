"""`bench baseline` and `bench train`: each reads its options and makes one library call.

Heavy imports happen inside the commands, so that `--help` is quick and works without torch.
"""

import json
import shlex
from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from baselines.pix2shape.commands import (
    ALLOW_TEST_SET,
    DEVICE,
    MINUTES,
    STREAM,
    SUBMISSION,
    WEIGHTS_PATH,
    Setting,
    how_to_score,
    named_once,
    needs_torch,
    predict_to,
    shown_rows,
    shown_training,
    training_data,
)
from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import LARGEST, OVERWRITE
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputFolder

if TYPE_CHECKING:
    from baselines.training.baseline import Baseline

UNTRAINED = {
    "constant": "rooms: one depth everywhere, the mean of the training rooms",
    "mean-depth": "rooms: the mean depth of the training rooms at each pixel",
    "empty-room": "rooms: the room's walls and floor, which it is told; no objects",
    "cut-out": "rooms: true masks, flat, at each object's true distance",
    "picture-outline": "rooms: a mask from the picture, lifted by one constant",
    "balls": "rooms: a ball for each blob of that mask in the first view",
    "outline-regression": "rooms: that mask, lifted by a regression, from --train",
    "outline-relief": "rooms: that mask, lifted by trees, from --train",
    "nearest": "rooms: the relief of the most similar picture of --train",
    "oracle": "the truth itself, which must score perfectly",
    "chance": "questions: random answers",
    "oracle-warp": "questions: true depth of rooms, carried into the other camera",
    "cubes": "questions: pictures decoded to cubes in 3D; nothing is learned",
    "outline": "questions: the nearest outline, without labels or 3D",
    "features": "questions: features of a frozen encoder, from --features",
    "outline-trees": "questions: trees on outline features, from --train",
    "pix2shape": "the reference model, trained by the paper's losses",
    "pix2shape-compact": "the same, trained by other losses",
    "pix2shape-rays": "rooms: the same, told walls; learned from several views",
    "pix2shape-views": "questions: the same, with an encoder of its own",
}
OF_SHAPES = (
    "cubes",
    "depth-match",
    "ptn",
    "rezende",
    "pix2shape",
    "pix2shape-compact",
    "pix2shape-views",
)  # which know the camera of shapes, and no rooms
REFERENCE = ("pix2shape", "pix2shape-compact", "pix2shape-rays", "pix2shape-views")
# Baselines that are trained with `bench train NAME`: the modules of their `BASELINE`, and what they
# are. A new one is a line here.
HOMES = {
    "cnn": ("resnets.cnn", "questions: ResNets and a softmax over the answers"),
    "depth-completed": ("relief.depth_completed", "rooms: a network that completes the first view"),
    "depth-match": (
        "depth_match.training",
        "questions: depth from a network, turned until views agree",
    ),
    "depth-supervised": (
        "relief.depth_supervised",
        "rooms: a network trained with true depth",
    ),
    "ptn": ("ptn.training", "rooms and questions: voxels, learned from silhouettes"),
    "rezende": ("rezende.training", "questions: meshes, by a renderer without gradients"),
    "siamese": ("resnets.siamese", "questions: the answer whose features are nearest"),
    "view-pairs": (
        "relief.view_pairs",
        "rooms: a network trained with pairs of images, no depth",
    ),
}
TRAINED = {name: text for name, (_, text) in HOMES.items()}
ALL = {**UNTRAINED, **TRAINED}


def _listed(baselines: Mapping[str, str]) -> str:
    wide = max(map(len, baselines))
    lines = (f"  {name:{wide}}  {text}" for name, text in baselines.items())
    return "\n".join(("\b", "Baselines:", *lines, "", ""))


@click.command(
    epilog=f"{_listed(ALL)}{EXAMPLE}bench baseline empty-room --data rooms.h5 --out empty-room.h5"
)
@click.argument("name", type=click.Choice(list(ALL)), metavar="NAME")
@click.option("--data", type=InputPath(), required=True, help="Rooms or questions to predict.")
@click.option(
    "--train",
    type=InputPath(),
    help="What is learned from: rooms for constant, mean-depth, nearest, outline-regression and"
    " outline-relief; questions for outline-trees and features.",
)
@click.option(
    "--labels",
    type=click.IntRange(1, LARGEST),
    help="Labelled questions of --train that outline-trees and features learn from  [all].",
)
@click.option(
    "--features",
    type=InputPath(),
    help="For features: a .npy file of (Q, 1 + K, D) numbers, for each picture of --data.",
)
@click.option(
    "--train-features", type=InputPath(), help="The same for the labelled questions of --train."
)
@ALLOW_TEST_SET
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
    features: str | None,
    train_features: str | None,
    out: str,
    seed: int,
    weights: str | None,
    allow_test_set: bool,
    overwrite: bool,
) -> None:
    """Write the submission of a baseline for rooms or questions."""
    from baselines.training.data import refuse_test_set
    from scenegen.files.sets.shards import OpenFile

    if train is not None and not allow_test_set:
        with OpenFile(train, "rooms or question file") as opened:
            refuse_test_set(opened)
    _check_task(name, data)
    _check_options(name, weights, train, labels, features)
    if train_features is not None and name != "features":
        raise click.UsageError(f"--train-features: {name} takes none")
    method = name
    if name in REFERENCE:
        used = predict_to(out, weights, data, method=name, overwrite=overwrite)
        method += f", weights {used},"
    elif name == "chance":
        from baselines.trivial import write_chance

        write_chance(data, out, seed, overwrite)
    else:
        with shown_rows() as show:
            how: dict[str, Any] = {"overwrite": overwrite, "progress": show}
            if name in TRAINED:
                from baselines.training.baseline import write_submission

                write_submission(_baseline(name), data, out, weights, **how)
            elif name == "oracle-warp":
                from baselines.warp import write_warp

                write_warp(data, out, **how)
            elif name == "cubes":
                needs("cubes", ("numba",), "cubes")
                from baselines.cubes.answer import write_cubes

                write_cubes(data, out, **how)
            elif features is not None:
                from baselines.features import write_features

                how = {"train": train, "train_features": train_features, "labels": labels}
                write_features(data, out, features, **how, overwrite=overwrite)
            elif name in ("outline", "outline-trees"):
                from baselines.outline import write_outline

                write_outline(data, out, train, labels, **how)
            else:
                from baselines.trivial import write_room_baseline

                write_room_baseline(name, data, out, train=train, **how)
    print_line(f"{out}: {method} on {data}; {how_to_score(out, data)}")


def _check_options(
    name: str, weights: str | None, train: str | None, labels: int | None, features: str | None
) -> None:
    """Raise UsageError for an option that a baseline does not have, or lacks."""
    if weights is not None and name not in (*REFERENCE, *TRAINED):
        raise click.UsageError(f"--weights: {name} has none")
    if train is not None and name in (*REFERENCE, *TRAINED):
        command = "pix2shape train" if name in REFERENCE else f"bench train {name}"
        raise click.UsageError(f"--train: {name} is trained already; see {command}")
    if name in ("outline", "outline-trees") and (train is None) == (name == "outline-trees"):
        wants = "needs" if train is None else "uses no"
        raise click.UsageError(f"--train: {name} {wants} labelled questions")
    if labels is not None and name not in ("outline-trees", "features"):
        raise click.UsageError(f"--labels: {name} learns from none")
    if (features is None) == (name == "features"):
        how = "needs features of the pictures" if features is None else "takes none"
        raise click.UsageError(f"--features: {name} {how}")


def _check_task(name: str, data: str) -> None:
    """Raise UsageError for questions given to a baseline of rooms, or rooms to one of questions."""
    from iqtt.perspective.specs import MARK
    from metrics.submissions.layout import DATA_FORMATS
    from scenegen.files.attributes import read_text
    from scenegen.files.sets.shards import OpenFile

    if not Path(data).is_file():
        return  # its reader says so, after what is missing otherwise
    task = ALL[name].partition(":")[0]
    with OpenFile(data, "file of rooms or questions") as opened:
        stored = DATA_FORMATS.get(read_text(opened.file, "format", data) or "", task)
        of_rooms = stored == "questions" and MARK in str(opened.file.attrs.get("spec", ""))
    if of_rooms and name in OF_SHAPES:
        expected = "try oracle-warp, outline, features, cnn or siamese"
        raise click.UsageError(f"{name} knows shapes alone, and {data} shows rooms; {expected}")
    if task in ("rooms", "questions") and task != stored:
        others = ", ".join(other for other in ALL if ALL[other].startswith(f"{stored}:"))
        raise click.UsageError(f"{name} predicts {task}, and {data} holds {stored}; try {others}")


@click.command(
    name="train",
    epilog=f"{_listed(TRAINED)}{EXAMPLE}bench train cnn --data iqtt-split/iqtt-train.h5 --out run",
)
@click.argument("name", type=click.Choice(list(TRAINED)), metavar="NAME")
@click.argument("more", type=InputPath(), nargs=-1, metavar="")
@click.option(
    "--data",
    type=InputPath(),
    multiple=True,
    metavar="FILE...",
    help="Rooms or questions to train on; networks of depth learn from several files.",
)
@STREAM
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
@MINUTES
@DEVICE
@ALLOW_TEST_SET
def train_baseline(
    name: str,
    more: tuple[str, ...],
    data: tuple[str, ...],
    stream: str | None,
    out: str,
    labels: int | None,
    seed: int | None,
    iterations: int | None,
    settings: tuple[tuple[str, Any], ...],
    resume: bool,
    minutes: float | None,
    device: str,
    allow_test_set: bool,
) -> None:
    """Train a baseline; weights and checkpoint are written to a folder."""
    options = {"labels": labels, "seed": seed, "iterations": iterations}
    chosen = {key: value for key, value in options.items() if value is not None}
    if resume and (chosen or settings):
        message = "--resume goes on with the run's own --labels, --seed, --iterations and --set"
        raise click.UsageError(f"{message}; leave them out")
    if minutes is not None and iterations is not None:
        raise click.UsageError("--minutes decides --iterations; leave one of them out")
    home = _baseline(name)
    if stream is not None and home.streamed is None:
        raise click.UsageError(f"--stream: {name} learns from files")
    from baselines.training.baseline import train
    from baselines.training.machine import Machine
    from scenegen.common.records import check, from_json

    machine, arguments = Machine(device, minutes=minutes), set(home.options)
    names = {field.name for field in fields(home.settings)}
    if labels is not None and "labels" not in arguments:
        raise click.UsageError(f"--labels: {name} has no such setting")
    others = sorted((names | arguments) - options.keys())
    for key, value in named_once(settings).items():
        if key not in others:
            raise click.UsageError(f"--set: found {key!r:.40}, expected one of {', '.join(others)}")
        if key in arguments:
            check(isinstance(value, str), key, repr(value), "a text")
        chosen[key] = value
    how = {key: chosen.pop(key) for key in arguments & chosen.keys()}
    made = from_json(home.settings, json.dumps(chosen), "settings")
    text = ""
    opened = training_data((*data, *more), stream, allow_test_set)
    with opened as files, shown_training(out, machine.every) as show:

        def remember(done: int, total: int, numbers: Mapping[str, float]) -> None:
            nonlocal text
            text = ", ".join(f"{key} {value:.3g}" for key, value in numbers.items())
            show(done, total, numbers)

        weights = train(home, files, out, made, machine, resume=resume, progress=remember, **how)
    reached = f" ({text})" if text else ""
    use = f"bench baseline {name} --weights {shlex.quote(str(weights))} --data ..."
    print_line(f"{weights}: {name} trained on {files.where}{reached}; now `{use}`")


def _baseline(name: str) -> "Baseline":
    """Return a trained baseline. Raises UserError where torch is missing."""
    needs_torch(name, ("torch", "safetensors"))
    home: Baseline = import_module(f"baselines.{HOMES[name][0]}").BASELINE
    return home


@click.command(epilog=f"{EXAMPLE}bench probe hf:facebook/dinov2-base --data iqtt --out dinov2")
@click.argument("model", metavar="hf:NAME")
@click.option("--data", type=InputPath(), required=True, help="Folder of a split, with answers.")
@click.option("--out", type=OutputFolder(), required=True, help="Folder to write, a new one.")
@click.option("--device", default="cpu", show_default=True, help="Such as cuda.")
@click.option(
    "--batch", type=click.IntRange(1, 4096), default=8, show_default=True,
    help="Questions at a time.",
)  # fmt: skip
def probe(model: str, data: str, out: str, device: str, batch: int) -> None:
    """Ask every layer of an encoder which pictures show one shape.

    The answer whose features have the greatest cosine with the reference's is taken; nothing is
    learned. The folder gets answers and scores of each layer, and a curve, layers.png.
    """
    needs_torch("bench probe", ("torch", "transformers"))
    from baselines import features
    from iqtt.files.reader import open_questions
    from scenegen.common.text_table import aligned, number, with_interval

    if not model.startswith(features.PREFIX):
        raise click.BadParameter(f"found {model!r:.60}, expected hf:NAME", param_hint="MODEL")
    with open_questions(features.split_paths(data)[0]) as questions:
        count = len(questions)
    with progress_bar(count, "question") as bar:
        scores = features.probe(model, data, out, device=device, batch=batch, progress=bar.update)
    features.draw(scores, Path(out) / "layers.png")
    kinds = list(features.accuracies(scores[0]))
    floors = scores[0].question_floors
    rows = [["layer", *kinds]]
    for i, layer in enumerate(scores):
        values = features.accuracies(layer).values()
        rows.append([str(i), *(" ".join(with_interval(v.value, v.low, v.high)) for v in values)])
    rows.append(["floor", *(number(floors[k].accuracy) if k in floors else "" for k in kinds)])
    for line in aligned(rows):
        print_line(line)
    print_line(f"{out}: answers and scores of {len(scores)} layers, layers.png")


COMMANDS = (baseline, train_baseline, probe)

"""`bench baseline` and `bench train`: each reads its options and makes one library call.

Heavy imports happen inside the commands, so that `--help` is quick and works without torch.
"""

import json
import shlex
from collections.abc import Iterable, Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from baselines.pix2shape.commands import (
    ALLOW_TEST_SET,
    DEVICE,
    MINUTES,
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


class Named(NamedTuple):
    """A baseline of `bench baseline NAME`: its task, what it is, and the options that it has.

    Attributes:
        home: of one with weights, the module of its `BASELINE`; "pix2shape" for the reference.
        needs, takes: options that it cannot do without, and further ones, besides --weights.
    """

    task: str
    text: str
    home: str = ""
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


ROOMS, QUESTIONS = "rooms", "questions"
CUBES = f"{QUESTIONS} about cubes"
BOTH, TRAIN, LABELS = f"{ROOMS} and {CUBES}", ("train",), ("train", "labels")
# fmt: off
ALL = {
    "constant": Named(ROOMS, "a constant depth, the mean over the images of --train", needs=TRAIN),
    "mean-depth": Named(ROOMS, "the mean depth of --train at each pixel", needs=TRAIN),
    "empty-room": Named(ROOMS, "ground-truth walls and ground, no objects"),
    "cut-out": Named(ROOMS, "flat objects, with the true mask and distance of each object"),
    "picture-outline": Named(ROOMS, "a foreground mask from the image, at a constant height"),
    "balls": Named(ROOMS, "a sphere in place of each connected part of the foreground mask"),
    "outline-regression": Named(ROOMS, "a foreground mask, with heights from a regression",
                                needs=TRAIN),
    "outline-relief": Named(ROOMS, "a foreground mask, with heights from trees", needs=TRAIN),
    "nearest": Named(ROOMS, "the height map of the most similar image of --train", needs=TRAIN),
    "oracle": Named(ROOMS, "the ground truth; its score is perfect"),
    "chance": Named(QUESTIONS, "random options"),
    "oracle-warp": Named(QUESTIONS, "the true depth of each room, warped into the other camera"),
    "cubes": Named(CUBES, "reconstructs the 3D cubes of an image, without learning"),
    "outline": Named(QUESTIONS, "selects the most similar silhouette, without labels or 3D"),
    "features": Named(QUESTIONS, "features of a frozen encoder, from --features",
                      needs=("features",), takes=("train_features", *LABELS)),
    "outline-trees": Named(QUESTIONS, "trees on silhouette features", needs=TRAIN, takes=LABELS),
    "pix2shape": Named(BOTH, "Pix2Shape, trained with the losses of the paper", "pix2shape"),
    "pix2shape-compact": Named(BOTH, "Pix2Shape, trained with other losses", "pix2shape"),
    "pix2shape-rays": Named(ROOMS, "Pix2Shape with true walls as input, trained on several views",
                            "pix2shape"),
    "pix2shape-views": Named(CUBES, "Pix2Shape with a separate encoder", "pix2shape"),
    "cnn": Named(QUESTIONS, "ResNets and a softmax over the options", "resnets.cnn"),
    "depth-completed": Named(ROOMS, "a network that completes the depth of the first view",
                             "relief.depth_completed"),
    "depth-match": Named(CUBES, "depth from a network, rotated until two views agree",
                         "depth_match.training"),
    "depth-supervised": Named(ROOMS, "a network trained with ground-truth depth",
                              "relief.depth_supervised"),
    "ptn": Named(BOTH, "voxels, trained with silhouettes", "ptn.training"),
    "rezende": Named(CUBES, "meshes, trained through a non-differentiable renderer",
                     "rezende.training"),
    "siamese": Named(QUESTIONS, "a ResNet; selects the option with the most similar features",
                     "resnets.siamese"),
    "solid-supervised": Named(ROOMS, "a network that predicts layers from true masks and depth",
                              "relief.solid_supervised"),
    "view-pairs": Named(ROOMS, "a network trained with pairs of images, without depth",
                        "relief.view_pairs"),
}
# fmt: on
REFERENCE = "pix2shape"
HOMES = {name: it.home for name, it in ALL.items() if it.home not in ("", REFERENCE)}


def _listed(names: Iterable[str]) -> str:
    wide = max(map(len, names))
    lines = (f"  {name:{wide}}  {ALL[name].task}: {ALL[name].text}" for name in names)
    return "\n".join(("\b", "Baselines:", *lines, "", ""))


@click.command(
    epilog=f"{_listed(ALL)}{EXAMPLE}bench baseline empty-room --data rooms.h5 --out empty-room.h5"
)
@click.argument("name", type=click.Choice(list(ALL)), metavar="NAME")
@click.option(
    "--data", type=InputPath(), required=True, help="File of rooms or questions to predict."
)
@click.option(
    "--train",
    type=InputPath(),
    help="Training file. The baselines constant, mean-depth, nearest, outline-regression and"
    " outline-relief need rooms. outline-trees and features use questions.",
)
@click.option(
    "--labels",
    type=click.IntRange(1, LARGEST),
    help="Number of labelled questions of --train that outline-trees and features use [default:"
    " all].",
)
@click.option(
    "--features",
    type=InputPath(),
    help="Input of the baseline `features`: a .npy file of shape (Q, 1 + K, D). For each of the Q"
    " questions of --data, the file has D features of the reference and of each of the K options.",
)
@click.option(
    "--train-features",
    type=InputPath(),
    help="Features of the labelled questions of --train, in the format of --features.",
)
@ALLOW_TEST_SET
@SUBMISSION
@click.option(
    "--seed",
    type=click.IntRange(0, LARGEST),
    default=0,
    show_default=True,
    help="Random seed of the baseline `chance`.",
)
@click.option(
    "--weights",
    type=WEIGHTS_PATH,
    help="Weights of a trained baseline: a .safetensors file. The pix2shape baselines also accept"
    " the name of bundled weights [default: the bundled weights for this type of data].",
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
    """Run a baseline on rooms or questions, and write its predictions."""
    from baselines.training.data import refuse_test_set
    from scenegen.files.sets.shards import OpenFile

    if train is not None and not allow_test_set:
        with OpenFile(train, "rooms or question file") as opened:
            refuse_test_set(opened)
    _check_task(name, data)
    given = {"weights": weights, "train": train, "labels": labels, "features": features}
    _check_options(name, {**given, "train_features": train_features})
    method = name
    if ALL[name].home == REFERENCE:
        used = predict_to(out, weights, data, method=name, overwrite=overwrite)
        method += f", weights {used}"
    elif name == "chance":
        from baselines.trivial import write_chance

        write_chance(data, out, seed, overwrite)
    else:
        with shown_rows() as show:
            how: dict[str, Any] = {"overwrite": overwrite, "progress": show}
            if name in HOMES:
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
    print_line(f"{out}: {method}, on {data}")
    print_line(how_to_score(out, data))


def _check_options(name: str, given: Mapping[str, Any]) -> None:
    """Raise UsageError for an option that a baseline does not have, or lacks."""
    named = ALL[name]
    has = (*named.needs, *named.takes, *["weights"] * bool(named.home))
    for option, value in given.items():
        flag = f"--{option.replace('_', '-')}"
        if value is not None and option not in has:
            raise click.UsageError(f"{flag}: {name} takes none")
        if value is None and option in named.needs:
            raise click.UsageError(f"{flag}: {name} needs it")


def _check_task(name: str, data: str) -> None:
    """Raise UsageError for questions given to a baseline of rooms, or rooms to one of questions."""
    from iqtt.perspective.specs import MARK
    from metrics.submissions.layout import DATA_FORMATS
    from scenegen.files.attributes import read_text
    from scenegen.files.sets.shards import OpenFile

    if not Path(data).is_file():
        return  # its reader says so, after what is missing otherwise
    with OpenFile(data, "file of rooms or questions") as opened:
        stored = DATA_FORMATS.get(read_text(opened.file, "format", data) or "", ALL[name].task)
        of_rooms = stored == QUESTIONS and MARK in str(opened.file.attrs.get("spec", ""))
    able = [
        other
        for other, it in ALL.items()
        if stored in it.task and not (of_rooms and CUBES in it.task)
    ]
    if name not in able:
        about = "questions about rooms" if of_rooms else stored
        raise click.UsageError(
            f"{name} does not predict {about}, as {data} holds; try {', '.join(able)}"
        )


@click.command(
    name="train",
    epilog=f"{_listed(HOMES)}{EXAMPLE}bench train cnn --data iqtt-split/iqtt-train.h5 --out run",
)
@click.argument("name", type=click.Choice(list(HOMES)), metavar="NAME")
@click.argument("more", type=InputPath(), nargs=-1, metavar="")
@click.option(
    "--data",
    type=InputPath(),
    multiple=True,
    metavar="FILE...",
    help="Training files of rooms or questions. Only depth networks accept several files.",
)
@click.option("--out", type=OutputFolder(), required=True, help="Output folder of the run.")
@click.option(
    "--labels",
    type=click.IntRange(0, LARGEST),
    help="Number of labelled questions to use [default: the setting of the baseline].",
)
@click.option("--seed", type=click.IntRange(0, LARGEST), help="Random seed [default: 0].")
@click.option(
    "--iterations",
    type=click.IntRange(1, LARGEST),
    help="Number of training steps [default: the setting of the baseline].",
)
@click.option(
    "--set",
    "settings",
    type=Setting(),
    multiple=True,
    help="Change another setting of the baseline, such as depth=50. For an unknown setting, the"
    " error message lists all settings. Repeatable.",
)
@click.option("--resume", is_flag=True, help="Resume from the checkpoint in --out.")
@MINUTES
@DEVICE
@ALLOW_TEST_SET
def train_baseline(
    name: str,
    more: tuple[str, ...],
    data: tuple[str, ...],
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
    """Train a baseline, and write its weights and checkpoints to a folder."""
    options = {"labels": labels, "seed": seed, "iterations": iterations}
    chosen = {key: value for key, value in options.items() if value is not None}
    if resume and (chosen or settings):
        message = "--resume uses the --labels, --seed, --iterations and --set of the run"
        raise click.UsageError(f"{message}; leave them out")
    if minutes is not None and iterations is not None:
        raise click.UsageError("--minutes sets --iterations: leave one of them out")
    home = _baseline(name)
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
    opened = training_data((*data, *more), allow_test_set)
    with opened as files, shown_training(out, machine.every) as show:

        def remember(done: int, total: int, numbers: Mapping[str, float]) -> None:
            nonlocal text
            text = ", ".join(f"{key} {value:.3g}" for key, value in numbers.items())
            show(done, total, numbers)

        weights = train(home, files, out, made, machine, resume=resume, progress=remember, **how)
    reached = f" ({text})" if text else ""
    use = f"bench baseline {name} --weights {shlex.quote(str(weights))} --data ..."
    print_line(f"{weights}: {name} trained on {files.where}{reached}")
    print_line(f"now: {use}")


def _baseline(name: str) -> "Baseline":
    """Return a trained baseline. Raises UserError where torch is missing."""
    needs_torch(name, ("torch", "safetensors"))
    home: Baseline = import_module(f"baselines.{HOMES[name]}").BASELINE
    return home


@click.command(epilog=f"{EXAMPLE}bench probe hf:facebook/dinov2-base --data iqtt --out dinov2")
@click.argument("model", metavar="hf:NAME")
@click.option(
    "--data",
    type=InputPath(),
    required=True,
    help="Folder of questions from `iqtt make-split`, with the answer key.",
)
@click.option("--out", type=OutputFolder(), required=True, help="Output folder, which must be new.")
@click.option(
    "--device", default="cpu", show_default=True, help="Device of the encoder, such as cuda."
)
@click.option(
    "--batch", type=click.IntRange(1, 4096), default=8, show_default=True,
    help="Number of questions per batch.",
)  # fmt: skip
def probe(model: str, data: str, out: str, device: str, batch: int) -> None:
    """Measure how well each layer of a frozen encoder recognises a shape from another direction.

    Each layer answers mental-rotation questions, without training. The response of a layer is the
    option whose features have the highest cosine similarity to those of the reference. The output
    folder contains the predictions and scores of each layer. The figure layers.png shows the
    accuracy of each layer.
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
    rows.append(["baseline", *(number(floors[k].accuracy) if k in floors else "" for k in kinds)])
    for line in aligned(rows):
        print_line(line)
    print_line(f"{out}: predictions and scores of {len(scores)} layers, layers.png")


COMMANDS = (baseline, train_baseline, probe)

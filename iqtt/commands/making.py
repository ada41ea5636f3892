"""The `iqtt` commands that make files of questions: splits, and one file of shards.

They parse options, call the library once, and print. Heavy modules are imported inside.
"""

import time
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import click

from iqtt.questions.kinds import DISTRACTORS, QUESTION_KINDS, ROOM_KINDS
from scenegen.command_line import groups, options, output
from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import Color, Range, Renamed
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import (
    InputPath,
    NewHdf5,
    OutputFolder,
    refuse_command_inputs,
)

KNOWN_SEED = (
    "note: anyone who knows the seed can recreate the answer key. For a private test set, run"
    " `openssl rand -hex 32 > secret.txt` and pass --secret-seed secret.txt."
)


def _with_answers(path: Path) -> list[Path]:
    """Return the paths of the questions and of the answer key, given one of the two."""
    questions = path.stem.removesuffix("-answers")
    return [path.with_name(f"{stem}{path.suffix}") for stem in (questions, f"{questions}-answers")]


QUESTIONS = InputPath(within=(".h5",), beside=_with_answers)
option = partial(click.option, show_default=True)


@click.command(
    "make-split", epilog=f"{EXAMPLE}iqtt make-split --out iqtt-split --preset small --seed 1"
)
@option(
    "--out",
    type=OutputFolder(),
    default="iqtt-split",
    help="Output folder, or a URL such as s3://bucket/iqtt. A split has four files:"
    " training, validation, test, and the answer key of the test.",
)
@option(
    "--preset",
    type=click.Choice(["small", "v2", "paper", "suite", "perspective", "perspective-suite"]),
    default="small",
    help="Type and number of questions. small: 1,000 training questions (100 of them labelled), 200"
    " for validation, 200 for testing; v2: numbers of the released data, images in float32; paper:"
    " numbers of the Pix2Shape paper; suite: a folder for each distractor type, with 5,000 training"
    " questions (1,000 labelled), 500 for validation and 2,000 for testing; perspective: questions"
    " about furnished rooms, 100 for training, 40 for validation and 60 for testing;"
    " perspective-suite: as perspective, with a folder for each distractor type.",
)
@option("--train", type=int, help="Number of training questions, including unlabelled questions.")
@option(
    "--labeled",
    type=int,
    help="Number of labelled training questions [default: the same fraction as in the preset].",
)
@option("--val", type=int, help="Number of validation questions.")
@option("--test", type=int, help="Number of test questions. A separate file has their answer key.")
@options.SEED
@option(
    "--secret-seed",
    type=InputPath(),
    metavar="FILE",
    help="File with the seed of a private test set. The seed is not in the output files.",
)
@option("--cubes", type=Range(int), default="8-11", help="Number of cubes of a shape.")
@option(
    "--shapes",
    type=click.Choice(["chain", "tree"]),
    default="chain",
    help="chain: each shape is a self-avoiding chain of cubes; tree: shapes may also branch.",
)
@option(
    "--distractors",
    type=click.Choice(list(dict.fromkeys((*DISTRACTORS, *ROOM_KINDS)))),
    default="mixed",
    help="Distractor type: what the wrong options show. "
    + "".join(f"{name}: {kind.meaning}; " for name, kind in QUESTION_KINDS.items())
    + "mixed: the type varies between questions. --preset perspective has only mixed and two other"
    " types. " + "; ".join(f"{name}: {kind.meaning}" for name, kind in ROOM_KINDS.items()) + ".",
)
@option(
    "--options",
    "answers",
    cls=Renamed,
    former="--answers",
    type=int,
    default=3,
    help="Number of options per question: 3 or 2. Exactly one option is correct. Questions about"
    " rooms always have 3 options.",
)
@click.option(
    "--angle",
    type=Range(float),
    help="Only with --preset perspective: angle, in degrees, between the view of the reference and"
    " the view of each option [default: 20-120].",
)
@click.option(
    "--objects",
    type=Range(int),
    help="Only with --preset perspective: number of objects in a room [default: 12-40].",
)
@click.option(
    "--object-split",
    type=click.Choice(["all", "train", "val", "test"]),
    help="Only with --preset perspective: split from which objects are sampled [default: all].",
)
@click.option(
    "--spp",
    type=int,
    help="Only with --preset perspective: number of samples per pixel for the colour.",
)
@click.option(
    "--denoise/--no-denoise",
    default=None,
    help="Only with --preset perspective: denoise the images [default: if the extra `denoise` is"
    " installed].",
)
@option(
    "--min-angle",
    "min_angle_degrees",
    type=float,
    default=30,
    help="Minimum rotation, in degrees, between the view of the reference and the view of each"
    " option. It is also the minimum between two views of the same shape.",
)
@option(
    "--min-sight-angle",
    "min_sight_angle_degrees",
    type=float,
    help="Minimum angle, in degrees, between the viewing direction of the reference and that of"
    " each option. If two directions are close or opposite, silhouettes are similar [default: 40; 0"
    " with v2 and paper].",
)
@option(
    "--min-cube-pixels",
    type=int,
    help="Minimum number of visible pixels of each cube [default: 30 at --size 128 and --max-radius"
    " 3.5].",
)
@option(
    "--max-radius",
    type=float,
    help="Maximum radius of a shape. The unit is the edge of a cube [default: 3.5].",
)
@options.SIZE
@option("--background", type=Color(), default="white", help="Background colour.")
@option("--lights", type=Range(int), default="2", help="Number of lights.")
@option(
    "--image-dtype",
    type=click.Choice(["uint8", "float16", "float32"]),
    help="Data type of the stored radiance [default: uint8; float32 with --preset v2].",
)
@option("--with-depth", is_flag=True, help="Also store planar depth.")
@options.COMPRESSION
@option(
    "--batch",
    type=click.IntRange(1, 4096),
    default=64,
    help="Number of questions that a process renders at once.",
)
@options.WORKERS
@option(
    "--shard-size",
    type=int,
    default=10_000,
    help="Maximum number of questions per file. Larger files are split into shards. To read all"
    " shards, open the file without a shard number in its name.",
)
@options.SCHEDULER
@options.DEVICE
@options.OVERWRITE
def make_split(
    out: str,
    preset: str,
    size: tuple[int, int],
    batch: int,
    workers: int,
    shard_size: int,
    scheduler: str | None,
    device: str,
    compression: str,
    overwrite: bool,
    secret_seed: str | None,
    **settings: Any,
) -> None:
    """Make mental-rotation questions for training, validation and testing.

    Each question has a reference image and several option images. One option shows the shape of the
    reference. Every image shows all cubes of its shape. Training, validation and test have no
    shape in common, even as a mirror image. If a file has several shards, an interrupted run can be
    resumed: run the same command again.
    """
    from iqtt.files import make
    from iqtt.files.split import ALL_FILES
    from iqtt.perspective import specs as rooms
    from iqtt.questions import specs
    from scenegen.commands.making import with_denoiser
    from scenegen.common.errors import SpecError
    from scenegen.files.places import as_place
    from scenegen.rendering.sameness import renderer_identity

    of_rooms, suite = preset in rooms.PRESETS, preset.endswith("suite")
    context, default = click.get_current_context(), click.core.ParameterSource.DEFAULT
    given = {x for x in context.params if context.get_parameter_source(x) is not default}
    kind = rooms.PerspectiveSpec if of_rooms else specs.SplitSpec
    known = {field.name for field in fields(kind)}
    _refuse_others(given & settings.keys(), known, preset, of_rooms)
    if secret_seed is not None and "seed" in given:
        raise SpecError("--secret-seed", "--seed is given as well", hint="pass only one of them")
    chosen = {x: v for x, v in settings.items() if x in known and v is not None}
    if of_rooms:  # other defaults than those of the options
        chosen = {name: value for name, value in chosen.items() if name in given}
    if not of_rooms or "size" in given:
        chosen |= {"height": size[0], "width": size[1]}
    if secret_seed is not None:
        chosen["seed"] = specs.secret_seed(secret_seed)
    spec: specs.QuestionSpec
    if of_rooms:
        spec, notes = with_denoiser(rooms.perspective_spec(preset, **chosen), chosen)
        for line in notes:
            click.echo(line, err=True)
    else:
        spec = specs.preset_spec(preset, **chosen)
    names = list(make.suite_of(spec)) if suite else [""]
    if secret_seed is not None:
        refuse_command_inputs(Path(out) / name / file for name in names for file in ALL_FILES)
    splits = len(names)
    count = splits * (spec.train + spec.val + spec.test)
    started = time.perf_counter()
    with (
        output.on_scheduler(scheduler, workers, partial(renderer_identity, device)) as cluster,
        progress_bar(count, "question") as bar,
    ):
        tally = make.make_split(
            out,
            spec,
            suite=suite,
            batch=batch,
            workers=workers,
            shard_size=shard_size,
            cluster=cluster,
            device=device,
            compression=compression,
            overwrite=overwrite,
            command=groups.creation_command("iqtt"),
            secret=secret_seed is not None,
            progress=bar.update,
        )
    rate = count / (time.perf_counter() - started)
    megabytes = sum(path.stat().st_size for path in as_place(out).rglob("*.h5")) / 1e6
    print_line(
        f"{out}: {f'{splits} splits of ' if suite else ''}{spec.train} + {spec.val} + {spec.test}"
        f" questions ({spec.labeled} of training labelled), {megabytes:.1f} MB,"
        f" {rate:.{0 if rate >= 10 else 2}f} questions/s"
    )
    refused = "rooms were rejected" if of_rooms else "views hid a cube and were rejected"
    print_line(
        f"{out}: {tally.refused / max(1, tally.proposed):.0%} of {tally.proposed} sampled {refused}"
    )
    if spec.test and secret_seed is None:
        click.echo(KNOWN_SEED, err=True)


def _refuse_others(given: set[str], known: set[str], preset: str, of_rooms: bool) -> None:
    """Raise SpecError for a setting that a preset does not have."""
    from scenegen.common.errors import SpecError

    for name in sorted(given):
        flag = {"answers": "options"}.get(name, name.removesuffix("_degrees").replace("_", "-"))
        if name not in known:
            why = "has no effect with" if of_rooms else "is only for"
            raise SpecError(f"--{flag}", f"this option {why} --preset perspective; leave it out")
        if preset.endswith("suite") and name in ("distractors", "answers"):
            raise SpecError(f"--{flag}", f"--preset {preset} decides this; leave it out")


@click.command(epilog=f"{EXAMPLE}iqtt merge iqtt-split/iqtt-train.h5 --out iqtt-train.h5")
@click.argument("file", type=QUESTIONS)
@click.option("--out", type=NewHdf5(), required=True, help="Output file.")
@options.OVERWRITE
def merge(file: str, out: str, overwrite: bool) -> None:
    """Merge the shards of the question file FILE into one file."""
    from iqtt.files.make import merge_questions
    from iqtt.files.reader import open_tables

    tables = open_tables(file)
    count = sum(map(len, tables))
    with tables[0], progress_bar(count, "question") as bar:
        merge_questions(tables, out, overwrite, bar.update)
    print_line(f"{out}: {count} questions, {Path(out).stat().st_size / 1e6:.1f} MB")


COMMANDS = (make_split, merge)

"""Commands that make, merge, show, describe, verify and audit files of questions.

Heavy modules are imported inside the commands, so that `--help` is fast.
"""

import time
from functools import partial
from pathlib import Path
from typing import Any

import click

from scenegen.common import command_line
from scenegen.common.command_line import EXAMPLE, Color, Items, Range, print_line, progress_bar
from scenegen.common.paths import InputPath, OutputFolder, OutputPath, refuse_command_inputs

KNOWN_SEED = (
    "note: anyone who knows the seed can recreate the test answers. For a private test set, run"
    " `openssl rand -hex 32 > secret.txt` and pass --secret-seed secret.txt."
)
SHOWN = 8  # questions that `show` draws by default


def _with_answers(path: Path) -> list[Path]:
    """Return where the questions and the answers lie that belong to one file of either."""
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
    help="Folder for the four files, or a URL such as s3://bucket/iqtt.",
)
@option(
    "--preset",
    type=click.Choice(["small", "v2", "paper", "suite"]),
    default="small",
    help="Numbers of questions. small: 1,000 for training (100 with answers), 200 for validation,"
    " 200 for testing; v2: as in the released data, in float32; paper: as in the paper; suite: a"
    " folder for each kind of questions, 5,000 (1,000), 500 and 2,000 in each.",
)
@option("--train", type=int, help="Number of training questions, with and without answers.")
@option(
    "--labeled",
    type=int,
    help="How many training questions have answers [default: the preset's share].",
)
@option("--val", type=int, help="Number of validation questions.")
@option("--test", type=int, help="Number of test questions; their answers are in a separate file.")
@command_line.SEED
@option(
    "--secret-seed",
    type=InputPath(),
    metavar="FILE",
    help="File whose content is the seed, for a private test set. No file that is written holds the"
    " seed.",
)
@option("--cubes", type=Range(int), default="8-11", help="Number of cubes of a shape.")
@option(
    "--shapes",
    type=click.Choice(["chain", "tree"]),
    default="chain",
    help="chain: self-avoiding chains of cubes; tree: shapes that may branch.",
)
@option(
    "--distractors",
    type=click.Choice(["other", "near", "mirror", "matched", "mirror-pair", "mixed"]),
    default="mixed",
    help="Wrong answers. other: different shapes; near: one cube moved; mirror: a mirror image and"
    " a near shape; matched: different shapes with like outlines; mirror-pair: two views of the"
    " mirror image; mixed: each question one of these.",
)
@option("--answers", type=int, default=3, help="Number of answers, 3 or 2; one of them is right.")
@option(
    "--min-angle",
    "min_angle_degrees",
    type=float,
    default=30,
    help="Smallest rotation between the reference's view and an answer's, and between two views of"
    " one shape, in degrees.",
)
@option(
    "--min-sight-angle",
    "min_sight_angle_degrees",
    type=float,
    help="Smallest angle between the lines of sight of these views, in degrees: nearer views, and"
    " views from behind, have outlines that are alike [default: 40; 0 with v2 and paper].",
)
@option(
    "--min-cube-pixels",
    type=int,
    help="Smallest number of pixels that show a cube [default: 30 at 128x128 and radius 3.5].",
)
@option("--max-radius", type=float, help="Largest radius of a shape, in cube edges [default: 3.5].")
@command_line.SIZE
@option("--background", type=Color(), default="white", help="Background colour.")
@option("--lights", type=Range(int), default="2", help="Number of lights.")
@option(
    "--image-dtype",
    type=click.Choice(["uint8", "float16", "float32"]),
    help="Type of stored radiance [default: uint8; float32 with --preset v2].",
)
@option("--with-depth", is_flag=True, help="Store planar depth as well.")
@command_line.COMPRESSION
@option(
    "--batch",
    type=click.IntRange(1, 4096),
    default=64,
    help="Questions that a process renders at once.",
)
@command_line.WORKERS
@option(
    "--shard-size",
    type=int,
    default=10_000,
    help="Most questions of one file; more go to files beside it, which it shows as one.",
)
@command_line.SCHEDULER
@command_line.DEVICE
@command_line.OVERWRITE
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
    """Make a split of mental-rotation questions for training, validation and testing.

    A question has a reference and answers, one of which shows the same shape. Every cube of a shape
    shows in every picture. No shape, nor its mirror image, is in two of training, validation and
    test, whatever the settings. Where a run with shards was ended, the same command goes on.
    """
    from iqtt.files import make
    from iqtt.files.shards import ALL_FILES
    from iqtt.questions import specs
    from scenegen.common.errors import SpecError
    from scenegen.common.places import as_place
    from scenegen.rendering.sameness import renderer_identity

    suite, context = preset == "suite", click.get_current_context()
    given = click.core.ParameterSource.DEFAULT
    if secret_seed is not None:
        if context.get_parameter_source("seed") is not given:
            raise SpecError("--secret-seed", "--seed as well", "only one of the two")
        folders = [Path(out) / name for name in specs.SUITE] if suite else [Path(out)]
        refuse_command_inputs(folder / name for folder in folders for name in ALL_FILES)
        settings["seed"] = specs.secret_seed(secret_seed)
    for name in ("distractors", "answers") if suite else ():
        if context.get_parameter_source(name) is not given:
            raise SpecError(f"--{name}", "--preset suite as well", "only one of the two")
    chosen = {name: value for name, value in settings.items() if value is not None}
    spec = specs.preset_spec(preset, height=size[0], width=size[1], **chosen)
    splits = len(specs.SUITE) if suite else 1
    count = splits * (spec.train + spec.val + spec.test)
    started = time.perf_counter()
    with (
        command_line.on_scheduler(
            scheduler, workers, partial(renderer_identity, device)
        ) as cluster,
        progress_bar(count, "question") as bar,
    ):
        tally = (make.make_suite if suite else make.make_split)(
            out,
            spec,
            batch=batch,
            workers=workers,
            shard_size=shard_size,
            cluster=cluster,
            device=device,
            compression=compression,
            overwrite=overwrite,
            command=command_line.creation_command("iqtt"),
            secret=secret_seed is not None,
            progress=bar.update,
        )
    seconds = time.perf_counter() - started
    megabytes = sum(path.stat().st_size for path in as_place(out).rglob("*.h5")) / 1e6
    print_line(
        f"{out}: {f'{splits} splits of ' if suite else ''}{spec.train} + {spec.val} + {spec.test}"
        f" questions ({spec.labeled} of training labelled), {megabytes:.1f} MB,"
        f" {count / seconds:.0f} questions/s"
    )
    print_line(
        f"{out}: {tally.refused / max(1, tally.proposed):.0%} of {tally.proposed} proposed views"
        f" hid a cube and were refused"
    )
    if spec.test and secret_seed is None:
        click.echo(KNOWN_SEED, err=True)


@click.command(
    epilog=f"{EXAMPLE}iqtt show iqtt-split/iqtt-val.h5 --items 0-3 --answers --out questions.png"
)
@click.argument("file", type=QUESTIONS)
@option(
    "--out",
    type=OutputPath(),
    default="questions.png",
    help="Picture to write; its suffix names the format.",
)
@option("--items", type=Items(), help="Questions to show [default: the first 8].")
@option("--part", type=click.Choice(["labeled", "unlabeled"]), help="Part of a training file.")
@option(
    "--answers", is_flag=True, help="Mark the right answers, and name the kinds of the wrong ones."
)
@command_line.OVERWRITE
def show(
    file: str,
    out: str,
    items: list[int] | None,
    part: str | None,
    answers: bool,
    overwrite: bool,
) -> None:
    """Draw questions of FILE: the reference on the left, its answers beside it."""
    from iqtt.files.preview import save_sheet
    from iqtt.files.reader import answers_beside, open_questions, parts
    from scenegen.common.errors import SpecError
    from scenegen.rooms.preview import pick_rows

    chosen = part or parts(file)[0]
    beside = answers_beside(file) if answers else None
    with open_questions(file, chosen or None, beside) as questions:
        if answers and not (questions.has_answers or questions.has_truth):
            raise SpecError(file, "no answers, and no file of answers beside it", "answers")
        rows = pick_rows(len(questions), items)[: None if items else SHOWN]
        task = questions.attributes.get("task", "")
        save_sheet([questions[row] for row in rows], answers, out, overwrite, task)
    print_line(f"{out}: {len(rows)} of {file}'s {len(questions)} questions")


@click.command(epilog=f"{EXAMPLE}iqtt info iqtt-split/iqtt-val.h5")
@click.argument("file", type=QUESTIONS)
def info(file: str) -> None:
    """Describe FILE: its questions, settings, versions, fingerprints and sizes."""
    from iqtt.files.info import describe

    click.echo(describe(file))


@click.command(epilog=f"{EXAMPLE}iqtt audit iqtt-split --json audit.json")
@click.argument("splits", nargs=-1, required=True, metavar="SPLIT...", type=QUESTIONS)
@option("--json", "json_path", type=OutputPath(), help="Write all numbers to this JSON file.")
@option("--markdown", is_flag=True, help="Print the tables as Markdown.")
@option(
    "--probed",
    type=click.IntRange(0),
    default=20_000,
    help="Largest number of questions that probes try to guess.",
)
@command_line.SCHEDULER
@command_line.OVERWRITE
@click.pass_context
def audit(
    ctx: click.Context,
    splits: tuple[str, ...],
    json_path: str | None,
    markdown: bool,
    probed: int,
    scheduler: str | None,
    overwrite: bool,
) -> None:
    """Prove that the questions of files or folders are right, and try to guess their answers.

    SPLIT is a question file, a folder of them, also the released ones, or a folder of such folders,
    each of which is then audited alone.

    Proofs recompute what must hold, with code that is independent of the generator. Probes try to
    find the right answers without comparing shapes. The exit code is 1 if a proof
    fails, or if there are no questions.
    """
    from iqtt.audit import report
    from iqtt.audit.audit import audit as audit_files
    from iqtt.audit.audit import question_count, to_json
    from iqtt.audit.table import find_splits
    from scenegen.common.hdf5.row_file import program_version
    from scenegen.common.new_file import check_writable, write_text

    if json_path:
        check_writable(Path(json_path), overwrite)
    groups = find_splits(splits)
    with (
        command_line.on_scheduler(scheduler, 0, program_version) as cluster,
        progress_bar(sum(map(question_count, groups)), "question") as bar,
    ):
        found = [
            audit_files(group, probed=probed, progress=bar.update, cluster=cluster)
            for group in groups
        ]
    if json_path:
        write_text(json_path, to_json(found), overwrite)
    for group, one in zip(groups, found, strict=True):
        if len(groups) > 1:
            click.echo(f"{'## ' if markdown else ''}{', '.join(map(str, group))}\n")
        click.echo(report.markdown(one) if markdown else report.table(one))
    ctx.exit(0 if all(one.passed for one in found) else 1)


@click.command(epilog=f"{EXAMPLE}iqtt merge iqtt-split/iqtt-train.h5 --out iqtt-train.h5")
@click.argument("file", type=QUESTIONS)
@click.option("--out", type=OutputPath(), required=True, help="File to write.")
@command_line.OVERWRITE
def merge(file: str, out: str, overwrite: bool) -> None:
    """Make one file of questions that were written to several."""
    from iqtt.audit.table import find_tables
    from iqtt.files.merge import merge_questions

    with progress_bar(sum(one.count for one in find_tables([file])), "question") as bar:
        count = merge_questions(file, out, overwrite, bar.update)
    print_line(f"{out}: {count} questions, {Path(out).stat().st_size / 1e6:.1f} MB")


@click.command(epilog=f"{EXAMPLE}iqtt verify iqtt-split --items 20")
@click.argument("folder", type=InputPath(within=(".h5",)))
@option(
    "--items",
    type=click.IntRange(0),
    default=8,
    help="Questions of each part to make again from the seed.",
)
@option(
    "--secret-seed",
    type=InputPath(),
    metavar="FILE",
    help="File whose content is the seed of a private test set, which the files do not tell.",
)
@command_line.DEVICE
@click.pass_context
def verify(
    ctx: click.Context, folder: str, items: int, secret_seed: str | None, device: str
) -> None:
    """Check all files of a split in FOLDER, and make some questions again from the seed.

    With a manifest the SHA-256 of every file is checked, and that every question is there once.
    Exits with 1 if a check fails. `iqtt audit` proves that the answers are right.
    """
    from iqtt.audit.table import find_tables
    from iqtt.files.verify import verify_split
    from iqtt.questions.specs import secret_seed as read_seed

    seed = None if secret_seed is None else read_seed(secret_seed)
    with progress_bar(sum(one.count for one in find_tables([folder])), "question") as bar:
        checks = verify_split(folder, items, device, seed, bar.update)
    for check in checks:
        print_line(f"{'ok  ' if check.ok else 'FAIL'}  {check.name:26} {check.detail}")
    failed = sum(not check.ok for check in checks)
    print_line(f"{folder}: {f'{failed} of {len(checks)} checks failed' if failed else 'verified'}")
    ctx.exit(1 if failed else 0)


COMMANDS = (make_split, merge, show, info, verify, audit)

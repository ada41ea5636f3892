"""The `iqtt` commands: parse, one library call, print. Heavy imports happen inside them."""

import sys
import time
from pathlib import Path
from typing import Any

import click

from scenegen.common.command_line import (
    COMPRESSION,
    DEVICE,
    IMAGE_DTYPE,
    OVERWRITE,
    SEED,
    SIZE,
    Color,
    Items,
    Range,
    progress_bar,
)

SHOWN = 8  # questions that `show` draws unless told which


@click.command("make-split")
@click.option("--out", default="iqtt-split", show_default=True, help="Folder to write.")
@click.option(
    "--preset",
    type=click.Choice(["small", "v2", "paper"]),
    default="small",
    show_default=True,
    help="Numbers of questions: 1,000 (100 labelled) + 200 + 200; those of the released set;"
    " those of the paper.",
)
@click.option("--train", type=int, help="Training questions, labelled ones included.")
@click.option("--labeled", type=int, help="Training questions with answers [default: as preset].")
@click.option("--val", type=int, help="Validation questions.")
@click.option("--test", type=int, help="Test questions; their answers get a file of their own.")
@SEED
@click.option(
    "--cubes", type=Range(int), default="5-11", show_default=True, help="Cubes of a shape."
)
@click.option(
    "--shapes",
    type=click.Choice(["chain", "tree"]),
    default="chain",
    show_default=True,
    help="Chains of cubes, or shapes that may branch.",
)
@click.option(
    "--distractors",
    type=click.Choice(["other", "near", "mirror", "mixed"]),
    default="mixed",
    show_default=True,
    help="Wrong answers: other shapes, one cube moved, mirror images, or each at times.",
)
@click.option(
    "--min-angle",
    "min_angle_degrees",
    type=float,
    default=30,
    show_default=True,
    help="Least rotation from the reference's view to an answer's, degrees.",
)
@click.option(
    "--min-cube-pixels",
    type=int,
    help="Pixels every cube shows [default: 12 at 128x128, radius 3.5].",
)
@click.option("--max-radius", type=float, help="Of a shape, cube edges [default: 3.5].")
@SIZE
@click.option("--background", type=Color(), default="white", show_default=True, help="Radiance.")
@click.option("--lights", type=Range(int), default="2", show_default=True, help="Lights an image.")
@IMAGE_DTYPE
@click.option("--with-depth", is_flag=True, help="Store planar depth too.")
@COMPRESSION
@click.option("--batch", type=click.IntRange(1), default=64, show_default=True, help="Questions.")
@DEVICE
@OVERWRITE
def make_split(
    out: str,
    preset: str,
    size: tuple[int, int],
    batch: int,
    device: str,
    compression: str,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Write mental-rotation questions: a reference image, and three answers of which one is right.

    Training, validation and test files share no shape, and no mirror image of one.
    """
    from iqtt.files import make as split
    from iqtt.questions.specs import preset_spec

    chosen = {name: value for name, value in settings.items() if value is not None}
    spec = preset_spec(preset, height=size[0], width=size[1], **chosen)
    count = spec.train + spec.val + spec.test
    started = time.perf_counter()
    with progress_bar(count, "question") as bar:
        tally = split.make_split(
            out,
            spec,
            batch=batch,
            device=device,
            compression=compression,
            overwrite=overwrite,
            command=" ".join(["iqtt", *sys.argv[1:]]),
            progress=bar.update,
        )
    seconds = time.perf_counter() - started
    megabytes = sum(path.stat().st_size for path in Path(out).iterdir()) / 1e6
    click.echo(
        f"{out}: {spec.train} + {spec.val} + {spec.test} questions ({spec.labeled} of training"
        f" labelled), {megabytes:.1f} MB, {4 * count / seconds:.0f} images/s"
    )
    click.echo(
        f"{out}: {tally.refused / max(1, tally.proposed):.0%} of {tally.proposed} proposed views"
        f" hid a cube and were refused"
    )


@click.command()
@click.argument("file")
@click.option("--out", default="questions.png", show_default=True, help="Picture to write.")
@click.option("--items", type=Items(), help="Questions to show [default: the first 8].")
@click.option("--part", type=click.Choice(["labeled", "unlabeled"]), help="Of a training file.")
@click.option("--answers", is_flag=True, help="Mark the right answers.")
def show(file: str, out: str, items: list[int] | None, part: str | None, answers: bool) -> None:
    """Draw questions as a person would read them."""
    from iqtt.files.reader import answers_beside, open_questions, parts
    from iqtt.files.show import save_sheet
    from scenegen.common.errors import SpecError
    from scenegen.rooms.preview import pick_rows

    chosen = part or parts(file)[0]
    beside = answers_beside(file) if answers else None
    with open_questions(file, chosen or None, beside) as questions:
        if answers and not (questions.has_answers or questions.has_truth):
            raise SpecError(f"{file}: holds no answers, and no answers file lies beside it")
        rows = pick_rows(len(questions), items)[: None if items else SHOWN]
        save_sheet([questions[row] for row in rows], answers, out)
    click.echo(f"{out}: {len(rows)} of {file}'s {len(questions)} questions")


@click.command()
@click.argument("file")
def info(file: str) -> None:
    """Say what is in a file: counts, shapes, distractors, spec, sizes, versions, fingerprints."""
    from iqtt.files.info import describe

    click.echo(describe(file))


@click.command()
@click.argument("splits", nargs=-1, required=True, metavar="SPLIT...")
@click.option("--json", "json_path", help="Write all numbers to this file.")
@click.option("--markdown", is_flag=True, help="Print the tables as Markdown.")
@click.option(
    "--probed",
    type=click.IntRange(0),
    default=20_000,
    show_default=True,
    help="Most questions that the shortcuts are tried on.",
)
@OVERWRITE
@click.pass_context
def audit(
    ctx: click.Context,
    splits: tuple[str, ...],
    json_path: str | None,
    markdown: bool,
    probed: int,
    overwrite: bool,
) -> None:
    """Prove that every question of some folders or files is right, and try to answer them without
    looking at shapes. Exits with 1 if a proof fails.
    """
    from iqtt.audit import audit as audits
    from iqtt.audit import report as audit_report
    from scenegen.common.new_file import check_writable, written_beside

    if json_path:
        check_writable(Path(json_path), overwrite)
    count = audits.question_count(splits)
    with progress_bar(count, "question") as bar:
        found = audits.audit(splits, probed=probed, progress=bar.update)
    click.echo(audit_report.markdown(found) if markdown else audit_report.table(found))
    if json_path:
        with written_beside(json_path, overwrite) as temporary:
            temporary.write_text(found.to_json())
    ctx.exit(0 if found.passed else 1)


COMMANDS = (make_split, show, info, audit)

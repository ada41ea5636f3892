"""Commands that show, describe, verify and audit files of questions.

Heavy modules are imported inside the commands, so that `--help` is fast.
"""

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import click

from iqtt.commands.making import QUESTIONS
from scenegen.command_line import options
from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import Items, Renamed
from scenegen.command_line.output import on_scheduler, print_checks, print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputPath

SHOWN = 8  # questions that `show` draws by default


option = partial(click.option, show_default=True)


@click.command(
    epilog=f"{EXAMPLE}iqtt show iqtt-split/iqtt-val.h5 --items 0-3 --mark-correct --out"
    " questions.png"
)
@click.argument("file", type=QUESTIONS)
@option(
    "--out",
    type=OutputPath(),
    default="questions.png",
    help="Output image. The suffix of its name selects the format.",
)
@option("--items", type=Items(), help="Questions to show [default: the first 8].")
@option(
    "--part", type=click.Choice(["labeled", "unlabeled"]), help="Part of a training file to show."
)
@option(
    "--mark-correct",
    "answers",
    cls=Renamed,
    former="--answers",
    is_flag=True,
    help="Mark the correct option. Label each wrong option with its distractor type.",
)
@options.OVERWRITE
def show(
    file: str,
    out: str,
    items: list[int] | None,
    part: str | None,
    answers: bool,
    overwrite: bool,
) -> None:
    """Draw some questions of FILE: the reference on the left, the options to its right."""
    from iqtt.files.preview import question_sheet
    from iqtt.files.reader import QuestionsFile, answers_beside, open_tables
    from scenegen.common.errors import SpecError
    from scenegen.files.images.pictures import pick_rows, save_picture

    beside, first = answers_beside(file) if answers else None, open_tables(file)[0]
    with first, QuestionsFile(first.opened, part or first.part, beside) as questions:
        if answers and not (questions.has_answers or questions.has_truth):
            raise SpecError(file, "this file has no answer key, nor has its folder")
        rows = pick_rows(len(questions), items, default=SHOWN)
        task = questions.attributes.get("task", "")
        sheet = question_sheet([questions[row] for row in rows], answers, task)
        count = len(questions)
    save_picture(sheet, out, overwrite)
    print_line(f"{out}: {len(rows)} of {count} questions of {file}")


@click.command(epilog=f"{EXAMPLE}iqtt info iqtt-split/iqtt-val.h5")
@click.argument("file", type=QUESTIONS)
def info(file: str) -> None:
    """Print the number of questions, settings, versions, hashes and sizes of FILE."""
    from iqtt.files.info import describe

    click.echo(describe(file))


@click.command(epilog=f"{EXAMPLE}iqtt audit iqtt-split --json audit.json")
@click.argument("splits", nargs=-1, metavar="SPLIT...", type=QUESTIONS)
@click.option(
    "--cubes",
    type=InputPath(),
    metavar="SHAPES.json",
    help="Audit the questions of this JSON file, which has cubes and rotations, instead of SPLIT.",
)
@option("--json", "json_path", type=OutputPath(), help="Write all results to this JSON file.")
@option("--markdown", is_flag=True, help="Print the tables as Markdown.")
@option(
    "--classifier-questions",
    "probed",
    cls=Renamed,
    former="--probed",
    type=click.IntRange(0),
    default=20_000,
    help="Maximum number of questions that the shortcut classifiers use.",
)
@options.SCHEDULER
@options.OVERWRITE
@click.pass_context
def audit(
    ctx: click.Context,
    splits: tuple[str, ...],
    cubes: str | None,
    json_path: str | None,
    markdown: bool,
    probed: int,
    scheduler: str | None,
    overwrite: bool,
) -> None:
    """Check that questions are correct, and search them for shortcuts.

    SPLIT is a question file, a folder of question files, or a folder of such folders. The released
    3D-IQTT files can also be audited.

    Proofs check every property of the questions, with code that is independent of the generator.
    Shortcut classifiers try to select the correct option without comparing shapes. If a proof
    fails, or if there are no questions, the exit code is 1.
    """
    from iqtt.audit import report
    from iqtt.audit.audit import audit as audit_files
    from iqtt.audit.audit import to_json
    from iqtt.audit.table import find_splits, lacking, open_paths
    from scenegen.files.new_file import check_writable, write_text
    from scenegen.files.row_file import program_version

    if json_path:
        check_writable(Path(json_path), overwrite)
    if (cubes is None) == (not splits):
        raise click.UsageError("give SPLIT, or --cubes SHAPES.json")
    if cubes is not None:
        ctx.exit(_audit_cubes(cubes, json_path, overwrite))
    groups = find_splits(splits)
    with on_scheduler(scheduler, 0, program_version) as cluster, ExitStack() as stack:
        opened = [stack.enter_context(open_paths(group)) for group in groups]
        count = sum(len(table) for tables in opened for table in tables.values())
        bar = stack.enter_context(progress_bar(count, "question"))
        how: dict[str, Any] = {"probed": probed, "progress": bar.update, "cluster": cluster}
        found = [
            audit_files(tables, lacking=lacking(group), **how)
            for tables, group in zip(opened, groups, strict=True)
        ]
    if json_path:
        write_text(json_path, to_json(found), overwrite)
    for group, one in zip(groups, found, strict=True):
        if len(groups) > 1:
            click.echo(f"{'## ' if markdown else ''}{', '.join(map(str, group))}\n")
        click.echo(report.text(one, markdown))
    ctx.exit(0 if all(one.passed for one in found) else 1)


def _audit_cubes(cubes: str, json_path: str | None, overwrite: bool) -> int:
    """Print what is wrong with questions of other people; return the exit code."""
    import json

    from iqtt.audit import strangers
    from scenegen.files.new_file import write_text

    with progress_bar(None, "question") as bar:
        audited = strangers.audit_strangers(cubes, bar.update)
    if json_path:
        write_text(json_path, json.dumps(audited, indent=1) + "\n", overwrite)
    for rule, count in audited["counts"].items():
        where = next(
            (f"; question {i}: {f[rule]}" for i, f in enumerate(audited["faults"]) if rule in f), ""
        )
        share = f"{count} ({count / audited['questions']:.1%})"
        click.echo(f"  {'FAIL' if count else 'ok  '} {rule}: {share}{where}")
    keys = ", ".join(f"{key}: {count}" for key, count in audited["key_counts"].items())
    click.echo(f"\n  {audited['questions']} questions, keys {keys}")
    return 0 if audited["passed"] else 1


@click.command(epilog=f"{EXAMPLE}iqtt floors iqtt-split/iqtt-test.h5 --out floors.json")
@click.argument("splits", nargs=-1, required=True, metavar="SPLIT.h5...", type=QUESTIONS)
@option(
    "--out",
    type=OutputPath(),
    default="floors.json",
    help="Output file, which gets the baseline accuracies.",
)
@option(
    "--questions",
    type=click.IntRange(200, 1_000_000),
    default=6_000,
    help="Number of questions per distractor type.",
)
@options.WORKERS
@options.DEVICE
@options.OVERWRITE
def floors(
    splits: tuple[str, ...], out: str, questions: int, workers: int, device: str, overwrite: bool
) -> None:
    """Measure 2D-only baselines for questions with the settings of SPLIT.h5.

    The command makes new questions with these settings, about shapes of the training split. This
    takes minutes. `iqtt audit` has shortcut classifiers that use only images. Each of them answers
    the new questions, and the best accuracy is the baseline. If questions are about rooms, the
    classifiers also get the true masks of objects. To use the baselines, pass the output file to
    `bench score --baselines`. For the presets, this package already contains the baselines.
    """
    from iqtt.files.reader import open_tables
    from iqtt.floor_probes import floor_specs, measure_floors
    from iqtt.floors import to_json
    from scenegen.common.errors import SpecError
    from scenegen.files.new_file import check_writable, write_text

    check_writable(Path(out), overwrite)
    specs: list[Any] = []
    for path in splits:
        with open_tables(path)[0] as table:
            if table.spec is None:
                raise SpecError(path, "a file without settings", "one that iqtt make-split wrote")
            specs.append(table.spec)
    with progress_bar(2 * questions * len(floor_specs(specs, questions)), "question") as bar:
        found = measure_floors(
            specs, questions, workers=workers, device=device, progress=bar.update
        )
    write_text(out, to_json([measured for measured, _ in found]), overwrite)
    for measured, probes in found:
        for floor, tried in zip(measured.floors, probes, strict=True):
            best = sorted(tried, key=lambda probe: -probe.accuracy)[:3]
            shown = "; ".join(f"{p.statistic}, {p.rule} {p.accuracy:.3f}" for p in best)
            print_line(
                f"{floor.kind}: {floor.accuracy:.3f}, {floor.probe}; best classifiers: {shown}"
            )


@click.command(epilog=f"{EXAMPLE}iqtt verify iqtt-split --items 20")
@click.argument("folder", type=InputPath(within=(".h5",)))
@option(
    "--items",
    type=click.IntRange(0),
    default=8,
    help="Number of questions to make again from the seed, in each part of the split.",
)
@option(
    "--secret-seed",
    type=InputPath(),
    metavar="FILE",
    help="File with the seed of a private test set.",
)
@options.DEVICE
@click.pass_context
def verify(
    ctx: click.Context, folder: str, items: int, secret_seed: str | None, device: str
) -> None:
    """Check all files of the split in FOLDER, and make some questions again from the seed.

    If a check fails, the exit code is 1. To check the answer key, run `iqtt audit`.
    """
    from iqtt.files.verify import verify_split
    from iqtt.questions.specs import secret_seed as read_seed

    seed = None if secret_seed is None else read_seed(secret_seed)
    checks = verify_split(folder, items, device, seed)
    ctx.exit(print_checks(folder, checks))


COMMANDS = (show, info, verify, audit, floors)

"""`bench sets`: the named benchmarks, and making them."""

import shlex
import sys
from pathlib import Path
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import WORKERS
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import OutputFolder


@click.group("sets", invoke_without_command=True, epilog=EXAMPLE + "bench sets make rooms-1")
@click.pass_context
def sets_command(context: click.Context) -> None:
    """List the named benchmarks, or make one."""
    if context.invoked_subcommand is None:
        _list()


def _list() -> None:
    from metrics.scoring import known_tests

    for name, files in known_tests.sets().items():
        print_line(f"{name}: {files[0].purpose}")
        print_line(f"  {files[0].command}")
        for test in files:
            items = "questions" if test.task == "iqtt" else "images"
            print_line(f"  {test.digest}  {test.rows:,} {items}, {test.file}")
    print_line("superseded, made by older versions with different content:")
    for test in known_tests.KNOWN_TESTS:
        if test.superseded:
            print_line(f"  {test.digest}  {test.rows:,} items, {test.name}")


@sets_command.command("make", epilog=EXAMPLE + "bench sets make rooms-1 --out sets")
@click.argument("name")
@click.option(
    "--out", type=OutputFolder(), default="sets", show_default=True, help="Output folder."
)
@WORKERS
def make(name: str, out: str, workers: int) -> None:
    """Make a named benchmark, and compare its ground truth with the published hash.

    Files that already exist are kept and checked. Re-run the same command to resume an interrupted
    run.
    """
    from metrics.scoring import known_tests
    from scenegen.common.names import check_choice

    sets = known_tests.sets()
    check_choice("benchmark", name, sets)
    folder, files = Path(out), sets[name]
    if not all((folder / test.file).exists() for test in files):
        folder.mkdir(parents=True, exist_ok=True)
        whole = folder / files[0].file if len(files) == 1 else folder
        words = [*shlex.split(files[0].command), "--out", str(whole), "--workers", str(workers)]
        _run(words)
    wrong = [test.file for test in files if not _is_published(folder, test)]
    if wrong:
        print_line(f"{name}: differs from the published benchmark: {', '.join(wrong)}")
        sys.exit(1)
    print_line(f"{name}: equals the published benchmark")


def _run(words: list[str]) -> Any:
    """Run a command of another group, in this process."""
    from iqtt.commands.making import make_split
    from scenegen.commands.making import render

    typed, sys.argv = sys.argv, words  # files record the command that made them
    try:
        return {"render": render, "make-split": make_split}[words[1]].main(
            words[2:], prog_name=" ".join(words[:2]), standalone_mode=False
        )
    finally:
        sys.argv = typed


def _is_published(folder: Path, test: Any) -> bool:
    """Print how a file compares with the published one; return whether they are equal."""
    from metrics.scoring.truth_digests import file_digests

    truth, pictures, rows = file_digests(folder / test.file, test.task)
    found = {"items": rows, "truth hash": truth, "image hash": pictures}
    published = {"items": test.rows, "truth hash": test.digest, "image hash": test.pictures}
    if not test.pictures:  # path-traced: `scenegen verify` compares them within a tolerance
        del found["image hash"], published["image hash"]
    print_line(f"{folder / test.file}:")
    for name, value in found.items():
        same = value == published[name]
        outcome = "as published" if same else f"published {published[name]}"
        print_line(f"  {name} {value}, {outcome}")
    return found == published


COMMANDS = (sets_command,)

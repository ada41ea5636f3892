"""What commands show: lines, progress, and the notes of a scheduler."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from scenegen.command_line.streams import for_progress_bars
from scenegen.common.text_table import printable

if TYPE_CHECKING:
    from scenegen.files.sets.cluster import Cluster, Versions
    from scenegen.files.verify import Check


def print_line(text: str, err: bool = False) -> None:
    """Print one line, whatever names from files it holds."""
    click.echo(printable(text), err=err)


def line_width() -> int:
    """Return the characters of a line of the terminal; 100 where there is none."""
    return shutil.get_terminal_size((100, 24)).columns


def print_checks(what: str, checks: "Sequence[Check]") -> int:
    """Print the outcome of checks of a file or folder, then each check; return the exit code."""
    failed = sum(not check.ok for check in checks)
    outcome = f"{failed} of {len(checks)} checks failed" if failed else "verified"
    print_line(f"{what}: {outcome}")
    for check in checks:
        print_line(f"{'ok  ' if check.ok else 'FAIL'}  {check.name:26} {check.detail}")
    return 1 if failed else 0


def progress_bar(count: int | None, unit: str) -> Any:
    """Return a progress bar with rate and time left, to be used in a `with`.

    It is shown on standard error where that is a terminal. Its `update` takes the number of items
    done since the last call.
    """
    from tqdm import tqdm

    look = {"unit": unit, "disable": None, "leave": False, "smoothing": 0.1, "dynamic_ncols": True}
    return tqdm(total=count, file=for_progress_bars(), **look)


@contextmanager
def on_scheduler(
    scheduler: str | None, workers: int, versions: "Versions"
) -> Iterator["Cluster | None"]:
    """Connect to the scheduler of an option; None where it was not given.

    Args:
        workers: processes of a local cluster; 0 for one a processor.
        versions: tells what the results depend on.

    Raises as `connected`.
    """
    if scheduler is None:
        yield None
        return
    from scenegen.common.cgroup import processors
    from scenegen.files.sets.cluster import connected

    with connected(
        scheduler, workers or processors(), versions, lambda text: print_line(text, err=True)
    ) as cluster:
        yield cluster

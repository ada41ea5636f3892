"""What commands show: lines, pictures, progress, and the notes of a scheduler."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from scenegen.command_line.paths import refuse_command_inputs
from scenegen.command_line.streams import for_pictures, for_progress_bars
from scenegen.common.text_table import printable

if TYPE_CHECKING:
    from PIL.Image import Image

    from scenegen.files.cluster import Cluster, Versions


def print_line(text: str, err: bool = False) -> None:
    """Print one line, whatever names from files it holds."""
    click.echo(printable(text), err=err)


def show_or_save(
    picture: "Image", show: str, out: str | None, otherwise: str, save: Callable[[str], Any]
) -> str:
    """Show a picture in the terminal, write it, or both; return what to call it.

    Args:
        show: value of the option SHOW.
        out: where to write it, as the user says.
        otherwise: where to write it if it is not shown.
        save: writes it.

    Raises SpecError for kitty's protocol where it would not reach the terminal; as `save`.
    """
    from scenegen.common.errors import SpecError
    from scenegen.common.terminal import abilities

    protocol = abilities.protocol() if (show, out) == ("auto", None) else show
    shown = protocol in abilities.PROTOCOLS
    if show == "kitty" and sys.stdout.isatty() and abilities.within_another():
        found = "tmux, screen or zellij around it, which do not pass it on"
        raise SpecError("--show kitty", found, "a terminal of its own", "use --out")
    if not shown or out:
        refuse_command_inputs([out or otherwise])
        save(out or otherwise)
    if shown:
        from scenegen.common.terminal.pictures import escapes

        stream = for_pictures()
        stream.write(escapes(picture, str(protocol), abilities.width()) + "\n")
        stream.flush()
    return out or (otherwise if not shown else "shown (--out writes a file)")


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
    from scenegen.files.cluster import connected
    from scenegen.files.pool import processors

    with connected(
        scheduler, workers or processors(), versions, lambda text: print_line(text, err=True)
    ) as cluster:
        yield cluster

"""What all commands share: how errors are shown, types of options, and options by name."""

import importlib.util
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from scenegen.common.paths import InputPath, OutputFolder, refuse_command_inputs
from scenegen.common.signals import ended_by_signals
from scenegen.common.streams import for_pictures, for_progress_bars, robust_streams
from scenegen.common.text_table import printable

if TYPE_CHECKING:
    from PIL.Image import Image

    from scenegen.common.workers.cluster import Cluster, Versions

# An `epilog` is this and a command line. A paragraph that begins with \b keeps its line breaks.
EXAMPLE = "\b\nExample:\n  "
MESH_FILES = (".glb", ".obj", ".off", ".ply", ".stl")
NUMBER = r"[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?"
LONGEST_ERROR = 2000  # characters; what a file holds may be of any length
LARGEST = 2**63 - 1  # whole number that files can hold
MOST_PROCESSES = 1024
WITHOUT_EFFECT = ("--batch", "--workers", "--scheduler")  # they change no byte of what is made
MOST_ITEMS = 1_000_000  # numbers of a range; keeps 0-99999999999 from filling the memory


class PackageCommands(click.Group):
    """A group of the `COMMANDS` of some modules, which are imported when a command is asked for.

    A mistake that the user can mend is shown as one line, and ends with exit code 2.
    """

    def __init__(self, *arguments: Any, modules: tuple[str, ...], **attributes: Any) -> None:
        super().__init__(*arguments, **attributes)
        self.modules = modules

    def list_commands(self, _ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return [command.name for command in self._loaded()]

    def get_command(self, _ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by name."""
        return next((command for command in self._loaded() if command.name == cmd_name), None)

    def main(self, *arguments: Any, **attributes: Any) -> Any:
        """Run a command with streams and signals that keep it from leaving anything half done."""
        with ended_by_signals(), robust_streams():
            return super().main(*arguments, **attributes)

    def make_context(self, *arguments: Any, **attributes: Any) -> click.Context:
        """Read what stands before the command's name; print the help where it is asked for."""
        with _one_line_errors():
            return super().make_context(*arguments, **attributes)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Refuse arguments that no file could hold, before anything is done with them."""
        for text in args:
            if re.search("[\0\ud800-\udfff]", text):
                raise UserError(f"argument {text}: found bytes that are not UTF-8, expected text")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; show what it raises for users, and its warnings, as one line each."""
        warnings.showwarning = _show_warning
        with _one_line_errors(), self._options_named(ctx):
            return super().invoke(ctx)

    @contextmanager
    def _options_named(self, ctx: click.Context) -> Iterator[None]:
        """Let an error about a setting name the option of the command that sets it."""
        try:
            yield
        except ValueError as error:
            from scenegen.common.errors import SceneGenError

            command = self.get_command(ctx, ctx.invoked_subcommand or "")
            options = {name for param in command.params for name in param.opts} if command else ()
            if isinstance(error, SceneGenError):
                option = "--" + re.sub("[ _]", "-", error.where)
                error.where = option if option in options else error.where
            raise

    def _loaded(self) -> list[Any]:
        modules = [importlib.import_module(name) for name in self.modules]
        return [command for module in modules for command in module.COMMANDS]


class UserError(click.ClickException):
    """A mistake that the user can mend; its text is shown as one line."""

    exit_code = 2

    def __init__(self, text: str) -> None:
        line = printable(text)
        if len(line) > LONGEST_ERROR:
            line = f"{line[: LONGEST_ERROR // 2]} ... {line[-LONGEST_ERROR // 2 :]}"
        super().__init__(line)


@contextmanager
def _one_line_errors() -> Iterator[None]:
    """Turn what a user can mend into a UserError."""
    try:
        yield
    except click.UsageError as error:
        line = UserError(" ".join(error.format_message().split())).message
        raise click.UsageError(line, error.ctx) from error
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        raise UserError(f"{where}{error.strerror or error}") from error
    except ImportError as error:
        if "map segment" not in str(error) and "allocate memory" not in str(error):
            raise
        raise UserError(f"not enough memory: {error}") from error
    except MemoryError as error:
        raise UserError(": ".join(filter(None, ("not enough memory", str(error))))) from error
    except ValueError as error:
        from scenegen.common.errors import SceneGenError

        if not isinstance(error, SceneGenError):
            raise
        raise UserError(str(error)) from error


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print_line(f"note: {message}", err=True)


class _Parsed(click.ParamType):  # type: ignore[type-arg]
    """The value of an option that is not one of click's types.

    `_parse` raises ValueError where the text is not what `expected` says. A value that is no text,
    such as a default, passes as it is.
    """

    expected: str

    def _parse(self, text: str) -> Any:
        raise NotImplementedError

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse a text."""
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except ValueError:
            self.fail(f"found {value!r:.60}, expected {self.expected}", param, ctx)


def _matched(pattern: str, text: str) -> re.Match[str]:
    match = re.fullmatch(pattern, text.strip())
    if match is None:
        raise ValueError(text)
    return match


class Range(_Parsed):
    """`3` or `1-3`, as two numbers."""

    name, expected = "N or N-M", "a number or a range such as 1-3"

    def __init__(self, number: Callable[[str], Any]) -> None:
        self.number = number

    def _parse(self, text: str) -> tuple[Any, Any]:
        first, last = _matched(rf"({NUMBER})(?:-({NUMBER}))?", text).groups()
        return self.number(first), self.number(last or first)


class Size(_Parsed):
    """`128` or `96x128`, as (height, width)."""

    name, expected = "N or HxW", "a number such as 128 or HxW such as 96x128"

    def _parse(self, text: str) -> tuple[int, int]:
        height, width = _matched("([0-9]+)(?:x([0-9]+))?", text.lower()).groups()
        return int(height), int(width or height)


class Items(_Parsed):
    """`0,5,7` or `0-7` or both, as a list of numbers."""

    name, expected = "0,5,7 or 0-7", "numbers such as 0,5,7 or rising ranges such as 0-7"

    def _parse(self, text: str) -> list[int]:
        chosen: list[int] = []
        for part in text.split(","):
            match = _matched("([0-9]+)(?:-([0-9]+))?", part)
            first, last = int(match[1]), int(match[2] or match[1])
            if last < first:
                raise ValueError(part)
            chosen.extend(range(first, min(last, first + MOST_ITEMS) + 1))
        return chosen


class Names(_Parsed):
    """`mug,bowl`, as a tuple of texts."""

    name, expected = "NAME,NAME", "names such as mug,bowl"

    def _parse(self, text: str) -> tuple[str, ...]:
        return tuple(part.strip() for part in text.split(","))


class Numbers(_Parsed):
    """`0,5,35`, as a tuple of numbers."""

    name, expected = "N,N", "numbers such as 0,5,35"

    def _parse(self, text: str) -> tuple[float, ...]:
        return tuple(float(_matched(NUMBER, part)[0]) for part in text.split(","))


class Color(_Parsed):
    """`white`, `black`, a grey such as `0.5`, or `R,G,B`, as three numbers."""

    name = "white, black, GREY or R,G,B"
    expected = "white, black, a grey from 0 to 1, or R,G,B"

    def _parse(self, text: str) -> tuple[float, ...]:
        told = {"white": "1", "black": "0"}.get(text.lower(), text)
        channels = tuple(float(_matched(NUMBER, part)[0]) for part in told.split(","))
        if len(channels) not in (1, 3):
            raise ValueError(text)
        return channels if len(channels) == 3 else channels * 3


def needs(who: str, packages: tuple[str, ...], extra: str) -> None:
    """Raise UserError where a package of one of this project's optional extras is missing."""
    missing = ", ".join(name for name in packages if importlib.util.find_spec(name) is None)
    if missing:
        raise UserError(f"{who} needs {missing}: pip install '.[{extra}]'")


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
    """
    from scenegen.common.terminal import abilities

    protocol = abilities.protocol() if (show, out) == ("auto", None) else show
    shown = protocol in abilities.PROTOCOLS
    if show == "kitty" and sys.stdout.isatty() and abilities.within_another():
        raise UserError("--show kitty: tmux, screen and zellij do not pass it on; use --out")
    if not shown or out:
        refuse_command_inputs([out or otherwise])
        save(out or otherwise)
    if shown:
        from scenegen.common.terminal.pictures import escapes

        stream = for_pictures()
        stream.write(escapes(picture, str(protocol), abilities.width()) + "\n")
        stream.flush()
    return out or (otherwise if not shown else "shown (--out writes a file)")


def creation_command(program: str) -> str:
    """Return the command line for a file to record, without options that change no byte."""
    words, recorded = iter(sys.argv[1:]), [program]
    for word in words:
        if word == "--overwrite":
            continue
        if word in WITHOUT_EFFECT:
            next(words, None)
        elif word.partition("=")[0] not in WITHOUT_EFFECT:
            recorded.append(word)
    return " ".join(recorded)


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
    from scenegen.common.workers.cluster import connected
    from scenegen.common.workers.pool import processors

    with connected(
        scheduler, workers or processors(), versions, lambda text: print_line(text, err=True)
    ) as cluster:
        yield cluster


# fmt: off
WORKERS = click.option("--workers", type=click.IntRange(0, 256), default=0,
                       show_default="one a processor, up to 8",
                       help="Processes that render; each takes about 0.4 GiB.")
SCHEDULER = click.option("--scheduler", metavar="ADDRESS",
                         help="Spread the work over a Dask cluster, such as tcp://host:8786; local"
                         " starts one on this machine.")
SHOW = click.option("--show", type=click.Choice(["auto", "kitty", "sixel", "no"]), default="auto",
                    show_default=True,
                    help="Draw the picture in the terminal, in this protocol; auto does so where"
                    " there is no --out and the terminal says that it can.")
OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace existing files.")
DEVICE = click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto",
                      show_default=True,
                      help="Where to render; auto is the CPU, which is slow without LLVM.")
IMAGE_DTYPE = click.option("--image-dtype", type=click.Choice(["uint8", "float16", "float32"]),
                           default="uint8", show_default=True, help="Type of stored radiance.")
COMPRESSION = click.option("--compression", type=click.Choice(["gzip", "lzf", "none"]),
                           default="gzip", show_default=True,
                           help="How images are compressed; only h5py reads lzf.")
SIZE = click.option("--size", type=Size(), default="128", show_default=True,
                    help="Image size in pixels.")
SEED = click.option("--seed", type=int, default=0, show_default=True,
                    help="Seed of every random choice.")
UP = click.option("--up", type=click.Choice(["y", "z"]), default="y", show_default=True,
                  help="Axis that points up in the meshes; in ShapeNet it is y.")
CACHE_DIR = click.option("--cache-dir", type=OutputFolder(),
                         help="Folder for meshes that are ready to render [the user's cache].")
# fmt: on


def MESHES(command: Any) -> Any:  # noqa: N802
    """Add the options that name the folder of meshes that objects are taken from."""
    command = UP(CACHE_DIR(command))  # the last option comes first
    folder = InputPath(within=MESH_FILES)
    text = "Folder with the objects, a sub-folder per class."
    command = click.option("--objects-root", type=folder, help=text)(command)
    text = "Folder of ShapeNetCore 1 or 2 with the objects."
    return click.option("--shapenet-root", type=folder, help=text)(command)

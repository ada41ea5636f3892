"""What the commands share: errors as one line, options' types, and commands loaded when used."""

import importlib
import re
import warnings
from collections.abc import Callable
from typing import Any

import click

NUMBER = r"[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?"
MOST_ITEMS = 1_000_000  # of a range; keeps 0-99999999999 from eating the memory


class PackageCommands(click.Group):
    """The `COMMANDS` of some modules, imported when a command is first asked for.

    What went wrong for a user is shown as one line, and ends with exit code 2.
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

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; errors meant for people become click's own."""
        warnings.showwarning = _show_warning
        try:
            return super().invoke(ctx)
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            raise _failure(f"{where}{error.strerror or error}") from error
        except ValueError as error:
            from scenegen.common.errors import SceneGenError

            if not isinstance(error, SceneGenError):
                raise
            raise _failure(str(error)) from error

    def _loaded(self) -> list[Any]:
        modules = [importlib.import_module(name) for name in self.modules]
        return [command for module in modules for command in module.COMMANDS]


class UserError(click.ClickException):
    """A mistake that the user can mend."""

    exit_code = 2


def _failure(text: str) -> click.ClickException:
    return UserError(" ".join(text.split()))


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    click.echo(f"note: {message}", err=True)


class Range(click.ParamType):  # type: ignore[type-arg]
    """`3` or `1-3`, as two numbers."""

    def __init__(self, number: Callable[[str], Any]) -> None:
        self.number = number
        self.name = "N or N-M"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse; a tuple (a default) passes."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(rf"({NUMBER})(?:-({NUMBER}))?", str(value).strip())
        try:
            ends = [self.number(end) for end in match.groups() if end] if match else []
        except ValueError:
            ends = []
        if not ends:
            self.fail(f"found {value!r}, expected a number or a range such as 1-3", param, ctx)
        return ends[0], ends[-1]


class Size(click.ParamType):  # type: ignore[type-arg]
    """`128` or `HxW`, as (height, width)."""

    name = "N or HxW"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse."""
        parts = str(value).lower().split("x")
        if len(parts) not in (1, 2) or not all(part.isdecimal() for part in parts):
            self.fail(
                f"found {value!r}, expected a number such as 128 or HxW such as 96x128", param, ctx
            )
        return int(parts[0]), int(parts[-1])


class Items(click.ParamType):  # type: ignore[type-arg]
    """`0,5,7` or `0-7` or both, as a list of numbers."""

    name = "0,5,7 or 0-7"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse."""
        chosen: list[int] = []
        for part in str(value).split(","):
            match = re.fullmatch(r"([0-9]+)(?:-([0-9]+))?", part.strip())
            if not match:
                self.fail(f"found {value!r}, expected numbers such as 0,5,7 or 0-7", param, ctx)
            first, last = int(match[1]), int(match[2] or match[1])
            if last < first:
                self.fail(f"found {part!r}, expected a rising range such as 0-7", param, ctx)
            chosen.extend(range(first, min(last, first + MOST_ITEMS) + 1))
        return chosen


class Names(click.ParamType):  # type: ignore[type-arg]
    """`mug,bowl`, as a tuple of texts."""

    name = "NAME,NAME"

    def convert(
        self, value: Any, _param: click.Parameter | None, _ctx: click.Context | None
    ) -> Any:
        """Parse."""
        return tuple(part.strip() for part in str(value).split(","))


class Numbers(click.ParamType):  # type: ignore[type-arg]
    """`0,5,35`, as a tuple of numbers."""

    name = "N,N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse."""
        parts = [part.strip() for part in str(value).split(",")]
        if not all(re.fullmatch(NUMBER, part) for part in parts):
            self.fail(f"found {value!r}, expected numbers such as 0,5,35", param, ctx)
        return tuple(map(float, parts))


class Color(click.ParamType):  # type: ignore[type-arg]
    """`white`, `black`, a grey such as `0.5`, or `R,G,B`, as three numbers."""

    name = "white, black, GREY or R,G,B"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse."""
        text = {"white": "1", "black": "0"}.get(str(value).lower(), str(value))
        parts = [part.strip() for part in text.split(",")]
        if len(parts) not in (1, 3) or not all(re.fullmatch(NUMBER, part) for part in parts):
            self.fail(
                f"found {value!r}, expected white, black, a grey from 0 to 1, or R,G,B", param, ctx
            )
        return tuple(float(part) for part in (parts if len(parts) == 3 else parts * 3))


def progress_bar(count: int | None, unit: str) -> Any:
    """Return a progress bar with rate and time left on standard error; hidden where that is no
    terminal. To be used in a `with`; its `update` takes how many more items are done.
    """
    from tqdm import tqdm

    return tqdm(total=count, unit=unit, disable=None, leave=False, smoothing=0.1)


OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace existing files.")
DEVICE = click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    default="auto",
    show_default=True,
    help="auto: the CPU's fast path, else a slow one.",
)
IMAGE_DTYPE = click.option(
    "--image-dtype",
    type=click.Choice(["uint8", "float16", "float32"]),
    default="uint8",
    show_default=True,
    help="How radiance is stored.",
)
COMPRESSION = click.option(
    "--compression",
    type=click.Choice(["gzip", "lzf", "none"]),
    default="gzip",
    show_default=True,
    help="lzf is read by h5py only.",
)
SIZE = click.option(
    "--size", type=Size(), default="128", show_default=True, help="Image size in pixels."
)
SEED = click.option(
    "--seed", type=int, default=0, show_default=True, help="Seed of every random choice."
)


UP = click.option(
    "--up",
    type=click.Choice(["y", "z"]),
    default="y",
    show_default=True,
    help="Which axis points up in a folder of meshes; in ShapeNet's it is y.",
)
CACHE_DIR = click.option("--cache-dir", help="Where cleaned meshes are kept [the user's cache].")


def MESHES(command: Any) -> Any:  # noqa: N802
    """Add the options that say which meshes objects are made of."""
    options = (
        click.option("--shapenet-root", help="Folder of ShapeNetCore v1 or v2."),
        click.option("--objects-root", help="Folder of meshes, a sub-folder for each class."),
        UP,
        CACHE_DIR,
    )
    for option in reversed(options):
        command = option(command)
    return command

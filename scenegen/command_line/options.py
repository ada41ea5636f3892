"""Options that several commands have, and the types of options that click lacks."""

import csv
import re
from collections.abc import Callable
from typing import Any

import click

from scenegen.command_line.paths import InputPath, OutputFolder

PICTURE_FILES = (".exr", ".jpeg", ".jpg", ".png")
MESH_FILES = (".glb", ".obj", ".off", ".ply", ".stl")
NUMBER = r"[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?"
Command = Callable[..., Any]
LARGEST = 2**63 - 1  # whole number that files can hold
MOST_PROCESSES = 1024
MOST_ITEMS = 1_000_000  # numbers of a range; keeps 0-99999999999 from filling the memory


class Renamed(click.Option):
    """An option that is still read under its former name, which help and errors leave out."""

    def __init__(self, *arguments: Any, former: str, **attributes: Any) -> None:
        super().__init__(*arguments, **attributes)
        self.former = former

    def add_to_parser(self, parser: Any, ctx: click.Context) -> None:
        """Let the parser know both names."""
        self.opts.append(self.former)
        try:
            super().add_to_parser(parser, ctx)
        finally:
            self.opts.pop()


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


def together(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Return what adds some options to a command, in the order of its help."""

    def added(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return added


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
    """`mug,bowl`, as a tuple of texts; a name with a comma stands in double quotes."""

    name, expected = "NAME,NAME", "names such as mug,bowl"

    def _parse(self, text: str) -> tuple[str, ...]:
        try:
            (names,) = csv.reader([text], skipinitialspace=True, strict=True)
        except csv.Error as error:
            raise ValueError(str(error)) from error
        return tuple(name.strip() for name in names) or ("",)


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


class Reflectance(Color):
    """A `Color`, or `own`."""

    name, expected = f"own, {Color.name}", f"own, {Color.expected}"

    def _parse(self, text: str) -> Any:
        return text if text == "own" else super()._parse(text)


# fmt: off
WORKERS = click.option("--workers", type=click.IntRange(0, 256), default=0,
                       show_default="one per processor, up to 16",
                       help="Number of rendering processes. Each process uses about 0.4 GiB of"
                       " memory; for interiors, 1.3 GiB.")
SCHEDULER = click.option("--scheduler", metavar="ADDRESS",
                         help="Distribute the work with the Dask scheduler at this address, such as"
                         " tcp://host:8786. local: start a Dask cluster on this machine.")
OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace existing files.")
DEVICE = click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto",
                      show_default=True,
                      help="Device to render on. auto means cpu, which is slow without LLVM.")
IMAGE_DTYPE = click.option("--image-dtype", type=click.Choice(["uint8", "float16", "float32"]),
                           default="uint8", show_default=True, help="Data type of the stored"
                                                                    " radiance.")
COMPRESSION = click.option("--compression", type=click.Choice(["gzip", "lzf", "none"]),
                           default="gzip", show_default=True,
                           help="Compression of the images. Only h5py can read lzf.")
ENCODING = click.option("--encoding", "curve", type=click.Choice(["srgb", "linear"]),
                        default="srgb", show_default=True,
                        help="Encoding of the 8-bit images. srgb: for display and for networks;"
                        " linear: linear radiance. Floating-point images are always linear.")
SIZE = click.option("--size", type=Size(), default="128", show_default=True,
                    help="Image size in pixels.")
SEED = click.option("--seed", type=int, default=0, show_default=True,
                    help="Random seed.")
UP = click.option("--up", type=click.Choice(["y", "z"]), default="y", show_default=True,
                  help="Axis of the meshes that points up. For ShapeNet, use y.")
CACHE_DIR = click.option("--cache-dir", type=OutputFolder(),
                         help="Folder in which cleaned meshes are cached [the user's cache].")
ASSETS = together(  # files of others that images of interiors are rendered with
    click.option("--materials", type=InputPath(within=PICTURE_FILES),
                 help="Folder of materials for interiors, in the layout of ambientCG or Poly Haven."
                 " A material has maps of colour, roughness and normals."),
    click.option("--environment", type=InputPath(),
                 help="Environment map that replaces the sun and the sky of interiors. The file is"
                 " an equirectangular HDR or EXR image."),
)
MESHES = together(  # the folder of meshes that objects are taken from
    click.option("--shapenet-root", type=InputPath(within=MESH_FILES),
                 help="Folder of ShapeNetCore 1 or 2, whose meshes become the objects."),
    click.option("--objects-root", type=InputPath(within=MESH_FILES),
                 help="Folder with one sub-folder of meshes per object category."),
    UP,
    CACHE_DIR,
)
# fmt: on

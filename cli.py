"""The commands: parse, one library call, print. Heavy imports happen inside the commands."""

import re
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

NUMBER = r"[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?"
MOST_ITEMS = 1_000_000  # of a range; keeps 0-99999999999 from eating the memory


class FriendlyGroup(click.Group):
    """A group that shows what went wrong for a user as one line and exits with 2."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; errors meant for people become click's own."""
        warnings.showwarning = _show_warning
        try:
            return super().invoke(ctx)
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            raise _failure(f"{where}{error.strerror or error}") from error
        except ValueError as error:
            from scenegen.errors import SceneGenError

            if not isinstance(error, SceneGenError):
                raise
            raise _failure(str(error)) from error


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


def _names(
    _ctx: click.Context, _param: click.Parameter, value: str | None
) -> tuple[str, ...] | None:
    return None if value is None else tuple(part.strip() for part in value.split(","))


@click.group(cls=FriendlyGroup)
@click.version_option(package_name="pix2shape-bench")
def scenegen() -> None:
    """Rooms holding basic shapes, rendered with exact ground truth."""


@scenegen.command()
@click.option("--n", "count", type=int, required=True, help="Number of images.")
@click.option("--out", default="rooms.h5", show_default=True, help="File to write.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of every random choice.")
@click.option("--size", type=Size(), default="128", show_default=True, help="Image size in pixels.")
@click.option(
    "--objects", type=Range(int), default="1-3", show_default=True, help="Objects a scene."
)
@click.option(
    "--shapes", callback=_names, help="Names to draw from, such as box,sphere [default: all]."
)
@click.option("--object-radius", type=Range(float), help="Bounding radius, scene units.")
@click.option(
    "--pose",
    type=click.Choice(["resting", "any"]),
    default="resting",
    show_default=True,
    help="How objects lie: as they would stay, or turned anyhow.",
)
@click.option("--lights", type=Range(int), default="1-3", show_default=True, help="Lights a scene.")
@click.option(
    "--shadows/--no-shadows", default=False, help="Whether objects cast shadows [default: no]."
)
@click.option("--spp", type=int, default=1, show_default=True, help="Colour samples a pixel.")
@click.option("--min-visible-pixels", type=int, help="Least pixels of each object [default: 0.3%].")
@click.option("--allow-cropped", is_flag=True, help="Let the image's border cut objects.")
@click.option(
    "--image-dtype",
    type=click.Choice(["uint8", "float16", "float32"]),
    default="uint8",
    show_default=True,
    help="How radiance is stored.",
)
@click.option(
    "--compression",
    type=click.Choice(["gzip", "lzf", "none"]),
    default="gzip",
    show_default=True,
    help="lzf is read by h5py only.",
)
@click.option("--batch", type=int, default=64, show_default=True, help="Images in one wavefront.")
@click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    default="auto",
    show_default=True,
    help="auto: the CPU's fast path, else a slow one.",
)
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def render(
    count: int,
    out: str,
    size: tuple[int, int],
    batch: int,
    device: str,
    compression: str,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Render rooms to an HDF5 file: image, depth, normals, object ids, cameras, lights, scenes."""
    from tqdm import tqdm

    from scenegen.dataset import make_dataset
    from scenegen.specs import DatasetSpec

    chosen = {name: value for name, value in settings.items() if value is not None}
    chosen.setdefault("min_visible_pixels", max(1, round(0.003 * size[0] * size[1])))
    spec = DatasetSpec(height=size[0], width=size[1], **chosen)
    command = " ".join(["scenegen", *sys.argv[1:]])
    started = time.perf_counter()
    with tqdm(total=count, unit="img", disable=None, leave=False, smoothing=0.1) as bar:
        make_dataset(
            out,
            spec,
            count,
            batch=batch,
            device=device,
            compression=compression,
            overwrite=overwrite,
            command=command,
            progress=bar.update,
        )
    seconds = time.perf_counter() - started
    megabytes = Path(out).stat().st_size / 1e6
    click.echo(f"{out}: {count} images, {megabytes:.1f} MB, {count / seconds:.0f} images/s")


@scenegen.command()
@click.argument("file")
@click.option("--out", default="sheet.png", show_default=True, help="Picture to write.")
@click.option("--items", type=Items(), help="Rows to show [default: the first 12].")
@click.option(
    "--random", "number", type=click.IntRange(1, 400), help="Show so many rows at random."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Which ones --random picks.")
def preview(file: str, out: str, items: list[int] | None, number: int | None, seed: int) -> None:
    """Make a contact sheet: image, depth, normals, object ids, with labels."""
    from scenegen.preview import contact_sheet, pick_rows, save_picture
    from scenegen.scene_file import RoomsFile

    with RoomsFile(file) as rooms:
        rows = pick_rows(len(rooms), items, number, seed)
        save_picture(contact_sheet([rooms[i] for i in rows]), out)
    click.echo(f"{out}: {len(rows)} of {file}'s rooms")


@scenegen.command()
@click.argument("file")
def info(file: str) -> None:
    """Say what is in a file: spec, counts, ranges, units, sizes, versions, fingerprint."""
    from scenegen.info import describe

    click.echo(describe(file))


@scenegen.command()
@click.argument("file")
@click.option(
    "--items",
    type=click.IntRange(0),
    default=8,
    show_default=True,
    help="Rows to draw and render again.",
)
@click.option(
    "--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto", show_default=True
)
@click.pass_context
def verify(ctx: click.Context, file: str, items: int, device: str) -> None:
    """Check layout and values of every row, render some again; exits with 1 if a check fails."""
    from tqdm import tqdm

    from scenegen.scene_file import RoomsFile
    from scenegen.verify import verify_file

    with RoomsFile(file) as rooms:
        count = len(rooms)
    with tqdm(total=count, unit="img", disable=None, leave=False) as bar:
        checks = verify_file(file, items, device, bar.update)
    for check in checks:
        click.echo(f"{'ok  ' if check.ok else 'FAIL'}  {check.name:26} {check.detail}")
    failed = sum(not check.ok for check in checks)
    click.echo(
        f"{file}: {failed} of {len(checks)} checks failed" if failed else f"{file}: verified"
    )
    ctx.exit(1 if failed else 0)


@scenegen.command()
@click.argument("file")
@click.option("--items", type=Items(), required=True, help="Rows to export.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["exr", "png", "ply", "obj"]),
    required=True,
    help="exr: all channels; png: 16 bits; ply: surfels; obj: the scene's mesh.",
)
@click.option("--out", default=".", show_default=True, help="Folder to write to.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
def export(file: str, items: list[int], form: str, out: str, overwrite: bool) -> None:
    """Write single rooms for other tools."""
    from scenegen.export import export_paths, export_room
    from scenegen.new_file import check_writable
    from scenegen.preview import pick_rows
    from scenegen.scene_file import RoomsFile

    with RoomsFile(file) as rooms:
        rows = pick_rows(len(rooms), items)
        paths = {row: export_paths(row, out, Path(file).stem, form) for row in rows}
        for some in paths.values():
            for path in some:
                check_writable(path, overwrite)
        for row, some in paths.items():
            export_room(rooms[row], some, form, overwrite)
    for some in paths.values():
        click.echo("\n".join(map(str, some)))


@click.group(cls=FriendlyGroup)
@click.version_option(package_name="pix2shape-bench")
def iqtt() -> None:
    """3D-IQTT mental-rotation questions (no commands yet)."""


@click.group(cls=FriendlyGroup)
@click.version_option(package_name="pix2shape-bench")
def bench() -> None:
    """Scores for predictions (no commands yet)."""

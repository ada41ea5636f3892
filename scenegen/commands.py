"""The `scenegen` commands: parse, one library call, print. Heavy imports happen inside them."""

import sys
import time
from pathlib import Path
from typing import Any

import click

from scenegen.command_line import COMPRESSION, DEVICE, IMAGE_DTYPE, SEED, SIZE, Items, Range


def _names(
    _ctx: click.Context, _param: click.Parameter, value: str | None
) -> tuple[str, ...] | None:
    return None if value is None else tuple(part.strip() for part in value.split(","))


@click.command()
@click.option("--n", "count", type=int, required=True, help="Number of images.")
@click.option("--out", default="rooms.h5", show_default=True, help="File to write.")
@SEED
@SIZE
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
@IMAGE_DTYPE
@COMPRESSION
@click.option("--batch", type=int, default=64, show_default=True, help="Images in one wavefront.")
@DEVICE
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


@click.command()
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


@click.command()
@click.argument("file")
def info(file: str) -> None:
    """Say what is in a file: spec, counts, ranges, units, sizes, versions, fingerprint."""
    from scenegen.info import describe

    click.echo(describe(file))


@click.command()
@click.argument("file")
@click.option(
    "--items",
    type=click.IntRange(0),
    default=8,
    show_default=True,
    help="Rows to draw and render again.",
)
@DEVICE
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


@click.command()
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


COMMANDS = (render, preview, info, verify, export)

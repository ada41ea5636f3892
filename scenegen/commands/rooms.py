"""Commands that show, check and export files of rooms.

Each one parses its options, makes one library call, and prints. Heavy imports happen inside.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import DEVICE, MESHES, OVERWRITE, Items
from scenegen.command_line.output import print_checks, print_line, progress_bar
from scenegen.command_line.paths import (
    InputPath,
    OutputFolder,
    OutputPath,
    refuse_command_inputs,
)

SINGLE = ("exr", "png", "ply", "obj")  # formats of files of one row
SHARED = ("parquet", "webdataset")  # and of files of many


@click.command(epilog=f"{EXAMPLE}scenegen preview rooms.h5 --random 12 --out sheet.png")
@click.argument("file", type=InputPath())
@click.option(
    "--out", type=OutputPath(), default="sheet.png", show_default=True, help="Picture to write."
)
@click.option("--items", type=Items(), help="Rows to show [default: the first 12].")
@click.option(
    "--random", "number", type=click.IntRange(1, 400), help="Number of rows to pick at random."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of --random.")
@OVERWRITE
def preview(
    file: str,
    out: str,
    items: list[int] | None,
    number: int | None,
    seed: int,
    overwrite: bool,
) -> None:
    """Write a picture of some rooms of a file: image, depth, normals and object ids."""
    from scenegen.files.pictures import pick_rows, save_picture
    from scenegen.rooms.preview import contact_sheet
    from scenegen.rooms.reader import RoomsFile

    with RoomsFile(file) as rooms:
        rows = pick_rows(len(rooms), items, number, seed)
        sheet = contact_sheet([rooms[i] for i in rows])
    save_picture(sheet, out, overwrite)
    print_line(f"{out}: {len(rows)} of {file}'s rooms")


@click.command(epilog=f"{EXAMPLE}scenegen info rooms.h5")
@click.argument("file", type=InputPath())
def info(file: str) -> None:
    """Print what a file holds: settings, ranges of values, units, sizes, versions, fingerprint."""
    from scenegen.rooms.info import describe

    click.echo(describe(file))


@click.command(epilog=f"{EXAMPLE}scenegen verify rooms.h5 --items 20")
@click.argument("file", type=InputPath(within=(".h5",)))
@click.option(
    "--items",
    type=click.IntRange(0),
    default=8,
    show_default=True,
    help="Number of rows to draw from the seed and render again.",
)
@MESHES
@DEVICE
@click.pass_context
def verify(ctx: click.Context, /, file: str, items: int, device: str, **meshes: Any) -> None:
    """Check digests and values of every row of a file, and render some rows again.

    Of a folder with a manifest, check the SHA-256 of every file and that every row is there once.
    Rows rendered again must agree bit for bit, or within a stated tolerance where the file was
    rendered by other versions of Mitsuba, Dr.Jit or LLVM. Exits with 1 if a check fails.
    """
    from scenegen.files.manifest import Manifest, manifests_in
    from scenegen.files.verify import Check
    from scenegen.layout import FORMAT_NAME
    from scenegen.objects.sources import file_objects
    from scenegen.rooms.reader import RoomsFile
    from scenegen.rooms.verify import verify_file, verify_set

    paths: list[tuple[Path, Manifest | None]] = [(Path(file), None)]
    if Path(file).is_dir():
        sets = manifests_in(Path(file), FORMAT_NAME)
        paths = [(place.with_name(manifest.files[0]), manifest) for place, manifest in sets]
    checks: list[Check] = []
    for path, manifest in paths:
        with RoomsFile(path) as rooms, progress_bar(len(rooms), "image") as bar:
            how = (items, device, file_objects(rooms.spec, **meshes), bar.update)
            checks += verify_set(rooms, manifest, *how) if manifest else verify_file(rooms, *how)
    ctx.exit(print_checks(file, checks))


@click.command(
    epilog=f"{EXAMPLE}scenegen export rooms.h5 --items 0,5-7 --format exr --out exported"
)
@click.argument("file", type=InputPath())
@click.option(
    "--items", type=Items(), help="Rows to export; without it parquet and webdataset take all."
)
@click.option(
    "--format",
    "form",
    type=click.Choice([*SINGLE, *SHARED]),
    required=True,
    help="exr has all channels; png 16 bits a channel; ply the surfels; obj the scene's mesh;"
    " parquet and webdataset all values of many rows, for data loaders.",
)
@click.option(
    "--out",
    type=OutputFolder(),
    help="Folder to write to; parquet and webdataset make it [., or rooms-parquet of rooms.h5].",
)
@click.option(
    "--rows-per-file",
    type=click.IntRange(1),
    default=1000,
    show_default=True,
    help="Most rows of a file of parquet or webdataset.",
)
@OVERWRITE
@MESHES
def export(
    file: str,
    items: list[int] | None,
    form: str,
    out: str | None,
    rows_per_file: int,
    overwrite: bool,
    **meshes: Any,
) -> None:
    """Write rows of a file in the formats of other tools."""
    if form in SHARED:
        folder = out or f"{Path(file).stem}-{form}"
        _export_many(file, items, form, folder, rows_per_file, overwrite)
    elif items is None:
        raise click.UsageError(f"--items: found none, expected rows for --format {form}")
    else:
        _export_single(file, items, form, out or ".", overwrite, meshes)


def _export_many(
    file: str,
    items: list[int] | None,
    form: str,
    out: str,
    rows_per_file: int,
    overwrite: bool,
) -> None:
    """Write rows, or all, to a folder of a few large files."""
    if form == "parquet":
        needs("scenegen export --format parquet", ("datasets", "pyarrow"), "share")
    from scenegen.rooms.reader import RoomsFile
    from scenegen.sharing.rooms import export_rows

    with RoomsFile(file) as rooms:
        count = len(rooms if items is None else items)
    with progress_bar(count, "image") as bar:
        written = export_rows(
            file,
            form,
            out,
            items,
            rows_per_file=rows_per_file,
            overwrite=overwrite,
            progress=bar.update,
        )
    megabytes = sum(path.stat().st_size for path in written) / 1e6
    print_line(f"{out}: {count} images in {len(written) - 1} files, {megabytes:.1f} MB")


def _export_single(
    file: str, items: list[int], form: str, out: str, overwrite: bool, meshes: dict[str, Any]
) -> None:
    """Write each row to files of its own."""
    from scenegen.common.errors import SpecError
    from scenegen.files.new_file import check_writable
    from scenegen.files.pictures import pick_rows
    from scenegen.objects.catalogue import changed_meshes
    from scenegen.objects.sources import file_objects, mesh_folder
    from scenegen.rooms.export import export_paths, export_room
    from scenegen.rooms.reader import RoomsFile

    mesh_folder(meshes["shapenet_root"], meshes["objects_root"], meshes["up"])
    with RoomsFile(file) as rooms:
        objects = file_objects(rooms.spec, **meshes) if form == "obj" else None
        rows = pick_rows(len(rooms), items)
        for row in rows:
            changed = changed_meshes(objects, rooms.scene(row)) if objects else []
            if changed:
                found = f"models that changed in the folder: {', '.join(changed)}"
                raise SpecError(f"{file}: row {row}", found, "the files it was made from")
        paths = {row: export_paths(row, out, Path(file).stem, form) for row in rows}
        refuse_command_inputs(path for some in paths.values() for path in some)
        with _folder_made(Path(out)):
            for some in paths.values():
                for path in some:
                    check_writable(path, overwrite)
            for row, some in paths.items():
                export_room(rooms[row], some, form, overwrite, objects)
    for some in paths.values():
        for path in some:
            print_line(str(path))


@contextmanager
def _folder_made(folder: Path) -> Iterator[None]:
    """Make a folder if it is not there; remove it if the block fails before it holds anything."""
    new = not folder.exists()
    if new:
        folder.mkdir()
    try:
        yield
    except BaseException:
        if new:
            with suppress(OSError):
                folder.rmdir()
        raise


COMMANDS = (preview, info, verify, export)

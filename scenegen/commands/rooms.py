"""Commands that show, check and export files of rooms.

Each one parses its options, makes one library call, and prints. Heavy imports happen inside.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import ASSETS, DEVICE, ENCODING, MESHES, OVERWRITE, Items
from scenegen.command_line.output import print_checks, print_line, progress_bar
from scenegen.command_line.paths import (
    InputPath,
    OutputFolder,
    OutputPath,
    refuse_command_inputs,
)
from scenegen.rooms.export.formats import DATA_FORMATS, FOLDER_FORMATS, FORMATS, ROW_FORMATS

if TYPE_CHECKING:
    from scenegen.description.specs import Request

NEEDED = 'pip install "pix2shape-bench[denoise]", or use --items 0: nothing is rendered again'
MOST_NAMED = 20  # exported rows whose files are listed


@click.command(epilog=f"{EXAMPLE}scenegen preview rooms.h5 --random 12 --out sheet.png")
@click.argument("file", type=InputPath())
@click.option(
    "--out", type=OutputPath(), default="sheet.png", show_default=True, help="Output image."
)
@click.option("--items", type=Items(), help="Images to show [default: the first 12].")
@click.option(
    "--random", "number", type=click.IntRange(1, 400), help="Number of images to pick at random."
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
    """Draw some images of FILE, with depth, normals and object ids, in one output image."""
    from scenegen.files.images.pictures import pick_rows, save_picture
    from scenegen.rooms.preview import contact_sheet
    from scenegen.rooms.reader import RoomsFile

    with RoomsFile(file) as rooms:
        rows = pick_rows(len(rooms), items, number, seed)
        sheet = contact_sheet([rooms[i] for i in rows])
    save_picture(sheet, out, overwrite)
    print_line(f"{out}: {len(rows)} images of {file}")


@click.command(epilog=f"{EXAMPLE}scenegen info rooms.h5")
@click.argument("file", type=InputPath())
def info(file: str) -> None:
    """Print the settings, value ranges, units, sizes and versions of the rooms file FILE."""
    from scenegen.rooms.info import describe

    click.echo(describe(file))


@click.command(epilog=f"{EXAMPLE}scenegen verify rooms.h5 --items 20")
@click.argument("file", type=InputPath(within=(".h5",)))
@click.option(
    "--items",
    type=click.IntRange(0),
    default=8,
    show_default=True,
    help="Number of images to render again.",
)
@MESHES
@ASSETS
@DEVICE
@click.pass_context
def verify(
    ctx: click.Context,
    /,
    file: str,
    items: int,
    device: str,
    materials: str | None,
    environment: str | None,
    **meshes: Any,
) -> None:
    """Check the rooms file FILE: hashes and values of every image. Render some images again.

    The new images must equal the stored images bit for bit. If FILE was rendered with other
    versions of Mitsuba or Dr.Jit, the images must agree within the printed tolerance. If FILE has
    no ground truth, only hashes are checked. If a check fails, the exit code is 1.
    """
    from scenegen.objects.sources import file_objects
    from scenegen.rendering.pictures.places import ASSETS as PLACES
    from scenegen.rooms.reader import RoomsFile
    from scenegen.rooms.verify import verify_file, verify_withheld

    PLACES.use(materials, environment)
    path = Path(file)
    with RoomsFile(path) as rooms, progress_bar(len(rooms), "image") as bar:
        if rooms.has_truth:
            if items:
                _check_images(path, rooms.spec)
            objects = file_objects(rooms.spec, **meshes)
            checks = verify_file(rooms, items, device, objects, bar.update)
        else:
            checks = verify_withheld(rooms, bar.update)
    ctx.exit(print_checks(file, checks))


def _check_images(path: Path, spec: "Request") -> None:
    """Raise SceneGenError or OSError where images of interiors cannot be made again here."""
    from scenegen.common.errors import BackendError
    from scenegen.description.specs import InteriorSpec
    from scenegen.rendering.pictures.assets import environment_of, materials_of
    from scenegen.rendering.pictures.denoiser import has_denoiser

    if isinstance(spec, InteriorSpec):
        if spec.denoise and not has_denoiser():
            raise BackendError(
                f"{path}: images", "they are denoised, and no denoiser is installed", hint=NEEDED
            )
        materials_of(spec)
        environment_of(spec)


@click.command(
    epilog=f"{EXAMPLE}scenegen export rooms.h5 --items 0,5-7 --format exr --out exported"
)
@click.argument("file", type=InputPath())
@click.option(
    "--items",
    type=Items(),
    help=f"Images to export. The formats {', '.join(ROW_FORMATS)} need --items or --all.",
)
@click.option("--all", "every", is_flag=True, help="Export all images.")
@click.option(
    "--format",
    "form",
    type=click.Choice([*FORMATS]),
    required=True,
    help="; ".join(f"{form.name}: {form.holds}" for form in FORMATS.values()) + ".",
)
@ENCODING
@click.option(
    "--bits",
    type=click.Choice(["8", "16"]),
    default="8",
    show_default=True,
    help="Bit depth of images and normals in PNG files. Depth always has 16 bits.",
)
@click.option(
    "--exposure",
    type=click.FloatRange(0, min_open=True),
    default=1.0,
    show_default=True,
    help="Multiply the radiance by this factor, in images and PLY files.",
)
@click.option(
    "--depth-unit",
    type=click.FloatRange(0, min_open=True),
    help="Scene units per step of the 16-bit depth in PNG files. --format moge ignores it [1e-4;"
    " for interiors 1e-3, which is 1 mm].",
)
@click.option(
    "--out",
    type=OutputFolder(),
    help="Output folder [for exr, png, ply and obj, the current folder; for other formats, a new"
    " folder, such as rooms-parquet].",
)
@click.option(
    "--rows-per-file",
    type=click.IntRange(1),
    default=1000,
    show_default=True,
    help="For parquet and webdataset: maximum number of images per file.",
)
@OVERWRITE
@MESHES
@ASSETS
@DEVICE
def export(
    file: str,
    items: list[int] | None,
    every: bool,
    form: str,
    curve: str,
    bits: str,
    exposure: float,
    depth_unit: float | None,
    out: str | None,
    rows_per_file: int,
    overwrite: bool,
    device: str,
    materials: str | None,
    environment: str | None,
    **meshes: Any,
) -> None:
    """Export images of FILE, with their ground truth, to the formats of other tools.

    If a value does not fit the encoding, the command stops with an error, which names the option to
    change. Only --format bop uses --device, because it renders the masks of whole objects.
    """
    if every and items is not None:
        raise click.UsageError("--all and --items exclude each other: use one of them")
    from scenegen.rendering.pictures.places import ASSETS as PLACES

    PLACES.use(materials, environment)
    folder = out or f"{Path(file).stem}-{form}"
    how = {"curve": curve, "bits": int(bits), "exposure": exposure}
    how |= {} if depth_unit is None else {"depth_unit": depth_unit}
    if form in DATA_FORMATS:
        _export_many(file, items, form, folder, curve, rows_per_file, overwrite)
    elif form in FOLDER_FORMATS:
        _export_folder(file, items, form, folder, overwrite, device, meshes, how)
    elif items is None and not every:
        raise click.UsageError(f"--format {form} needs images: use --items 0-9, or --all")
    else:
        _export_single(file, items, form, out or ".", overwrite, meshes, how)


def _export_many(
    file: str,
    items: list[int] | None,
    form: str,
    out: str,
    curve: str,
    rows_per_file: int,
    overwrite: bool,
) -> None:
    """Write rows, or all, to a folder of a few large files."""
    if form == "parquet":
        needs("scenegen export --format parquet", ("datasets", "pyarrow"), "share")
    from scenegen.rooms.reader import RoomsFile
    from scenegen.sharing.export import write_export
    from scenegen.sharing.rooms import ROOMS

    with RoomsFile(file) as rooms:
        count = len(rooms if items is None else items)
        with progress_bar(count, "image") as bar:
            written = write_export(
                rooms,
                ROOMS,
                form,
                out,
                items,
                encoding=curve,
                rows_per_file=rows_per_file,
                overwrite=overwrite,
                progress=bar.update,
            )
    megabytes = sum(path.stat().st_size for path in written) / 1e6
    print_line(f"{out}: {count} images in {len(written) - 1} files, {megabytes:.1f} MB")


def _export_folder(
    file: str,
    items: list[int] | None,
    form: str,
    out: str,
    overwrite: bool,
    device: str,
    meshes: dict[str, Any],
    how: dict[str, Any],
) -> None:
    """Write rows, or all, to the folder that a tool reads; `how` are the fields of `Encoding`."""
    from scenegen.objects.sources import file_objects
    from scenegen.rooms.export.encoding import plain
    from scenegen.rooms.export.folder import export_folder
    from scenegen.rooms.reader import RoomsFile

    with RoomsFile(file) as rooms:
        objects = file_objects(rooms.spec, **meshes) if form in ("bop", "glb") else None
        count = len(rooms if items is None else items)
        with progress_bar(count, "image") as bar:
            export_folder(
                rooms,
                form,
                out,
                items,
                encoding=replace(plain(rooms.spec.interior), **how),
                objects=objects,
                device=device,
                overwrite=overwrite,
                progress=bar.update,
            )
    print_line(f"{out}: {count} images")


def _export_single(
    file: str,
    items: list[int] | None,
    form: str,
    out: str,
    overwrite: bool,
    meshes: dict[str, Any],
    how: dict[str, Any],
) -> None:
    """Write each row, or all rows, to files of their own; `how` are the fields of `Encoding`."""
    from scenegen.common.errors import SpecError
    from scenegen.files.images.pictures import pick_rows
    from scenegen.files.new_file import check_writable
    from scenegen.objects.catalogue import changed_meshes
    from scenegen.objects.sources import file_objects, mesh_folder
    from scenegen.rooms.export.encoding import plain
    from scenegen.rooms.export.single import export_paths, export_room
    from scenegen.rooms.reader import RoomsFile

    mesh_folder(meshes["shapenet_root"], meshes["objects_root"], meshes["up"])
    with RoomsFile(file) as rooms:
        objects = file_objects(rooms.spec, **meshes) if form == "obj" else None
        encoding = replace(plain(rooms.spec.interior), **how)
        rows = list(range(len(rooms))) if items is None else pick_rows(len(rooms), items)
        for row in rows:
            changed = changed_meshes(objects, rooms.scene(row)) if objects else []
            if changed:
                found = f"models that changed in the folder: {', '.join(changed)}"
                raise SpecError(f"{file}: row {row}", found, "the files it was made from")
        paths = {row: export_paths(row, out, Path(file).stem, form) for row in rows}
        refuse_command_inputs(path for files in paths.values() for path in files)
        with _folder_made(Path(out)), progress_bar(len(rows), "image") as bar:
            for files in paths.values():
                for path in files:
                    check_writable(path, overwrite)
            for row, files in paths.items():
                export_room(rooms[row], files, form, overwrite, objects, encoding)
                bar.update(1)
    if len(rows) > MOST_NAMED:
        print_line(f"{out}: {len(rows)} images in {sum(map(len, paths.values()))} files")
        return
    for files in paths.values():
        for path in files:
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

"""Commands that make files of rooms: render, merge shards, list the presets.

Each one parses its options, makes one library call, and prints. Heavy imports happen inside.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from scenegen.command_line.groups import EXAMPLE, creation_command
from scenegen.command_line.options import (
    ASSETS,
    COMPRESSION,
    DEVICE,
    IMAGE_DTYPE,
    MESHES,
    OVERWRITE,
    SCHEDULER,
    SEED,
    WORKERS,
    Names,
    Range,
    Reflectance,
    Renamed,
    Size,
)
from scenegen.command_line.output import on_scheduler, print_line, progress_bar
from scenegen.command_line.paths import InputPath, NewHdf5
from scenegen.command_line.settings import setting_options

if TYPE_CHECKING:
    from scenegen.description.specs import Request

NOISY_SPP = 256  # samples per pixel of pictures that are not denoised


def _presets(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    """Return the presets that a shell may complete a name to."""
    from scenegen.description.presets import PRESETS

    return [name for name in PRESETS if name.startswith(incomplete)]


# fmt: off
@click.command(
    epilog=f"{EXAMPLE}scenegen render --n 1000 --preset shapenet --seed 1 --out rooms.h5"
)
@click.option("--n", "count", type=int, required=True, help="Number of scenes. Each scene has one"
                                                            " image per view of --views.")
@click.option("--out", type=NewHdf5(), default="rooms.h5", show_default=True,
              help="Output file, or a URL such as s3://bucket/rooms.h5.")
@click.option("--preset", default="shapes", show_default=True, shell_complete=_presets,
              help="Named set of options. Options on the command line override it. `scenegen"
              " presets` lists the presets.")
@SEED
@click.option("--size", type=Size(), help="Image size in pixels [128; 256 for interiors].")
@click.option("--shapes", type=Names(), help="Sample basic shapes from this list, such as"
                                             " box,sphere [all].")
@click.option("--classes", type=Names(), help="Sample object categories from this list, such as"
                                              " mug,bowl.")
@click.option("--object-split", type=click.Choice(["all", "train", "val", "test"]),
              help="Sample object instances from this split. For training data, use train: the"
              " published benchmarks use test [all].")
@MESHES
@click.option("--reflectance", type=Reflectance(),
              help="Reflectance of the objects. Without --room-reflectance, it is also that of the"
              " room. own: the colours in the mesh files, multiplied by 0.8 [0.8].")
@click.option("--fov", type=Range(float),
              help="Field of view in degrees of a square image. Other images have the same diagonal"
              " field of view. With a range such as 20-60, each scene has its own value [28].")
@setting_options()
@ASSETS
@IMAGE_DTYPE
@COMPRESSION
@click.option("--batch", type=int, default=64, show_default=True,
              help="Number of images that a process renders at once. A larger batch needs more"
              " memory.")
@WORKERS
@click.option("--shard-size", type=int, default=10_000, show_default=True,
              help="Maximum number of scenes per file. A larger data set is split into several"
              " files (shards) next to --out. To read all shards, open --out.")
@SCHEDULER
@DEVICE
@click.option("--hold-out-truth", cls=Renamed, former="--withhold-truth", is_flag=True,
              help="Write two files. Release --out, which has only images and cameras. Keep the"
              " other file, such as rooms-truth.h5 for rooms.h5, which also has the ground"
              " truth. Choose a large --seed, so that nobody can guess it.")
@OVERWRITE
def render(
    count: int,
    out: str,
    preset: str,
    size: tuple[int, int] | None,
    batch: int,
    workers: int,
    shard_size: int,
    scheduler: str | None,
    device: str,
    compression: str,
    hold_out_truth: bool,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Render rooms with objects, and write images and exact ground truth to an HDF5 file.

    Each image is stored with its depth, normals, object ids, camera, lights and scene description.
    Defaults are in square brackets. A preset can change these defaults. If a data set has several
    files (shards), an interrupted run can be resumed: run the same command again.
    """
    from scenegen.description.presets import preset_spec
    from scenegen.objects.sources import object_source
    from scenegen.rendering.sameness import renderer_identity
    from scenegen.rooms.make import make_dataset

    names = ("shapes", "classes", "object_split", "shapenet_root", "objects_root", "up")
    objects = {name: settings.pop(name) for name in (*names, "cache_dir")}
    chosen = {name: value for name, value in settings.items() if value is not None}
    if chosen.get("reflectance") == "own":
        del chosen["reflectance"]
        chosen["own_reflectance"] = True
    if fov := chosen.pop("fov", None):
        chosen["fov_degrees"], chosen["fov_spread_degrees"] = fov[0], fov[1] - fov[0]
    if size is not None:
        chosen["height"], chosen["width"] = size
    assets = {name: chosen.pop(name, None) for name in ("materials", "environment")}
    source = object_source(preset, **objects)
    spec = _with_assets(preset_spec(preset, **chosen, **source.settings), **assets)
    spec, notes = with_denoiser(spec, chosen)
    notes += _crowded(spec)
    images = count * len(spec.view_angles)
    started = time.perf_counter()
    released, out = out, _truth_place(out, overwrite) if hold_out_truth else out
    with (
        _resume_hint(out),
        on_scheduler(scheduler, workers, partial(renderer_identity, device)) as cluster,
        progress_bar(images, "image") as bar,
    ):
        make_dataset(
            out,
            spec,
            count,
            batch=batch,
            workers=workers,
            shard_size=shard_size,
            device=device,
            compression=compression,
            overwrite=overwrite,
            command=creation_command("scenegen"),
            objects=source.objects,
            cluster=cluster,
            progress=_after_lines(notes, bar.update),
        )
    if hold_out_truth:
        from scenegen.rooms.withheld import withhold_truth

        withhold_truth(out, released, overwrite)
        print_line(f"{released}: images and cameras, for release; {out} has the ground truth")
    seconds = time.perf_counter() - started
    megabytes = _set_bytes(out) / 1e6
    speed = f"{images / seconds:.0f}" if images > 9 * seconds else f"{images / seconds:.2g}"
    print_line(f"{out}: {images} images, {megabytes:.1f} MB, {speed} images/s")
    _print_exposure(out)
    for line in source.notes(spec.own_reflectance):
        print_line(line, err=True)


# fmt: on
def _with_assets(spec: "Request", materials: str | None, environment: str | None) -> "Request":
    """Return a spec with materials and surroundings of others, if they are given.

    Raises as `assets.use_assets`, and SpecError where other rooms than interiors should have them.
    """
    if materials is None and environment is None:
        return spec
    from scenegen.common.records import check
    from scenegen.rendering.pictures.assets import use_assets

    where = "materials" if environment is None else "environment"
    check(spec.interior, where, "a preset without them", "--preset interiors")
    settings: dict[str, Any] = use_assets(materials, environment)
    return replace(spec, **settings)


def with_denoiser(spec: Any, chosen: Mapping[str, Any]) -> tuple[Any, list[str]]:
    """Return a spec with a denoiser, or else with more samples, unless the options decide.

    `spec` has the settings `denoise` and `spp`, or neither. The lines say that the denoiser is
    missing. Raises BackendError where no denoiser is installed, and one is asked for.
    """
    from scenegen.rendering.pictures.denoiser import check_denoiser, has_denoiser

    if not hasattr(spec, "denoise"):
        return spec, []
    if spec.denoise:
        check_denoiser()
    if "denoise" not in chosen and has_denoiser():
        return replace(spec, denoise=True), []
    if spec.denoise or "spp" in chosen:
        return spec, []
    text = f"no denoiser: {NOISY_SPP} samples per pixel instead; pip install '.[denoise]' is faster"
    return replace(spec, spp=NOISY_SPP), [] if has_denoiser() else [text]


def _crowded(spec: "Request") -> list[str]:
    """Return a warning if few rooms have space for the number of objects that is asked for."""
    from scenegen.sampling.interiors.rooms import CROWDED

    if not spec.interior or spec.objects[1] < CROWDED[1]:
        return []
    most = spec.objects[1]
    return [f"few rooms fit {most} objects: sampling a scene may take minutes, or fail"]


def _after_lines(lines: list[str], progress: Callable[[int], Any]) -> Callable[[int], None]:
    """Return `progress`, whose first call, after all checks, prints the lines first."""

    def print_and_progress(done: int) -> None:
        while lines:
            print_line(lines.pop(0))
        progress(done)

    return print_and_progress


def _truth_place(out: str, overwrite: bool) -> str:
    """Return the file of ground truth that belongs to a file for release.

    Its rows are copied when it is complete, so both are files of this machine. Raises OSError and
    SpecError.
    """
    from scenegen.common.records import check
    from scenegen.files.new_file import check_writable
    from scenegen.rooms.withheld import truth_path

    check("://" not in out, "--hold-out-truth", out, "a path of this machine")
    check_writable(Path(out), overwrite)
    return str(truth_path(out))


def _print_exposure(out: str) -> None:
    """Say how much of 8-bit images is saturated or black, from some rows of a file."""
    from scenegen.files.places import as_place, is_remote
    from scenegen.files.verify import spread_rows
    from scenegen.rooms.exposure import clipped_shares, exposure_text, exposure_warnings
    from scenegen.rooms.info import SAMPLED
    from scenegen.rooms.reader import RoomsFile

    place = as_place(out)
    if is_remote(place):  # whose rows would have to be fetched
        return
    with RoomsFile(place) as rooms:
        shares = clipped_shares(rooms, spread_rows(len(rooms), SAMPLED))
        interior = rooms.spec is not None and rooms.spec.interior
    if shares is not None:
        print_line(f"{out}: {exposure_text(shares)}")
        for text in exposure_warnings(shares, interior):
            print_line(f"warning: {out}: {text}", err=True)


def _set_bytes(out: str) -> int:
    """Return the size of a file of rooms and of its shards, if it has any."""
    from scenegen.files.places import as_place, listing
    from scenegen.files.sets.shards import name_of_set

    place = as_place(out)
    files = [one for one in listing(place.parent) if name_of_set(one.name) == place.name]
    return sum(file.stat().st_size for file in (place, *files))


@contextmanager
def _resume_hint(out: str) -> Iterator[None]:
    """Print how many shards are complete, and how to resume, if the block is interrupted."""
    from scenegen.files.places import as_place
    from scenegen.files.sets.making import complete_parts, parts_folder

    try:
        yield
    except KeyboardInterrupt:
        with suppress(OSError):
            if done := len(complete_parts(parts_folder(as_place(out)))):
                text = f"{done} shards are complete; re-run the same command to resume"
                print_line(f"{out}: {text}", err=True)
        raise


@click.command(epilog=f"{EXAMPLE}scenegen merge rooms.h5 --out one.h5")
@click.argument("file", type=InputPath())
@click.option("--out", type=NewHdf5(), required=True, help="Output file.")
@OVERWRITE
def merge(file: str, out: str, overwrite: bool) -> None:
    """Merge the shards of the rooms file FILE into one file."""
    from scenegen.rooms.make import merge_rooms
    from scenegen.rooms.reader import RoomsFile

    with RoomsFile(file) as rooms, progress_bar(len(rooms), "image") as bar:
        count = len(rooms)
        merge_rooms(rooms, out, overwrite, bar.update)
    print_line(f"{out}: {count} images, {Path(out).stat().st_size / 1e6:.1f} MB")


@click.command(epilog=f"{EXAMPLE}scenegen presets")
def presets() -> None:
    """List the presets of `scenegen render`, with the settings of each preset."""
    from scenegen.description.presets import PRESETS

    def shown(value: Any) -> str:
        return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)

    width = max(map(len, PRESETS))
    for name, preset in PRESETS.items():
        print_line(f"{name:{width}}  {preset.meaning}")
        options = (f"{key} {shown(value)}" for key, value in preset.settings.items())
        print_line(f"{'':{width}}  {', '.join(options) or 'the defaults'}")


COMMANDS = (render, merge, presets)

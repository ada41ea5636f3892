"""The command that checks a folder of meshes. Heavy imports happen inside it."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import (
    CACHE_DIR,
    MESH_FILES,
    MOST_PROCESSES,
    OVERWRITE,
    UP,
    Names,
)
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, OutputPath

if TYPE_CHECKING:
    from scenegen.objects.meshes.check import ModelCheck
    from scenegen.objects.meshes.listing import ModelFolder


@click.command(
    "check-objects",
    epilog=f"{EXAMPLE}scenegen check-objects ShapeNetCore.v2 --classes mug,bowl --jobs 4",
)
@click.argument("folder", type=InputPath(within=MESH_FILES))
@UP
@click.option("--classes", type=Names(), help="Categories to check, such as bowl,mug [all].")
@CACHE_DIR
@click.option(
    "--json", "json_path", type=OutputPath(), help="Output file with the result of every mesh."
)
@OVERWRITE
@click.option(
    "--jobs",
    type=click.IntRange(1, MOST_PROCESSES),
    default=1,
    show_default=True,
    help="Number of processes.",
)
@click.pass_context
def check_objects(
    ctx: click.Context,
    folder: str,
    up: str,
    classes: tuple[str, ...] | None,
    cache_dir: str | None,
    json_path: str | None,
    overwrite: bool,
    jobs: int,
) -> None:
    """Read and clean every mesh of FOLDER, as `scenegen render` does.

    FOLDER is ShapeNetCore, or has one sub-folder per category. The command prints counts per
    category, and why each refused mesh is refused. If no mesh is usable, or if two splits share an
    object, the exit code is 1.
    """
    from scenegen.files.new_file import check_writable, write_text
    from scenegen.objects.cache import default_cache_dir
    from scenegen.objects.meshes.check import check_models
    from scenegen.objects.meshes.folders import open_models
    from scenegen.objects.meshes.listing import shared_by_splits
    from scenegen.objects.sources import folder_notes

    if json_path:
        check_writable(Path(json_path), overwrite)
    found = open_models(folder, classes, up)
    cache = Path(cache_dir) if cache_dir else default_cache_dir()
    total = sum(map(len, found.models.values()))
    with progress_bar(total, "model") as bar:
        records = check_models(found, cache, jobs, bar.update)
    if json_path:
        write_text(json_path, _json(found, records), overwrite)
    for line in [*_table(found, records), *folder_notes(found)]:
        print_line(line)
    shared = shared_by_splits(found.splits)
    for first, second in shared:
        print_line(
            f"error: the same object is in two splits: {first} and {second} have equal content"
        )
    ctx.exit(0 if any(record.ok for record in records) and not shared else 1)


def _table(folder: "ModelFolder", records: Sequence["ModelCheck"]) -> Iterator[str]:
    by_name = {record.name: record for record in records}
    groups = {name: [by_name[file.name] for file in folder.models[name]] for name in folder.classes}
    width = max(len(name) for name in [*groups, "category", "total"])
    columns = " ".join(f"{name:>8}" for name in ("meshes", "ok", "repaired", "refused"))
    yield f"{'category':{width}}  {columns} {'faces':>10}"
    for name, some in [*groups.items(), ("total", list(records))]:
        ok = sum(record.ok for record in some)
        mended = sum(record.was_mended for record in some)
        faces = sum(record.faces for record in some)
        yield f"{name:{width}}  {len(some):8} {ok:8} {mended:8} {len(some) - ok:8} {faces:10}"
    for record in records:
        if not record.ok:
            yield f"refused  {record.name}: {record.reason}"


def _json(folder: "ModelFolder", records: Sequence["ModelCheck"]) -> str:
    names = ("name", "ok", "reason", "faces")
    models = [
        {name: getattr(record, name) for name in names}
        | {"mended": dict(record.mended), "seconds": round(record.seconds, 4)}
        for record in records
    ]
    about = {"kind": folder.kind, "up": folder.up, "digest": folder.digest(), "models": models}
    return json.dumps(about, indent=1, ensure_ascii=False) + "\n"


COMMANDS = (check_objects,)

"""Files of rooms, handed on: exported rows, and a data card."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from scenegen.common.records import check
from scenegen.description.specs import BUILT_IN
from scenegen.files.schema import Column
from scenegen.files.sets.manifest import manifest_path
from scenegen.layout import columns, fields, markdown_table
from scenegen.rooms.reader import RoomsFile
from scenegen.sharing.card import (
    HDF5,
    JSON,
    NAMES,
    DataDescription,
    Publication,
    SharedFile,
    shared_file,
    tool,
    write_card,
)
from scenegen.sharing.export import ExportedTable, write_export
from scenegen.sharing.index import IndexKind, Line, Tally, counts_table, write_index
from scenegen.sharing.rooms_texts import KEYWORDS, READING, RESPONSIBLE, SUMMARY


def export_rows(
    path: str | Path, form: str, folder: str | Path, rows: Sequence[int] | None = None, **how: Any
) -> list[Path]:
    """Write rows of a file of rooms, or of a set of shards, as `write_export`; return its files.

    Files are called `rooms-00000-of-00003.parquet` after `rooms.h5`. Data sets become columns:
    `camera/fov_y_degrees` is `camera_fov_y_degrees`.

    Args:
        how: `encoding`, `rows_per_file`, `overwrite` and `progress` of `write_export`.

    Raises as `write_export`; and OSError where there is no such file, FileFormatError where it is
    not one of rooms.
    """
    with RoomsFile(path) as rooms:
        table = ExportedTable(
            stem=Path(path).stem,
            what=f"rows of {rooms.path.name}, a file of rooms of pix2shape-bench",
            file=rooms,
            columns=[replace(c, name=c.name.replace("/", "_")) for c in columns(rooms.spec)],
            values=lambda stored: {name.replace("/", "_"): v for name, v in stored.items()},
        )
        return write_export(table, form, folder, rows, **how)


def make_rooms_card(
    files: Sequence[str | Path],
    folder: str | Path,
    publication: Publication,
    *,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write the data card of some files of rooms, or sets of shards, to a folder; return its files.

    The same files and the same publication give the same bytes with the same versions of pyarrow,
    `datasets` and mlcroissant. All values of the files are read once, for the digests in the index.

    Args:
        files: each one a file of rooms, or the file of a set of shards.
        folder: to make; with `overwrite`, an older card is replaced.
        publication: what only the person who publishes the data knows.
        progress: is told the number of rows that were read since the last call.

    Raises:
        OSError: as `write_card`, or there is no such file of rooms.
        FileFormatError: a file is not one of rooms, or is damaged.
        SpecError: two files have one name.
    """
    names = [*(Path(file).name for file in files), *NAMES]
    for name in names:
        expected = "different names, as all lie beside the card"
        check(names.count(name) == 1, "files", f"{name} twice", expected)

    def describe(index: Path) -> DataDescription:
        tables = [partial(RoomsFile, file) for file in files]
        return _description(files, write_index(index, ROOMS, tables, progress))

    return write_card(folder, publication, describe, overwrite)


def default_license(files: Sequence[str | Path]) -> str:
    """Return the licence of data in which nobody else has rights: CC-BY-4.0.

    Raises OSError and FileFormatError as `RoomsFile`, and SpecError where rooms show meshes that
    somebody made: on what terms their pictures may be handed on, only the publisher can know.
    """
    for file in files:
        with RoomsFile(file) as rooms:
            what, source = "none, and meshes that somebody made", rooms.spec.source
            expected = f"the licence under which pictures of {source} may be handed on"
            check(source in BUILT_IN, "license", what, expected)
    return "CC-BY-4.0"


def _line(rooms: RoomsFile, stored: Mapping[str, Any]) -> Line:
    """Return what a row's small data sets tell, in the columns of the index."""
    objects, lights = int(stored["object/count"]), int(stored["light/count"])
    return {
        "scene_index": int(stored["scene_index"]),
        "view_index": int(stored["view_index"]),
        "view_angle_degrees": float(stored["view_angle_degrees"]),
        "height": rooms.spec.height,
        "width": rooms.spec.width,
        "object_count": objects,
        "object_shapes": stored["object/model"][:objects],
        "object_visible_pixels": stored["object/visible_pixels"][:objects].tolist(),
        "camera_world_from_camera": stored["camera/world_from_camera"].tolist(),
        "camera_fov_y_degrees": float(stored["camera/fov_y_degrees"]),
        "light_count": lights,
        "light_position": stored["light/position"][:lights].tolist(),
        "light_color": stored["light/color"][:lights].tolist(),
    }


def _of_scene(keys: Callable[[Line], Sequence[Any]]) -> Callable[[Line], Sequence[Any]]:
    """Count a scene once: its first view stands for it."""
    return lambda line: keys(line) if line["view_index"] == 0 else ()


# fmt: off
ROOMS = IndexKind(
    columns=(
        Column("scene_index", (), "int64",
               meaning="which scene of its file the image shows, from 0"),
        Column("view_index", (), "int32", meaning="which view of that scene, from 0"),
        Column("view_angle_degrees", (), "float64",
               meaning="degrees about the vertical axis from the scene's view 0"),
        Column("height", (), "int32", meaning="pixels"),
        Column("width", (), "int32", meaning="pixels"),
        Column("object_count", (), "int32", meaning="number of objects in the scene"),
        Column("object_shapes", (-1,), "text", meaning="basic shape, or class and model as"
               " class/model, of each object; object id k is entry k - 1"),
        Column("object_visible_pixels", (-1,), "int32", meaning="pixels that show each object"),
        Column("camera_world_from_camera", (4, 4), "float64", meaning="rigid transform from the"
               " camera frame (x right, y up, looks along -z) to the world frame (y up), lengths in"
               " scene units"),
        Column("camera_fov_y_degrees", (), "float64", meaning="vertical field of view, degrees"),
        Column("light_count", (), "int32", meaning="number of point lights"),
        Column("light_position", (-1, 3), "float64",
               meaning="of each light, world frame, scene units"),
        Column("light_color", (-1, 3), "float64", meaning="of each light, linear RGB radiance"),
    ),
    digested=("image", "depth", "normal", "object_id", "scene"),
    line=_line,
    counts={
        "scenes by number of objects": _of_scene(lambda line: [line["object_count"]]),
        "scenes by number of lights": _of_scene(lambda line: [line["light_count"]]),
        "objects by shape or class": _of_scene(
            lambda line: [name.partition("/")[0] for name in line["object_shapes"]]
        ),
        "images by angle of the view, degrees": lambda line: [line["view_angle_degrees"]],
    },
    same="scene_sha256",
    verify="scenegen verify",
)
# fmt: on


def _description(files: Sequence[str | Path], tallies: Sequence[Tally]) -> DataDescription:
    """Return what is to be told of files, of which every byte is read, for their SHA-256."""
    shared: list[SharedFile] = []
    head = ("file", "images", "scenes", "image", "seed", "objects from", "fingerprint")
    facts, names, commands, requests, tools = [head], [], {}, {}, set()
    for file, tally in zip(files, tallies, strict=True):
        with RoomsFile(file) as rooms:
            spec, texts, name = rooms.spec, rooms.attributes, rooms.path.name
            names.append(name)
            counts = str(tally.rows), str(len(tally.digests))
            size = f"{spec.height}x{spec.width}, {spec.image_dtype}"
            source = f"{spec.source}, {spec.object_split}"
            facts.append((name, *counts, size, str(spec.seed), source, rooms.fingerprint))
            commands[name], requests[name] = texts["creation_command"], spec.to_json()
            tools.add(tool(texts))
            shared += _files_of(rooms)
    return DataDescription(
        summary=SUMMARY,
        keywords=KEYWORDS,
        files=shared,
        columns=ROOMS.all_columns,
        key=("file", "row"),
        rows=sum(tally.rows for tally in tallies),
        facts={"Files": facts, "What they hold": counts_table("images", names, tallies)},
        commands=commands,
        requests=requests,
        layout=markdown_table(_all_fields(files)),
        responsible={**RESPONSIBLE, "machine_annotation_tools": sorted(tools)},
        notes={"Reading": READING, "Splits": _splits(tallies)},
    )


def _all_fields(files: Sequence[str | Path]) -> list[Column]:
    """Return the columns of all files, each once."""
    every: dict[str, Column] = {}
    for file in files:
        with RoomsFile(file) as rooms:
            every |= {field.name: field for field in fields(rooms.spec)}
    return list(every.values())


def _files_of(rooms: RoomsFile) -> list[SharedFile]:
    """Return the file, and for a set its shards and its manifest."""
    parts = [path for path, _ in rooms.parts]
    if parts == [rooms.path]:
        return [shared_file(rooms.path, HDF5, "rooms with ground truth")]
    files = [shared_file(rooms.path, HDF5, "shows its shards as one file")]
    files += [shared_file(path, HDF5, f"shard of {rooms.path.name}") for path in parts]
    manifest = manifest_path(rooms.path)
    if manifest.is_file():
        files.append(shared_file(manifest, JSON, f"manifest of {rooms.path.name}"))
    return files


def _splits(tallies: Sequence[Tally]) -> str:
    """Return how the files may be used as splits, and whether they share scenes."""
    every: set[str] = set().union(*(tally.digests for tally in tallies))
    shared = sum(len(tally.digests) for tally in tallies) - len(every)
    apart = "Views of one scene are in one file, next to each other: split by scene, never by row."
    if len(tallies) == 1:
        return f"The file is one split. {apart}"
    if shared:
        return f"**{shared} scenes are in more than one file**: these are no splits. {apart}"
    return f"Each file is a split of its own: no scene is in two of them. {apart}"

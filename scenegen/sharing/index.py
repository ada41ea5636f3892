"""The index of files of rooms: a Parquet file with a line for each row, and no pixels."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.common.errors import FileFormatError
from scenegen.files.content import column_digest, row_digest
from scenegen.files.rows import RowBlock
from scenegen.files.shards import cut
from scenegen.layout import FIELDS
from scenegen.rooms.reader import RoomsFile
from scenegen.sharing.columns import decoded
from scenegen.sharing.description import IndexColumn
from scenegen.sharing.index_file import write_lines

DIGESTS = ("image", "depth", "normal", "object_id", "scene")  # data sets whose rows get a digest
READ_ROWS = 16  # whose pixels are in memory at once

# fmt: off
COLUMNS = (
    IndexColumn("file", "Text", "name of the file of rooms to open; of a set, the file that shows"
                " all shards as one"),
    IndexColumn("row", "Int64", "row in that file, from 0"),
    IndexColumn("part", "Text", "name of the file that holds the row: the same, or a shard"),
    IndexColumn("part_row", "Int64", "row in the part, from 0"),
    IndexColumn("scene_index", "Int64", "which scene of its file the image shows, from 0"),
    IndexColumn("view_index", "Int32", "which view of that scene, from 0"),
    IndexColumn("view_angle_degrees", "Float64", "degrees about the vertical axis from the scene's"
                " view 0"),
    IndexColumn("height", "Int32", "pixels"),
    IndexColumn("width", "Int32", "pixels"),
    IndexColumn("object_count", "Int32", "number of objects in the scene"),
    IndexColumn("object_shapes", "Text", "basic shape, or class and model as class/model, of each"
                " object; object id k is entry k - 1", (-1,)),
    IndexColumn("object_visible_pixels", "Int32", "pixels that show each object", (-1,)),
    IndexColumn("camera_world_from_camera", "Float64", "rigid transform from the camera frame (x"
                " right, y up, looks along -z) to the world frame (y up), lengths in scene units",
                (4, 4)),
    IndexColumn("camera_fov_y_degrees", "Float64", "vertical field of view, degrees"),
    IndexColumn("light_count", "Int32", "number of point lights"),
    IndexColumn("light_position", "Float64", "of each light, world frame, scene units", (-1, 3)),
    IndexColumn("light_color", "Float64", "of each light, linear RGB radiance", (-1, 3)),
    *(IndexColumn(f"{name}_sha256", "Text", f"SHA-256 of the row's {name} as it is stored:"
                  f" {'UTF-8 and a zero byte' if name == 'scene' else 'C order, little-endian'}")
      for name in DIGESTS),
)
# fmt: on


@dataclass
class Tally:
    """What the rows of one file hold.

    Attributes:
        rows, scenes: their numbers.
        objects, lights: how many scenes have so many.
        shapes: how many objects of all scenes have a shape or class.
        views: degrees of the views of scenes.
        digests: SHA-256 of each scene's description, 32 bytes.
    """

    rows: int = 0
    scenes: int = 0
    objects: Counter[int] = field(default_factory=Counter)
    lights: Counter[int] = field(default_factory=Counter)
    shapes: Counter[str] = field(default_factory=Counter)
    views: Counter[float] = field(default_factory=Counter)
    digests: set[bytes] = field(default_factory=set)

    def add(self, line: dict[str, Any]) -> None:
        """Count one line of the index; the first view of a scene stands for the scene."""
        self.rows += 1
        self.views[line["view_angle_degrees"]] += 1
        if line["view_index"] == 0:
            self.scenes += 1
            self.objects[line["object_count"]] += 1
            self.lights[line["light_count"]] += 1
            self.shapes.update(name.partition("/")[0] for name in line["object_shapes"])
            self.digests.add(bytes.fromhex(line["scene_sha256"]))


def write_index(
    path: Path,
    files: Sequence[str | Path],
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Tally]:
    """Write the index of some files of rooms; return what each of them holds.

    All pixels are read once, for their digests.

    Raises OSError and FileFormatError as `RoomsFile`, and FileFormatError where a row is damaged or
    values are not those that were written.
    """
    tallies: list[Tally] = []
    write_lines(path, COLUMNS, _counted(files, tallies, progress))
    return tallies


def _counted(
    files: Sequence[str | Path], tallies: list[Tally], progress: Callable[[int], Any]
) -> Iterator[dict[str, Any]]:
    """Yield the lines of all files; append a tally of each file's lines."""
    for file in files:
        tallies.append(Tally())
        with RoomsFile(file) as rooms:
            for line in _lines(rooms):
                tallies[-1].add(line)
                progress(1)
                yield line


def _lines(rooms: RoomsFile) -> Iterator[dict[str, Any]]:
    """Yield the lines of one file; check at the end that its digests are those that are stored."""
    places = ((path.name, row) for path, count in rooms.parts for row in range(count))
    found = {field.name: bytearray() for field in FIELDS}
    for some in cut(len(rooms), READ_ROWS):
        block = RowBlock(rooms, some)
        for row in some:
            digests = {name: row_digest(block.read(name, row)) for name in found}
            for name, digest in digests.items():
                found[name] += digest
            part, part_row = next(places)
            yield {
                "file": rooms.path.name,
                "row": row,
                "part": part,
                "part_row": part_row,
                "height": rooms.spec.height,
                "width": rooms.spec.width,
                **_described(block, row, f"{rooms.path}: object/model"),
                **{f"{name}_sha256": digests[name].hex() for name in DIGESTS},
            }
    for name, stored in rooms.stored_digests().items():
        if name in found and column_digest([bytes(found[name])]) != stored:
            wrong = f"values of {name} that are not those which were written"
            raise FileFormatError(rooms.path, wrong, "", "scenegen verify tells which")


def _described(block: RowBlock, row: int, place: str) -> dict[str, Any]:
    """Return what a row's small data sets tell."""

    def value(name: str) -> Any:
        return np.asarray(block.read(name, row)).tolist()

    objects, lights = value("object/count"), value("light/count")
    models = decoded(block.read("object/model", row)[:objects], f"{place}, row {row}")
    return {
        "scene_index": value("scene_index"),
        "view_index": value("view_index"),
        "view_angle_degrees": value("view_angle_degrees"),
        "object_count": objects,
        "object_shapes": models,
        "object_visible_pixels": value("object/visible_pixels")[:objects],
        "camera_world_from_camera": value("camera/world_from_camera"),
        "camera_fov_y_degrees": value("camera/fov_y_degrees"),
        "light_count": lights,
        "light_position": value("light/position")[:lights],
        "light_color": value("light/color")[:lights],
    }

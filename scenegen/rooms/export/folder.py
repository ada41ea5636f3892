"""Write rows of a file of rooms to the folder that another tool reads.

A folder has files of that tool only, and CONVENTIONS: units, frames and encodings as JSON.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenegen.common.names import check_choice
from scenegen.common.records import check
from scenegen.files.new_file import folder_written_beside
from scenegen.objects.catalogue import Objects
from scenegen.rooms.export.encoding import Encoding, plain, write_json
from scenegen.rooms.export.formats import FOLDER_FORMATS
from scenegen.rooms.reader import Room, RoomsFile

CONVENTIONS = "conventions.json"


@dataclass(frozen=True, eq=False)
class Source:
    """What a writer of a folder reads.

    Attributes:
        rooms: the file.
        scenes: number of each scene, and those of its rows that are written.
        encoding: of pictures.
        objects: what the scenes are made of; None for `objects_of` their spec.
        device: where masks of whole objects are rendered, as in `backend.DEVICES`.
        progress: called with the number of rows written since the last call.
    """

    rooms: RoomsFile
    scenes: dict[int, list[int]]
    encoding: Encoding
    objects: Objects | None
    device: str
    progress: Callable[[int], Any]

    @property
    def unit(self) -> str:
        """The unit of lengths, in words."""
        return "metre" if self.rooms.spec.interior else "scene unit: the edge of the room"

    def views(self) -> Iterator[tuple[int, list[Room]]]:
        """Yield the number of each scene and its rows."""
        for scene, rows in self.scenes.items():
            yield scene, self.rooms[rows]
            self.progress(len(rows))


# Writes a folder and returns what CONVENTIONS says besides the usual.
Writer = Callable[[Source, Path], dict[str, Any]]


def export_folder(
    rooms: RoomsFile,
    form: str,
    folder: str | Path,
    rows: Sequence[int] | None = None,
    *,
    encoding: Encoding | None = None,
    objects: Objects | None = None,
    device: str = "auto",
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> Path:
    """Write rows, all by default, to a folder that appears when it is complete; return it.

    Args:
        form: one of FOLDER_FORMATS.
        encoding: of pictures; None for `encoding.plain`.
        overwrite: replace an older folder of this function.

    Raises:
        SpecError: an unknown format, or one that has no panoramas; no rows, rows out of range or
            twice; a value that does not fit into its encoding.
        OSError: as `folder_written_beside`.
        FileFormatError: a row is damaged.
    """
    check_choice("format", form, FOLDER_FORMATS)
    kind = rooms.spec.projection  # "coco" has masks alone
    check(kind == "perspective" or form == "coco", f"format {form}", kind, "perspective cameras")
    chosen = list(range(len(rooms)) if rows is None else rows)
    good = len(chosen) > 0 and min(chosen) >= 0 and max(chosen) < len(rooms)
    check(good, "items", f"{len(chosen)} rows", f"rows from 0 to {len(rooms) - 1}")
    check(len(set(chosen)) == len(chosen), "items", "a row twice", "each row once")
    scenes: dict[int, list[int]] = {}
    for row in chosen:
        scenes.setdefault(int(rooms.read("scene_index", row)), []).append(row)
    encoding = encoding or plain(rooms.spec.interior)
    source = Source(rooms, scenes, encoding, objects, device, progress)
    with folder_written_beside(folder, _older_names(Path(folder)), overwrite) as made:
        write: Writer = FOLDER_FORMATS[form].load_writer()
        conventions = write(source, made)
        about = {
            "format": form,
            "source": {"file": rooms.path.name, "fingerprint": rooms.fingerprint},
            **conventions,
            "files": sorted([*os.listdir(made), CONVENTIONS]),
        }
        write_json(made / CONVENTIONS, about)
    return Path(folder)


def _older_names(folder: Path) -> list[str]:
    """Return what an older export wrote to a folder, as its conventions list it."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        about = json.loads((folder / CONVENTIONS).read_text(encoding="utf-8"))
        listed = set(about["files"]) & set(os.listdir(folder))
        return [f"{name}/" if (folder / name).is_dir() else name for name in sorted(listed)]
    return []

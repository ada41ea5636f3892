"""Files of rooms, handed on: what exports and data cards tell of them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scenegen.common.records import check
from scenegen.description.specs import BUILT_IN
from scenegen.layout import columns, fields, markdown_table
from scenegen.rooms.reader import RoomsFile
from scenegen.sharing.card import TEMPLATES, Publication, with_shards, write_card
from scenegen.sharing.task import Task

KEYWORDS = (
    "synthetic", "3d", "depth-estimation", "surface-normals", "single-image-3d",
    "inverse-graphics", "ground-truth", "pix2shape-bench",
)  # fmt: skip


def _flat(name: str) -> str:
    """Return the name of a data set as that of a column: `camera_fov_y_degrees`."""
    return name.replace("/", "_")


ROOMS = Task(
    what="a file of rooms of pix2shape-bench",
    exported=lambda rooms: [replace(c, name=_flat(c.name)) for c in columns(rooms.spec)],
    values=lambda stored: {_flat(name): value for name, value in stored.items()},
)


def write_rooms_card(
    path: str | Path, rooms: Sequence[RoomsFile], publication: Publication, overwrite: bool = False
) -> None:
    """Write the data card of open files of rooms, or sets of shards. Raises as `write_card`."""
    files: list[tuple[Path, str]] = []
    for file in rooms:
        files += with_shards(file.opened, "rooms with ground truth")
    interior = {file.spec.interior for file in rooms}
    check(len(interior) == 1, "files", "interiors and other rooms", "one card for each")
    scenes = [{file.read("scene", row) for row in range(len(file))} for file in rooms]
    facts = [
        {
            "file": file.path.name,
            "images": str(len(file)),
            "scenes": str(len(texts)),
            "image": f"{file.spec.height}x{file.spec.width}, {file.spec.image_dtype}",
            "seed": str(file.spec.seed),
            "objects from": f"{file.spec.source}, {file.spec.object_split}",
            "fingerprint": file.fingerprint,
        }
        for file, texts in zip(rooms, scenes, strict=True)
    ]
    write_card(
        path, publication, TEMPLATES / "rooms.md", rooms, files, overwrite,
        keywords=KEYWORDS,
        facts=facts,
        columns=markdown_table({f.name: f for file in rooms for f in fields(file.spec)}.values()),
        interior=interior.pop(),
        several=len(rooms) > 1,
        shared=sum(map(len, scenes)) - len(set[bytes]().union(*scenes)),
    )  # fmt: skip


def default_license(rooms: Sequence[RoomsFile]) -> str:
    """Return the licence of data in which nobody else has rights: CC-BY-4.0.

    Raises SpecError where rooms show meshes, materials or surroundings that somebody made: on what
    terms their pictures may be handed on, only the publisher can know.
    """
    for file in rooms:
        what, source = "none, and meshes from a folder", file.spec.source
        expected = f"the licence under which images of {source} may be published"
        check(source in BUILT_IN, "license", what, expected)
        assets = " and ".join(n for n in ("materials", "environment") if getattr(file.spec, n, ""))
        what, expected = f"none, and {assets} from files", "the licence for images of these files"
        check(not assets, "license", what, expected)
    return "CC-BY-4.0"

"""What a data card tells of files of rooms: facts that were counted, and texts on their use."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenegen.common.records import check
from scenegen.common.text_table import printable
from scenegen.description.specs import BUILT_IN
from scenegen.files.manifest import manifest_path
from scenegen.layout import markdown_table
from scenegen.rendering.backend import VERSION_ATTRIBUTES
from scenegen.rooms.reader import RoomsFile
from scenegen.sharing.description import (
    HDF5,
    JSON,
    PARQUET,
    DataDescription,
    Publication,
    SharedFile,
    shared_file,
)
from scenegen.sharing.index import COLUMNS, Tally

Facts = dict[str, list[tuple[str, ...]]]
MOST_SHOWN = 200  # different values of a count
KEYWORDS = (
    "synthetic", "3d", "depth-estimation", "surface-normals", "single-image-3d",
    "inverse-graphics", "ground-truth", "pix2shape-bench",
)  # fmt: skip
SUMMARY = (
    "Synthetic images of a room's corner that holds a few objects, rendered by a program, with the"
    " exact ground truth of each pixel (depth, surface normal, object id) and of each scene"
    " (camera, lights, materials, objects and their poses)."
)
READING = """The HDF5 files are read by any HDF5 library. In Python:

    import h5py

    with h5py.File(name) as f:
        depth = f["depth"][row]  # (H, W) float32, planar, scene units
        radiance = f["image"][row] * f["image"].attrs["scale"]  # (H, W, 3) linear RGB

`datasets.load_dataset(folder, "index")` reads the index, and so does `mlcroissant` by
`croissant.json`. Lengths are in scene units: the room's edge is 1. World frame: right-handed, y up,
the floor at y = 0, walls at x = 0 and z = 0. Camera frame: x right, y up, looks along -z. Images
are linear: no gamma is applied."""
RESPONSIBLE: dict[str, str | list[str]] = {
    "dataCollection": "Nothing was collected. Scenes are drawn by a program from a specification"
    " and a seed, and rendered by ray casting; the ground truth is what the rays hit. The page"
    " README.md has the commands and all settings.",
    "dataCollectionType": ["Software Collection"],
    "dataCollectionMissingData": "Depth is NaN, the normal zero and the object id -1 where a"
    " pixel's ray meets nothing. Nothing else is missing and nothing is filled in.",
    "dataPreprocessingProtocol": [
        "None: values are stored as they were rendered. Images of 8 bits are linear radiance from"
        " 0 to 1, clipped and rounded to 255 steps."
    ],
    "dataAnnotationProtocol": [
        "No person labelled anything. Depth, normals and object ids are computed for the one ray"
        " through each pixel's centre, from the same scene that gives the image."
    ],
    "dataUseCases": [
        "Training and testing methods that estimate depth, normals, objects or new views from a"
        " single image, where exact ground truth is needed.",
        "Comparing such methods under one protocol, with bench score of pix2shape-bench.",
        "Not for deciding how well a method does on photographs, and not for uses that concern"
        " people: no data of this kind is in the files.",
    ],
    "dataLimitations": [
        "Rooms are a floor and two walls, without texture, windows or clutter, and hold a few"
        " objects. The camera looks at a fixed point from a fixed distance.",
        "With the paper's shading equation there are no shadows and no indirect light, unless the"
        " settings say so; there is no noise of a sensor, no blur and no distortion of a lens.",
        "Depth belongs to the ray through a pixel's centre; at silhouettes it is not the mean over"
        " the pixel.",
    ],
    "dataBiases": [
        "All images are synthetic, and of one kind of room. Shapes or classes are drawn with equal"
        " probability, not as often as they occur in homes.",
        "Objects that would show too few pixels, or that the border would cut, are drawn again"
        " unless the settings say otherwise; so large and central objects are favoured.",
        "The built-in everyday objects are of nine classes, in proportions that a program draws.",
    ],
    "personalSensitiveInformation": [
        "None: no people, no places, no text. The recorded commands hold names of files of those"
        " who made the data."
    ],
    "dataSocialImpact": "None is expected: the images show no people, and nothing that exists.",
    "dataReleaseMaintenancePlan": "A file is not changed after it is published; a correction gets a"
    " new version and new SHA-256s.",
}


def check_names(files: Sequence[str | Path], taken: Sequence[str]) -> None:
    """Raise SpecError where two files would have one name beside the card."""
    names = [Path(file).name for file in files]
    for name in (*names, *taken):
        twice = (*names, *taken).count(name) > 1
        check(not twice, "files", f"{name} twice", "different names, as all lie beside the card")


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


def describe_rooms(
    files: Sequence[str | Path], tallies: Sequence[Tally], index: Path, publication: Publication
) -> DataDescription:
    """Return what is to be told of files, given their tallies and the index that was written.

    Every byte of the files is read, for their SHA-256. Raises as `RoomsFile`, and OSError.
    """
    listed: list[SharedFile] = []
    facts: Facts = {
        "Files": [("file", "images", "scenes", "image", "seed", "objects from", "fingerprint")],
        "What they hold": _counts(tallies),
        "Versions": [("file", "written by", "Mitsuba", "Dr.Jit", "LLVM", "variant")],
    }
    commands, requests, tools = {}, {}, set()
    for file, tally in zip(files, tallies, strict=True):
        with RoomsFile(file) as rooms:
            spec, name = rooms.spec, rooms.path.name
            told = {key: str(value) for key, value in rooms.attributes.items()}
            versions = [told.get(key, "unknown") for key in VERSION_ATTRIBUTES]
            source = f"{spec.source}, {spec.object_split}"
            size = f"{spec.height}x{spec.width}, {spec.image_dtype}"
            counts = (str(tally.rows), str(tally.scenes), size, str(spec.seed))
            facts["Files"].append((name, *counts, source, rooms.fingerprint))
            writer, variant = told.get("writer", ""), told.get("variant", "")
            facts["Versions"].append((name, writer, *versions, variant))
            commands[name] = told.get("creation_command", "")
            requests[name] = spec.to_json()
            tools.add(printable(f"{writer}, Mitsuba {versions[0]}"))
            listed += _files_of(rooms)
    listed.append(shared_file(index, PARQUET, "a line for each row, without pixels"))
    return DataDescription(
        publication=publication,
        summary=SUMMARY,
        keywords=KEYWORDS,
        files=tuple(listed),
        index=COLUMNS,
        index_file=index.name,
        rows=sum(tally.rows for tally in tallies),
        facts=facts,
        commands=commands,
        requests=requests,
        layout=markdown_table(),
        responsible={**RESPONSIBLE, "machineAnnotationTools": sorted(tools)},
        notes={"Reading": READING, "Splits": _splits(tallies)},
    )


def _files_of(rooms: RoomsFile) -> list[SharedFile]:
    """Return the file, and for a set its shards and its manifest."""
    parts = [path for path, _ in rooms.parts]
    if parts == [rooms.path]:
        return [shared_file(rooms.path, HDF5, "rooms with ground truth")]
    found = [shared_file(rooms.path, HDF5, "shows its shards as one file")]
    found += [shared_file(path, HDF5, f"shard of {rooms.path.name}") for path in parts]
    manifest = manifest_path(rooms.path)
    if manifest.is_file():
        found.append(shared_file(manifest, JSON, f"manifest of {rooms.path.name}"))
    return found


def _counts(tallies: Sequence[Tally]) -> list[tuple[str, ...]]:
    def joined(counters: Sequence[Counter[Any]]) -> str:
        total: Counter[Any] = sum(counters, Counter())
        shown = [f"{key}: {number}" for key, number in sorted(total.items())]
        more = [f"and {len(shown) - MOST_SHOWN} more"] if len(shown) > MOST_SHOWN else []
        return ", ".join(shown[:MOST_SHOWN] + more) or "none"

    return [
        ("what", "how many"),
        ("images", str(sum(t.rows for t in tallies))),
        ("scenes", str(sum(t.scenes for t in tallies))),
        ("scenes by number of objects", joined([t.objects for t in tallies])),
        ("scenes by number of lights", joined([t.lights for t in tallies])),
        ("objects by shape or class", joined([t.shapes for t in tallies])),
        ("images by angle of the view, degrees", joined([t.views for t in tallies])),
    ]


def _splits(tallies: Sequence[Tally]) -> str:
    """Return how the files may be used as splits, and whether they share scenes."""
    every: set[bytes] = set().union(*(tally.digests for tally in tallies))
    shared = sum(len(tally.digests) for tally in tallies) - len(every)
    apart = "Views of one scene are in one file, next to each other: split by scene, never by row."
    if len(tallies) == 1:
        return f"The file is one split. {apart}"
    if shared:
        return f"**{shared} scenes are in more than one file**: these are no splits. {apart}"
    return f"Each file is a split of its own: no scene is in two of them. {apart}"

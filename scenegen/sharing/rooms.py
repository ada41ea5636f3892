"""Files of rooms, handed on: what exports and data cards tell of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from scenegen.common.records import check
from scenegen.description.specs import BUILT_IN
from scenegen.files.schema import Column
from scenegen.files.sets.manifest import manifest_path
from scenegen.layout import columns, fields, markdown_table
from scenegen.rooms.reader import RoomsFile
from scenegen.sharing.card import NAMES, with_shards, write_card
from scenegen.sharing.publication import Publication
from scenegen.sharing.task import Line, Tally, Task

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
    "data_collection": "Nothing was collected. Scenes are drawn by a program from a specification"
    " and a seed, and rendered by ray casting; the ground truth is what the rays hit. The page"
    " README.md has the commands and all settings.",
    "data_collection_missing_data": "Depth is NaN, the normal zero and the object id -1 where a"
    " pixel's ray meets nothing. Nothing else is missing and nothing is filled in.",
    "data_preprocessing_protocol": [
        "None: values are stored as they were rendered. Images of 8 bits are linear radiance from"
        " 0 to 1, clipped and rounded to 255 steps."
    ],
    "data_annotation_protocol": [
        "No person labelled anything. Depth, normals and object ids are computed for the one ray"
        " through each pixel's centre, from the same scene that gives the image."
    ],
    "data_use_cases": [
        "Training and testing methods that estimate depth, normals, objects or new views from a"
        " single image, where exact ground truth is needed.",
        "Comparing such methods under one protocol, with bench score of pix2shape-bench.",
        "Not for deciding how well a method does on photographs, and not for uses that concern"
        " people: no data of this kind is in the files.",
    ],
    "data_limitations": [
        "Rooms are a floor and two walls, without texture, windows or clutter, and hold a few"
        " objects. The camera looks at a fixed point from a fixed distance.",
        "With the paper's shading equation there are no shadows and no indirect light, unless the"
        " settings say so; there is no noise of a sensor, no blur and no distortion of a lens.",
        "Depth belongs to the ray through a pixel's centre; at silhouettes it is not the mean over"
        " the pixel.",
    ],
    "data_biases": [
        "All images are synthetic, and of one kind of room. Shapes or classes are drawn with equal"
        " probability, not as often as they occur in homes.",
        "Objects that would show too few pixels, or that the border would cut, are drawn again"
        " unless the settings say otherwise; so large and central objects are favoured.",
        "The built-in everyday objects are of nine classes, in proportions that a program draws.",
    ],
    "personal_sensitive_information": [
        "None: no people, no places, no text. The recorded commands hold names of files of those"
        " who made the data."
    ],
}


# What differs in closed rooms.
INTERIOR_SUMMARY = (
    "Synthetic pictures of furnished rooms, path-traced by a program, with the exact ground truth"
    " of each pixel (depth, surface normal, object id) and of each scene (camera, size of the room,"
    " objects, their poses and what they stand on)."
)
INTERIOR_READING = """The HDF5 files are read by any HDF5 library. In Python:

    import h5py

    with h5py.File(name) as f:
        depth = f["depth"][row]  # (H, W) float32, planar, metres; NaN through windows
        picture = f["image"][row]  # (H, W, 3); sRGB where it has 8 bits, else linear radiance

`datasets.load_dataset(folder, "index")` reads the index, and so does `mlcroissant` by
`croissant.json`. Lengths are in metres. World frame: right-handed, y up, the room is the box from
the origin to `room/size`, its floor at y = 0. Camera frame: x right, y up, looks along -z."""
INTERIOR_RESPONSIBLE: dict[str, str | list[str]] = {
    "data_preprocessing_protocol": [
        "Truth is stored as it was rendered. Pictures of 8 bits are developed as by a camera:"
        " exposure, white balance and a tone curve, then sRGB. They are denoised where the settings"
        " say so."
    ],
    "data_limitations": [
        "Rooms are boxes with furniture of built-in families, and materials that a program draws"
        " unless the settings name others. Windows have no glass, and there are no mirrors.",
        "There is no blur and no distortion of a lens, and noise of a sensor only where the"
        " settings say so.",
        "Depth belongs to the ray through a pixel's centre; at silhouettes it is not the mean over"
        " the pixel.",
    ],
    "data_biases": [
        "All pictures are synthetic. What stands where follows rules that were written by hand, not"
        " counts in homes.",
        "Pictures that show few objects are drawn again, so views of bare walls are rare.",
        "The built-in objects are of 35 families, in proportions that a program draws.",
    ],
}


def make_rooms_card(
    rooms: Sequence[RoomsFile], folder: str | Path, publication: Publication, **how: Any
) -> list[Path]:
    """Write the data card of open files of rooms, or sets of shards, as `write_card`.

    Args:
        how: `overwrite` and `progress` of `write_card`.

    Raises as `write_card`, and SpecError where two files have one name.
    """
    names = [*(file.path.name for file in rooms), *NAMES]
    for name in names:
        expected = "different names, as all lie beside the card"
        check(names.count(name) == 1, "files", f"{name} twice", expected)
    files: list[tuple[Path, str]] = []
    for file in rooms:
        files += with_shards(file.opened, "rooms with ground truth", "shows its shards as one file")
        manifest = manifest_path(file.path)
        if file.opened.shards and manifest.is_file():
            files.append((manifest, f"manifest of {file.path.name}"))
    interior = [file.spec.interior for file in rooms]
    check(len(set(interior)) < 2, "files", "interiors and other rooms", "a card for each kind")
    task = INTERIORS if interior[0] else ROOMS
    return write_card(folder, publication, task, rooms, files, _notes, **how)


def default_license(rooms: Sequence[RoomsFile]) -> str:
    """Return the licence of data in which nobody else has rights: CC-BY-4.0.

    Raises SpecError where rooms show meshes, materials or surroundings that somebody made: on what
    terms their pictures may be handed on, only the publisher can know.
    """
    for file in rooms:
        what, source = "none, and meshes that somebody made", file.spec.source
        expected = f"the licence under which pictures of {source} may be handed on"
        check(source in BUILT_IN, "license", what, expected)
        assets = " and ".join(n for n in ("materials", "environment") if getattr(file.spec, n, ""))
        what, expected = f"none, and {assets} of others", "the licence of their pictures"
        check(not assets, "license", what, expected)
    return "CC-BY-4.0"


def _notes(tallies: Sequence[Tally]) -> dict[str, str]:
    """Return how the files may be used as splits, and whether they share scenes."""
    every: set[str] = set().union(*(tally.digests for tally in tallies))
    shared = sum(len(tally.digests) for tally in tallies) - len(every)
    apart = "Views of one scene are in one file, next to each other: split by scene, never by row."
    text = f"Each file is a split of its own: no scene is in two of them. {apart}"
    if shared:
        text = f"**{shared} scenes are in more than one file**: these are no splits. {apart}"
    return {"Splits": f"The file is one split. {apart}" if len(tallies) == 1 else text}


def _flat(name: str) -> str:
    """Return the name of a data set as that of a column: `camera_fov_y_degrees`."""
    return name.replace("/", "_")


def _facts(rooms: RoomsFile, tally: Tally) -> dict[str, str]:
    spec = rooms.spec
    return {
        "file": rooms.path.name,
        "images": str(tally.rows),
        "scenes": str(len(tally.digests)),
        "image": f"{spec.height}x{spec.width}, {spec.image_dtype}",
        "seed": str(spec.seed),
        "objects from": f"{spec.source}, {spec.object_split}",
        "fingerprint": rooms.fingerprint,
    }


def _layout(rooms: Sequence[RoomsFile]) -> str:
    """Return the table of the columns of all files, each once."""
    return markdown_table({f.name: f for file in rooms for f in fields(file.spec)}.values())


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
ROOMS = Task(
    unit="images",
    what="a file of rooms of pix2shape-bench",
    verify="scenegen verify",
    summary=SUMMARY,
    keywords=KEYWORDS,
    responsible=RESPONSIBLE,
    reading=READING,
    exported=lambda rooms: [replace(c, name=_flat(c.name)) for c in columns(rooms.spec)],
    values=lambda stored: {_flat(name): value for name, value in stored.items()},
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
    key=("file", "row"),
    line=_line,
    digested=("image", "depth", "normal", "object_id", "scene"),
    same="scene",
    counts={
        "scenes by number of objects": _of_scene(lambda line: [line["object_count"]]),
        "scenes by number of lights": _of_scene(lambda line: [line["light_count"]]),
        "objects by shape or class": _of_scene(
            lambda line: [name.partition("/")[0] for name in line["object_shapes"]]
        ),
        "images by angle of the view, degrees": lambda line: [line["view_angle_degrees"]],
    },
    facts=_facts,
    layout=_layout,
)
# fmt: on
LIGHTS = ("light_count", "light_position", "light_color")  # which closed rooms do not have
INTERIORS = replace(
    ROOMS,
    summary=INTERIOR_SUMMARY,
    reading=INTERIOR_READING,
    responsible={**RESPONSIBLE, **INTERIOR_RESPONSIBLE},
    columns=tuple(
        replace(column, meaning=column.meaning.replace("scene units", "metres"))
        for column in ROOMS.columns
        if column.name not in LIGHTS
    ),
    counts={name: of for name, of in ROOMS.counts.items() if "lights" not in name},
    line=lambda rooms, stored: {
        name: value for name, value in _line(rooms, stored).items() if name not in LIGHTS
    },
)

"""The HDF5 layout of question files: that of the released 3D-IQTT v2, and the group `truth`.

A training file has two tables of questions, in the groups `labeled` and `unlabeled`; the other
files have one, at the root. `truth` tells what is known of the questions of each table.
"""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
from numpy.typing import NDArray

from iqtt.perspective import columns as rooms
from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.kinds import DISTRACTOR_KINDS, OF_CUBES
from iqtt.questions.specs import SPLITS, QuestionSpec, SplitSpec
from iqtt.shapes.polycube import MAX_CUBES
from scenegen.common.records import LARGEST
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.row_file import writer_name
from scenegen.files.schema import DIGEST, Column, Format
from scenegen.layout import RELEASE, VARIANT
from scenegen.rendering.backend import VERSION_ATTRIBUTES

Array = NDArray[Any]
FORMAT_NAME = "pix2shape-bench/iqtt"
FORMAT_VERSION = "1.1"
# The datasets that scores depend on; `truth_digest` is the joint digest of those there.
SCORED = ("answers", "distractor_kind", "angle_degrees", "scene")
NO_CUBE = -128
ID_BYTES = 2 * MAX_CUBES
CONVENTIONS = (
    "unit: cube edge; world and camera: right-handed, y up, the camera on +z looks along -z; a cube"
    " at integer c fills [c, c + 1]; a shape turns about the centre of its bounding box, which lies"
    " at the world's origin: p_world = world_from_shape (p_shape - centre); image 0 is the"
    " reference, the others the answers; pixels: row 0 on top"
)
TASK = (
    "One option shows the shape of the reference, rotated. Which one? Every cube of a shape is"
    " visible in every image."
)
# Fingerprints, and digests of truth, are root attributes too: one of each table (`named`).
FORMAT = Format(
    FORMAT_NAME,
    FORMAT_VERSION,
    "question file",
    {
        "writer": ".+",
        "variant": VARIANT,
        **dict.fromkeys(VERSION_ATTRIBUTES, RELEASE),
        "spec": ".+",
        "split": "|".join(SPLITS),
        "task": ".+",
        "conventions": f"{re.escape(CONVENTIONS)}|{re.escape(rooms.CONVENTIONS)}",
        "creation_command": ".*",
        CONTENT_DIGEST: DIGEST,
    },
    optional=frozenset({"creation_command"}),
)
ROOT_TEXTS = ("format", "format_version", *FORMAT.texts)


def question_columns(spec: QuestionSpec) -> list[Column]:
    """Return the column of the images; with three answers it is that of the released files."""
    shape = (1 + spec.answers, spec.height, spec.width, 3)
    scale = {"scale": 1 / 255 if spec.image_dtype == "uint8" else 1.0}
    unit = rooms.developed(spec).get("unit", "linear radiance, times `scale`")
    frame = "pixels: row 0 on top"
    meaning = f"reference, then {spec.answers} answers; RGB"
    return [
        Column(
            "questions", shape, spec.image_dtype, unit, frame, meaning, own_chunk=True, more=scale
        )
    ]


def answer_column() -> Column:
    """Return the column of the right answers, as in the released files."""
    meaning = "which of the answers shows the reference's shape, from 0"
    return Column("answers", (), "uint8", meaning=meaning)


def named(attribute: str, part: str) -> str:
    """Return the name of a root attribute that each table of a file has, such as "fingerprint"."""
    return f"{attribute}_{part}".rstrip("_")


def truth_columns(spec: QuestionSpec, kinds: Sequence[str] = OF_CUBES) -> list[Column]:
    """Return the columns of `truth`: what images show, and the difficulty of each question.

    Args:
        kinds: the distractor types that there were when the file was made (`known_kinds`). Files
            of 1.0 did not name `near-mirror`, and called it `mirror`.
    """
    if not isinstance(spec, SplitSpec):
        assert isinstance(spec, PerspectiveSpec)
        return rooms.room_columns(spec)
    most, lights, images = spec.cubes[1], spec.lights[1], 1 + spec.answers
    coordinates = f"integer coordinates of the cubes of each shape; {NO_CUBE} in unused rows"
    shape_id = "canonical shape under the 24 rotations: its sorted cubes, two bytes each"
    kind = "of each answer, seen from the reference: -1 the right one, else an index into `names`"
    angle = "difficulty: smallest rotation from the reference's view to the right answer's"
    distance = "from the camera of all images to the world's origin; it lies on +z"
    # fmt: off
    columns = [
        Column("cube_count", (), "int32", "1", "-", "cubes of each of the shapes",
               within=(1, most)),
        Column("cubes", (images, most, 3), "int8", "cube edge", "-", coordinates),
        Column("shape_id", (images, ID_BYTES), "uint8", "1", "-", shape_id),
        Column("class_id", (images, ID_BYTES), "uint8", "1", "-",
               "the same, mirror images as one"),
        Column("world_from_shape", (images, 3, 3), "float64", "1", "world from shape",
               "rotation of each image's shape"),
        Column("light_count", (images,), "int32", "1", "-", "point lights of each image",
               within=(0, lights)),
        Column("light_position", (images, lights, 3), "float64", "cube edge", "world",
               "zero where unused"),
        Column("light_color", (images, lights, 3), "float64", "radiance", "RGB",
               "L_j; zero where unused"),
        Column("distractor_kind", (spec.answers,), "int8", "1", "-", kind,
               within=(-1, len(kinds) - 1), more={"names": list(kinds)}),
        Column("angle_degrees", (), "float64", "degree", "-", angle, within=(0, 180)),
        Column("visible_pixels", (images, most), "int32", "pixel", "-",
               "pixels that show each cube"),
        Column("camera_distance", (), "float64", "cube edge", "world", distance,
               within=(1e-3, LARGEST)),
    ]
    if spec.with_depth:
        columns.append(
            Column("depth", (images, spec.height, spec.width), "float32", "cube edge", "camera",
                   "planar depth; NaN on the background", own_chunk=True)
        )
    # fmt: on
    return columns


def known_kinds(group: Any) -> Sequence[str]:
    """Return the distractor types that the truth of a file names, if DISTRACTOR_KINDS begins so.

    Otherwise return OF_CUBES, which the file is then found not to name.
    """
    stored = group.get("distractor_kind") if isinstance(group, h5py.Group) else None
    names: Any = getattr(stored, "attrs", {})
    count = names.get_id("names").shape if "names" in names else (0,)
    earlier = DISTRACTOR_KINDS[: math.prod(count)]
    return earlier if earlier and list(names["names"]) == list(earlier) else OF_CUBES


def root_attributes(
    spec: QuestionSpec, renderer: Mapping[str, str], command: str
) -> dict[str, Any]:
    """Return the root attributes of a file.

    Args:
        renderer: Mitsuba's variant, and the versions that `rendering.backend.versions` gives.
        command: the command that made the file; empty where it must not be told, as it names the
            seed.
    """
    about = rooms if isinstance(spec, PerspectiveSpec) else None
    attributes = {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "writer": writer_name(),
        **renderer,
        "spec": spec.to_json(),
        "task": about.TASK if about else TASK,
        "conventions": about.CONVENTIONS if about else CONVENTIONS,
    }
    return {**attributes, "creation_command": command} if command else attributes


def truth_attributes(spec: QuestionSpec) -> dict[str, Any]:
    """Return the attributes of `truth`: what all images of a split share; nothing of rooms."""
    if not isinstance(spec, SplitSpec):
        return {}
    return {
        "fov_y_degrees": spec.fov_y_degrees,
        "ambient": spec.ambient,
        "reflectance": spec.reflectance,
        "background": spec.background,
        "attenuation": (0.0, 1.0),
    }

"""The HDF5 layout of question files: that of the released 3D-IQTT v2, and the group `truth`.

A training file has two tables of questions, in the groups `labeled` and `unlabeled`; the other
files have one, at the root. `truth` tells what is known of the questions of each table.
"""

import math
from typing import Any

from numpy.typing import NDArray

from iqtt.questions.specs import DISTRACTOR_KINDS, SplitSpec
from iqtt.shapes.polycube import MAX_CUBES
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.row_file import writer_name
from scenegen.files.table import Column
from scenegen.rendering.backend import VERSION_ATTRIBUTES

Array = NDArray[Any]
FORMAT_NAME = "pix2shape-bench/iqtt"
FORMAT_VERSION = "2.0"
OLD_VERSION = "1.2"  # the last of the format with one camera for all questions; still read
DIGESTS_SINCE = (1, 2)  # version from which on files have digests
CAMERAS_SINCE = (2, 0)  # version from which on each question tells its camera
# The datasets that scores depend on; `truth_digest` is the joint digest of those there.
SCORED = ("answers", "distractor_kind", "angle_degrees")
# Root attributes, all of them texts; fingerprints and digests of truth have a part's name as well.
ROOT_TEXTS = (
    *("format", "format_version", "writer", "variant", *VERSION_ATTRIBUTES),
    *("spec", "split", "task", "conventions", "creation_command", CONTENT_DIGEST),
)
NO_CUBE = -128
ID_BYTES = 2 * MAX_CUBES
CONVENTIONS = (
    "unit: cube edge; world and camera: right-handed, y up, the camera on +z looks along -z; a cube"
    " at integer c fills [c, c + 1]; a shape turns about the centre of its bounding box, which lies"
    " at the world's origin: p_world = world_from_shape (p_shape - centre); image 0 is the"
    " reference, the others the answers; pixels: row 0 on top"
)
TASK = (
    "One answer shows the shape of the reference, turned. Which one? Every cube of a shape shows in"
    " every picture."
)


def old_camera_distance(spec: SplitSpec) -> float:
    """Return the distance of the camera in files before format 2.0, cube edges.

    Their one camera framed the largest shape that was allowed, whatever the size of the image.
    """
    return 1.02 * spec.max_radius / math.sin(math.radians(spec.fov_degrees) / 2)


def question_columns(spec: SplitSpec) -> list[Column]:
    """Return the column of the images; with three answers it is that of the released files."""
    meaning = {
        "unit": "linear radiance, times `scale`",
        "shape": f"(Q, {1 + spec.answers}, H, W, 3)",
        "frame": "pixels: row 0 on top",
        "meaning": f"reference, then {spec.answers} answers; RGB",
        "scale": 1 / 255 if spec.image_dtype == "uint8" else 1.0,
    }
    shape = (1 + spec.answers, spec.height, spec.width, 3)
    return [Column("questions", shape, spec.image_dtype, True, meaning)]


def answer_column() -> Column:
    """Return the column of the right answers, as in the released files."""
    meaning = "which of the answers shows the reference's shape, from 0"
    return Column("answers", (), "uint8", attributes={"meaning": meaning})


def named(attribute: str, part: str) -> str:
    """Return the name of a root attribute that each table of a file has, such as "fingerprint"."""
    return f"{attribute}_{part}".rstrip("_")


def truth_columns(spec: SplitSpec, version: tuple[int, int] = CAMERAS_SINCE) -> list[Column]:
    """Return the columns of `truth`: shapes, views, lights and difficulty of each question."""
    most, lights, images = spec.cubes[1], spec.lights[1], 1 + spec.answers

    def column(
        name: str, shape: tuple[int, ...], dtype: str, unit: str, meaning: str, **more: Any
    ) -> Column:
        own_chunk = name == "depth"
        return Column(name, shape, dtype, own_chunk, {"unit": unit, "meaning": meaning, **more})

    coordinates = f"integer coordinates of the cubes of each shape; {NO_CUBE} in unused rows"
    shape_id = "canonical shape under the 24 rotations: its sorted cubes, two bytes each"
    kind = "of each answer: -1 the right one, else an index into `names`"
    angle = "difficulty: smallest rotation from the reference's view to the right answer's"
    columns = [
        column("cube_count", (), "int32", "1", "cubes of each of the shapes"),
        column("cubes", (images, most, 3), "int8", "cube edge", coordinates),
        column("shape_id", (images, ID_BYTES), "uint8", "1", shape_id),
        column("class_id", (images, ID_BYTES), "uint8", "1", "the same, mirror images as one"),
        column(
            "world_from_shape", (images, 3, 3), "float64", "1", "rotation of each image's shape"
        ),
        column("light_count", (images,), "int32", "1", "point lights of each image"),
        column(
            "light_position", (images, lights, 3), "float64", "cube edge", "world; unused: zero"
        ),
        column("light_color", (images, lights, 3), "float64", "radiance", "L_j; unused: zero"),
        column("distractor_kind", (spec.answers,), "int8", "1", kind, names=list(DISTRACTOR_KINDS)),
        column("angle_degrees", (), "float64", "degree", angle),
        column("visible_pixels", (images, most), "int32", "pixel", "pixels that show each cube"),
    ]
    if version >= CAMERAS_SINCE:
        text = "from the camera of all images to the world's origin; it lies on +z"
        columns.append(column("camera_distance", (), "float64", "cube edge", text))
    if spec.with_depth:
        text = "planar depth, camera frame; NaN on the background"
        columns.append(
            column("depth", (images, spec.height, spec.width), "float32", "cube edge", text)
        )
    return columns


def root_attributes(spec: SplitSpec, renderer: dict[str, str], command: str) -> dict[str, Any]:
    """Return the root attributes of a file.

    Args:
        renderer: Mitsuba's variant, and the versions that `rendering.backend.versions` gives.
        command: the command that made the file; empty where it must not be told, as it names the
            seed.
    """
    attributes = {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "writer": writer_name(),
        **renderer,
        "spec": spec.to_json(),
        "task": TASK,
        "conventions": CONVENTIONS,
    }
    return {**attributes, "creation_command": command} if command else attributes


def truth_attributes(spec: SplitSpec) -> dict[str, Any]:
    """Return the attributes of `truth`: what all images of a split share."""
    return {
        "fov_y_degrees": spec.fov_y_degrees,
        "ambient": spec.ambient,
        "reflectance": spec.reflectance,
        "background": spec.background,
        "attenuation": (0.0, 1.0),
    }

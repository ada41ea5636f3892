"""The HDF5 layout of question files: that of the released 3D-IQTT v2, and the group `truth`.

A training file has two tables of questions, in the groups `labeled` and `unlabeled`; the other
files have one, at the root. `truth` tells what is known of the questions of each table.
"""

from typing import Any

from numpy.typing import NDArray

from iqtt.questions.specs import DISTRACTOR_KINDS, SplitSpec
from iqtt.shapes.polycube import MAX_CUBES
from scenegen.common.hdf5.content import CONTENT_DIGEST
from scenegen.common.hdf5.row_file import Column, writer_name
from scenegen.rendering.backend import VERSION_ATTRIBUTES

Array = NDArray[Any]
FORMAT_NAME = "pix2shape-bench/iqtt"
FORMAT_VERSION = "1.2"
DIGESTS_SINCE = 2  # minor version from which on files have digests
# The datasets that scores depend on; `truth_digest` is the joint digest of those there.
SCORED = ("answers", "distractor_kind", "angle_degrees")
# Root attributes, all of them texts; fingerprints and digests of truth have a part's name as well.
ROOT_TEXTS = (
    *("format", "format_version", "writer", "variant", *VERSION_ATTRIBUTES),
    *("spec", "split", "conventions", "creation_command", CONTENT_DIGEST),
)
NO_CUBE = -128
ID_BYTES = 2 * MAX_CUBES
CONVENTIONS = (
    "unit: cube edge; world and camera: right-handed, y up, the camera on +z looks along -z; a cube"
    " at integer c fills [c, c + 1]; a shape turns about the centre of its bounding box, which lies"
    " at the world's origin: p_world = world_from_shape (p_shape - centre); image 0 is the"
    " reference, 1 to 3 the answers; pixels: row 0 on top"
)


def question_columns(spec: SplitSpec) -> list[Column]:
    """Return the column of the images, four a question, as in the released files."""
    meaning = {
        "unit": "linear radiance, times `scale`",
        "shape": "(Q, 4, H, W, 3)",
        "frame": "pixels: row 0 on top",
        "meaning": "reference, then three answers; RGB",
        "scale": 1 / 255 if spec.image_dtype == "uint8" else 1.0,
    }
    shape = (4, spec.height, spec.width, 3)
    return [Column("questions", shape, spec.image_dtype, True, meaning)]


def answer_column() -> Column:
    """Return the column of the right answers, as in the released files."""
    meaning = "which of images 1 to 3 shows the reference's shape, from 0"
    return Column("answers", (), "uint8", attributes={"meaning": meaning})


def named(attribute: str, part: str) -> str:
    """Return the name of a root attribute that each table of a file has, such as "fingerprint"."""
    return f"{attribute}_{part}".rstrip("_")


def truth_columns(spec: SplitSpec) -> list[Column]:
    """Return the columns of `truth`: shapes, views, lights and difficulty of each question."""
    most, lights = spec.cubes[1], spec.lights[1]

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
        column("cube_count", (), "int32", "1", "cubes of each of the four shapes"),
        column("cubes", (4, most, 3), "int8", "cube edge", coordinates),
        column("shape_id", (4, ID_BYTES), "uint8", "1", shape_id),
        column("class_id", (4, ID_BYTES), "uint8", "1", "the same, mirror images as one"),
        column("world_from_shape", (4, 3, 3), "float64", "1", "rotation of each image's shape"),
        column("light_count", (4,), "int32", "1", "point lights of each image"),
        column("light_position", (4, lights, 3), "float64", "cube edge", "world; unused: zero"),
        column("light_color", (4, lights, 3), "float64", "radiance", "L_j; unused: zero"),
        column("distractor_kind", (3,), "int8", "1", kind, names=list(DISTRACTOR_KINDS)),
        column("angle_degrees", (), "float64", "degree", angle),
        column("visible_pixels", (4, most), "int32", "pixel", "pixels that show each cube"),
    ]
    if spec.with_depth:
        text = "planar depth, camera frame; NaN on the background"
        columns.append(column("depth", (4, spec.height, spec.width), "float32", "cube edge", text))
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
        "conventions": CONVENTIONS,
    }
    return {**attributes, "creation_command": command} if command else attributes


def truth_attributes(spec: SplitSpec) -> dict[str, Any]:
    """Return the attributes of `truth`: camera and shading, which all images of a split share."""
    return {
        "world_from_camera": spec.camera.world_from_camera,
        "fov_y_degrees": spec.camera.fov_y_degrees,
        "ambient": spec.ambient,
        "reflectance": spec.reflectance,
        "background": spec.background,
        "attenuation": (0.0, 1.0),
    }

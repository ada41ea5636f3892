"""The HDF5 layout of a file of rooms, as a table: name, shape, type, unit, frame and meaning.

`python -m scenegen.layout` prints it as the table of `docs/rooms-file.md`.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scenegen.common.text_table import piped
from scenegen.description.specs import DatasetSpec
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.table import COMPRESSIONS, Column

FORMAT_NAME = "pix2shape-bench/rooms"
FORMAT_VERSION = "2.3"
TRUTH_DIGEST = "truth_digest"
CONVENTIONS = (
    "world: right-handed, y up, room = unit box with floor y = 0 and walls x = 0, z = 0; camera:"
    " x right, y up, looks along -z; pixels: row 0 on top, centres at +0.5; see docs/conventions.md"
)
# The datasets that scores depend on: the root attribute TRUTH_DIGEST is their joint digest.
SCORED = (
    "depth",
    "normal",
    "object_id",
    "scene_index",
    "view_index",
    "camera/world_from_camera",
    "camera/fov_y_degrees",
)


@dataclass(frozen=True)
class Field:
    """One dataset, with a row for each image.

    Attributes:
        axes: of a row, by size (H and W are the image's, K the object slots, L the light slots) or
            by name (FIXED).
        dtype: NumPy name; "image" stands for the spec's image type, "text" for UTF-8 strings.
        per_pixel: whether each row is stored as a chunk of its own, as images are.
    """

    name: str
    axes: tuple[str, ...]
    dtype: str
    unit: str
    frame: str
    meaning: str
    per_pixel: bool = False

    @property
    def shape(self) -> tuple[str, ...]:
        """Sizes of a row's axes, numbers where they are the same in all files."""
        return tuple(str(FIXED.get(axis, axis)) for axis in self.axes)


FIXED = {"channel": 3, "xyz": 3, "matrix_row": 4, "matrix_column": 4, "coefficient": 2}
NAMES = {"H": "y", "W": "x", "K": "object_slot", "K+1": "material_slot", "L": "light_slot"}
_MATRIX = ("matrix_row", "matrix_column")


# fmt: off
FIELDS = (
    Field("image", ("H", "W", "channel"), "image", "linear radiance, times `scale`",
          "pixels: row 0 on top",
          "RGB of the shading equation, or of path tracing (`spec`); stored value times"
          " `scale` is radiance (no gamma)", True),
    Field("depth", ("H", "W"), "float32", "scene unit", "camera",
          "planar depth, -z in the camera frame, of the one ray through the pixel's centre;"
          " NaN where it meets nothing", True),
    Field("normal", ("H", "W", "xyz"), "float32", "1", "camera",
          "unit surface normal of the same hit, facing the viewer; zero where nothing is hit",
          True),
    Field("object_id", ("H", "W"), "int8", "1", "pixels: row 0 on top",
          "what the same ray hits: -1 nothing, 0 the room, k the k-th object (from 1)", True),
    Field("scene_index", (), "int64", "1", "-", "which scene the image shows"),
    Field("view_index", (), "int32", "1", "-", "which view of that scene, from 0"),
    Field("view_angle_degrees", (), "float64", "degree", "-",
          "from the scene's input view (view 0), about the vertical axis"),
    Field("camera/world_from_camera", _MATRIX, "float64", "scene unit", "world from camera",
          "rigid transform; the camera looks along -z, x right, y up"),
    Field("camera/fov_y_degrees", (), "float64", "degree", "-",
          "vertical field of view; pixels are square, the principal point is the image's middle"),
    Field("light/count", (), "int32", "1", "-", "number of point lights"),
    Field("light/position", ("L", "xyz"), "float64", "scene unit", "world",
          "point lights; slots from light/count on are unused"),
    Field("light/color", ("L", "channel"), "float64", "radiance", "RGB",
          "L_j; zero in unused slots"),
    Field("light/ambient", ("channel",), "float64", "radiance", "RGB", "L_a"),
    Field("light/attenuation", ("coefficient",), "float64",
          "1 / scene unit, 1 / scene unit squared", "-", "k_l and k_q"),
    Field("material/reflectance", ("K+1", "channel"), "float64", "1", "RGB by object id",
          "rho of the room (row 0) and of each object (row k); zero in unused slots"),
    Field("material/specular", ("K+1",), "float64", "1", "by object id",
          "k_s of Phong's lobe; 0 for the room and in unused slots"),
    Field("material/shininess", ("K+1",), "float64", "1", "by object id",
          "exponent of Phong's lobe; 1 for the room and in unused slots"),
    Field("object/count", (), "int32", "1", "-", "number of objects"),
    Field("object/shape", ("K",), "int16", "1", "-",
          "basic shape or class, index into the attribute `names`; -1 in unused slots"),
    Field("object/model", ("K",), "text", "-", "-",
          "which model of the class, class/model; the shape's name for a basic shape"),
    Field("object/world_from_object", ("K", *_MATRIX), "float64", "scene unit",
          "world from object",
          "similarity that places the unit shape (bounding radius 1); zero in unused slots"),
    Field("object/scale", ("K",), "float64", "scene unit", "-",
          "bounding radius, the scale in world_from_object"),
    Field("object/visible_pixels", ("K",), "int32", "pixel", "-", "pixels that show the object"),
    Field("scene", (), "text", "-", "-", "full description of the scene, JSON"),
)
# fmt: on


def columns(spec: DatasetSpec) -> list[Column]:
    """Return the datasets of a file that answers that spec, with their attributes."""
    slots = spec.object_slots
    sizes = {"H": spec.height, "W": spec.width, "K": slots, "K+1": slots + 1}
    sizes |= {"L": spec.light_slots, **FIXED}
    found = []
    for field in FIELDS:
        attributes: dict[str, Any] = {
            "unit": field.unit,
            "frame": field.frame,
            "shape": "(" + ", ".join(("N", *field.shape)) + ")",
            "meaning": field.meaning,
        }
        if field.name == "image":
            attributes["scale"] = 1 / 255 if spec.image_dtype == "uint8" else 1.0
        if field.name == "object/shape":
            attributes["names"] = list(spec.shapes)
        shape = tuple(sizes[axis] for axis in field.axes)
        names = tuple(NAMES.get(axis, axis) for axis in field.axes)
        dtype = spec.image_dtype if field.dtype == "image" else field.dtype
        # A plane has one normal: 12 bytes again and again, which deflate packs better as they are.
        shuffle = field.name != "normal"
        found.append(Column(field.name, shape, dtype, field.per_pixel, attributes, names, shuffle))
    return found


def has_digests(attributes: Mapping[str, Any]) -> bool:
    """Return whether a file has digests and names of axes; formats 2.0 and 2.1 had none."""
    return CONTENT_DIGEST in attributes or attributes.get("format_version") not in ("2.0", "2.1")


def has_old_draws(attributes: Mapping[str, Any]) -> bool:
    """Return whether a file is older than format 2.3, which draws and shows other scenes."""
    return attributes.get("format_version") in ("2.0", "2.1", "2.2")


def root_problems(attributes: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each root attribute that is missing or cannot be true of any file."""
    expected = {**_ROOT, **(_DIGESTS if has_digests(attributes) else {})}
    if attributes.get("format_version") != "2.0":
        expected |= _VERSIONS
    problems = []
    for name, pattern in expected.items():
        found = attributes.get(name)
        if not (isinstance(found, str) and re.fullmatch(pattern, found, re.DOTALL)):
            problems.append(f"root attribute {name} is {found!r:.60}")
    return problems


_ROOT = {
    "format_version": r"2\.\d+",
    "writer": r"pix2shape-bench \S+",
    "variant": "(llvm_ad|cuda_ad|scalar)_rgb",
    "conventions": re.escape(CONVENTIONS),
    "compression": "|".join(COMPRESSIONS),
    "creation_command": ".*",
    "fingerprint": "[0-9a-f]{64}",
}
_VERSIONS = dict.fromkeys(("mitsuba_version", "drjit_version", "llvm_version"), r"unknown|\d\S*")
_DIGESTS = dict.fromkeys((TRUTH_DIGEST, CONTENT_DIGEST), "[0-9a-f]{64}")


def markdown_table() -> str:
    """Return the layout as a Markdown table."""
    rows = [("dataset", "row", "type", "unit", "frame", "meaning")]
    for f in FIELDS:
        row = "(" + ", ".join(f.shape) + ")"
        dtype = {"image": "`--image-dtype`", "text": "UTF-8 string"}.get(f.dtype, f.dtype)
        rows.append((f"`{f.name}`", row, dtype, f.unit, f.frame, f.meaning))
    return "\n".join(piped(rows))


if __name__ == "__main__":
    print(markdown_table())

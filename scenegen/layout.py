"""The HDF5 layout of a file of rooms, as a table: name, shape, type, unit, frame and meaning.

`python -m scenegen.layout` prints it as the table of `docs/rooms-file.md`.
"""

from dataclasses import dataclass
from typing import Any

from scenegen.common.row_file import Column
from scenegen.common.text_table import piped
from scenegen.description.specs import DatasetSpec

FORMAT_NAME = "pix2shape-bench/rooms"
FORMAT_VERSION = "2.2"
TRUTH_DIGEST = "truth_digest"
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
        shape: of a row; H and W are the image's size, K the object slots, L the light slots.
        dtype: NumPy name; "image" stands for the spec's image type, "text" for UTF-8 strings.
        per_pixel: whether each row is stored as a chunk of its own, as images are.
    """

    name: str
    shape: tuple[str | int, ...]
    dtype: str
    unit: str
    frame: str
    meaning: str
    per_pixel: bool = False


# fmt: off
FIELDS = (
    Field("image", ("H", "W", 3), "image", "linear radiance, times `scale`", "pixels: row 0 on top",
          "RGB of the shading equation, or of path tracing (`spec`); stored value times"
          " `scale` is radiance (no gamma)", True),
    Field("depth", ("H", "W"), "float32", "scene unit", "camera",
          "planar depth, -z in the camera frame, of the one ray through the pixel's centre;"
          " NaN where it meets nothing", True),
    Field("normal", ("H", "W", 3), "float32", "1", "camera",
          "unit surface normal of the same hit, facing the viewer; zero where nothing is hit",
          True),
    Field("object_id", ("H", "W"), "int8", "1", "pixels: row 0 on top",
          "what the same ray hits: -1 nothing, 0 the room, k the k-th object (from 1)", True),
    Field("scene_index", (), "int64", "1", "-", "which scene the image shows"),
    Field("view_index", (), "int32", "1", "-", "which view of that scene, from 0"),
    Field("view_angle_degrees", (), "float64", "degree", "-",
          "from the scene's input view (view 0), about the vertical axis"),
    Field("camera/world_from_camera", (4, 4), "float64", "scene unit", "world from camera",
          "rigid transform; the camera looks along -z, x right, y up"),
    Field("camera/fov_y_degrees", (), "float64", "degree", "-",
          "vertical field of view; pixels are square, the principal point is the image's middle"),
    Field("light/count", (), "int32", "1", "-", "number of point lights"),
    Field("light/position", ("L", 3), "float64", "scene unit", "world",
          "point lights; slots from light/count on are unused"),
    Field("light/color", ("L", 3), "float64", "radiance", "RGB", "L_j; zero in unused slots"),
    Field("light/ambient", (3,), "float64", "radiance", "RGB", "L_a"),
    Field("light/attenuation", (2,), "float64", "1 / scene unit, 1 / scene unit squared", "-",
          "k_l and k_q"),
    Field("material/reflectance", ("K+1", 3), "float64", "1", "RGB by object id",
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
    Field("object/world_from_object", ("K", 4, 4), "float64", "scene unit", "world from object",
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
    sizes = {"H": spec.height, "W": spec.width, "K": slots, "K+1": slots + 1, "L": spec.light_slots}
    found = []
    for field in FIELDS:
        attributes: dict[str, Any] = {
            "unit": field.unit,
            "frame": field.frame,
            "shape": "(" + ", ".join(["N", *map(str, field.shape)]) + ")",
            "meaning": field.meaning,
        }
        if field.name == "image":
            attributes["scale"] = 1 / 255 if spec.image_dtype == "uint8" else 1.0
        if field.name == "object/shape":
            attributes["names"] = list(spec.shapes)
        shape = tuple(sizes[n] if isinstance(n, str) else n for n in field.shape)
        dtype = spec.image_dtype if field.dtype == "image" else field.dtype
        found.append(Column(field.name, shape, dtype, field.per_pixel, attributes))
    return found


def markdown_table() -> str:
    """Return the layout as a Markdown table."""
    rows = [("dataset", "row", "type", "unit", "frame", "meaning")]
    for f in FIELDS:
        row = "(" + ", ".join(map(str, f.shape)) + ")"
        dtype = {"image": "`--image-dtype`", "text": "UTF-8 string"}.get(f.dtype, f.dtype)
        rows.append((f"`{f.name}`", row, dtype, f.unit, f.frame, f.meaning))
    return "\n".join(piped(rows))


if __name__ == "__main__":
    print(markdown_table())

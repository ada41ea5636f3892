"""The HDF5 layout of a file of rooms, as a table: name, axes, type, unit, frame and meaning.

`python -m scenegen.layout > docs/data/rooms-columns.csv` writes it for `docs/rooms-file.md`.
"""

import csv
import io
import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from scenegen.common.text_table import piped
from scenegen.description.specs import FOV, Request
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.schema import DIGEST, Column, Format
from scenegen.objects.meshes.as_furniture import family_like

FORMAT_NAME = "pix2shape-bench/rooms"
FORMAT_VERSION = "1.0"
TRUTH_DIGEST = "truth_digest"
WITHHELD = "withheld"  # "truth" in files of images and cameras alone
CORRUPTION = "corruption"  # what `bench corrupt` did to the images
CONVENTIONS = (
    "world: right-handed, y up, room = unit box with floor y = 0 and walls x = 0, z = 0; camera:"
    " x right, y up, looks along -z; pixels: row 0 on top, centres at +0.5; see docs/conventions.md"
)
INTERIOR_CONVENTIONS = (
    "world: right-handed, y up, metres, room = box from the origin to room/size with floor y = 0;"
    " camera: x right, y up, looks along -z; pixels: row 0 on top, centres at +0.5; see"
    " docs/interiors.md"
)
VARIANT = "(llvm_ad|cuda_ad|scalar)_rgb"  # of Mitsuba
RELEASE = r"unknown|\d\S*"  # of a library that rendered
FORMAT = Format(
    FORMAT_NAME,
    FORMAT_VERSION,
    "rooms file",
    {
        "writer": ".+",
        "spec": ".+",
        "variant": VARIANT,
        "mitsuba_version": RELEASE,
        "drjit_version": RELEASE,
        "llvm_version": RELEASE,
        "conventions": f"{re.escape(CONVENTIONS)}|{re.escape(INTERIOR_CONVENTIONS)}",
        "creation_command": ".*",
        "fingerprint": DIGEST,
        TRUTH_DIGEST: DIGEST,
        CONTENT_DIGEST: DIGEST,
        WITHHELD: "truth",
        CORRUPTION: ".+",
    },
    optional=frozenset((WITHHELD, CORRUPTION)),
)
OTHER_PROPERTY = 40  # of the list of labels of NYU40, what has no label of its own
NYU40 = {  # Gupta et al., "Perceptual organization and recognition of indoor scenes" (2013)
    "armchair": 6, "bag": 37, "bed": 4, "book": 23, "books": 23, "box": 29, "cabinet": 3,
    "chair": 5, "coffee_table": 7, "curtain": 16, "cushion": 18, "desk": 14, "floor_lamp": 35,
    "lamp": 35, "nightstand": 32, "pendant": 35, "picture": 11, "rug": 20, "screen": 25,
    "shelf": 15, "sofa": 6, "stool": 5, "table": 7,
}  # fmt: skip
# The datasets that scores depend on, of those that a file has: the root attribute TRUTH_DIGEST is
# their joint digest.
SCORED = (
    "depth",
    "normal",
    "object_id",
    "scene_index",
    "view_index",
    "camera/world_from_camera",
    "camera/fov_y_degrees",
    "layers/depth",
    "layers/object_id",
    "layers/entering",
)
# Sizes of axes that are the same in all files; those of the others follow from the spec.
FIXED = {"channel": 3, "offset": 2, "xyz": 3, "matrix_row": 4, "matrix_column": 4, "coefficient": 2,
         "setting": 5, "layer": 16, "image_axis": 3, "camera_axis": 3}  # fmt: skip
MATRIX = ("matrix_row", "matrix_column")
HEAD = ("dataset", "row", "type", "unit", "frame", "meaning")  # of tables of columns


def _column(
    name: str, axes: tuple[str, ...], dtype: str, unit: str, frame: str, meaning: str, **how: Any
) -> Column:
    """Return a column whose shape `columns` tells; the dtype "image" is that of the spec."""
    return Column(name, (), dtype, unit, frame, meaning, axes, **how)


# fmt: off
FIELDS = (
    _column("image", ("y", "x", "channel"), "image",
           "linear radiance, times `scale`", "pixels: row 0 on top",
           "RGB of the shading equation, or of path tracing (`spec`); stored value times `scale`"
           " is radiance (no gamma)", own_chunk=True),
    _column("depth", ("y", "x"), "float32", "scene unit", "camera",
           "planar depth, -z in the camera frame, of the one ray through the pixel's centre; NaN"
           " where it meets nothing", own_chunk=True),
    _column("normal", ("y", "x", "xyz"), "float32", "1", "camera",
           "unit surface normal of the same hit, facing the viewer; zero where nothing is hit",
           own_chunk=True, shuffle=False),
    _column("object_id", ("y", "x"), "int8", "1", "pixels: row 0 on top",
           "what the same ray hits: -1 nothing, 0 the room, k the k-th object (from 1)",
           own_chunk=True),
    _column("scene_index", (), "int64", "1", "-", "which scene the image shows"),
    _column("view_index", (), "int32", "1", "-", "which view of that scene, from 0"),
    _column("view_angle_degrees", (), "float64", "degree", "-",
           "from the scene's input view (view 0), about the vertical axis"),
    _column("camera/world_from_camera", MATRIX, "float64", "scene unit", "world from camera",
           "rigid transform; the camera looks along -z, x right, y up"),
    _column("camera/fov_y_degrees", (), "float64", "degree", "-",
           "vertical field of view; pixels are square, the principal point is the image's middle"),
    _column("light/count", (), "int32", "1", "-", "number of point lights"),
    _column("light/position", ("light_slot", "xyz"), "float64", "scene unit", "world",
           "point lights; slots from light/count on are unused"),
    _column("light/color", ("light_slot", "channel"), "float64", "radiance", "RGB",
           "L_j; zero in unused slots"),
    _column("light/ambient", ("channel",), "float64", "radiance", "RGB", "L_a"),
    _column("light/attenuation", ("coefficient",), "float64",
           "1 / scene unit, 1 / scene unit squared", "-",
           "k_l and k_q"),
    _column("material/reflectance", ("material_slot", "channel"), "float64",
           "1", "RGB by object id",
           "rho of the room (row 0) and of each object (row k); zero in unused slots"),
    _column("material/specular", ("material_slot",), "float64", "1", "by object id",
           "k_s of Phong's lobe; 0 for the room and in unused slots"),
    _column("material/shininess", ("material_slot",), "float64", "1", "by object id",
           "exponent of Phong's lobe; 1 for the room and in unused slots"),
    _column("object/count", (), "int32", "1", "-", "number of objects"),
    _column("object/shape", ("object_slot",), "int16", "1", "-",
           "basic shape or class, index into the attribute `names`; -1 in unused slots"),
    _column("object/model", ("object_slot",), "text", "-", "-",
           "which model of the class, class/model; the shape's name for a basic shape"),
    _column("object/world_from_object", ("object_slot", *MATRIX), "float64",
           "scene unit", "world from object",
           "similarity that places the unit shape (bounding radius 1); zero in unused slots"),
    _column("object/scale", ("object_slot",), "float64", "scene unit", "-",
           "bounding radius, the scale in world_from_object"),
    _column("object/visible_pixels", ("object_slot",), "int32", "pixel", "-",
           "pixels that show the object"),
    _column("scene", (), "text", "-", "-", "full description of the scene, JSON"),
)
# What `image` holds in closed rooms, where 8 bits are developed.
DEVELOPED = {
    "unit": "sRGB, times `scale`",
    "meaning": "RGB of path tracing, developed as by a camera (`exposure`); stored value times"
    " `scale` is sRGB, 0 to 1, ready to look at",
}
INTERIOR = (  # columns of closed rooms
    _column("object/stands_on", ("object_slot",), "int8", "1", "object ids",
           "what an object stands on: 0 the room (floor, wall, ceiling or sill), k the k-th object;"
           " -1 in unused slots"),
    _column("room/size", ("xyz",), "float64", "scene unit", "world", "inner size of the room"),
    _column("exposure", ("setting",), "float64", "1", "-",
           "tone mapping of the image: exposure, gains of red, green and blue, and the exposed"
           " radiance that is white (docs/rendering.md has the tone curve)"),
)
LENS = (  # columns of images that are crops, or have pixels that are not square
    _column("camera/intrinsics", ("image_axis", "camera_axis"), "float64", "pixel", "camera",
           "pinhole matrix of a camera with x right, y down, looking along +z; the centre of the"
           " first pixel is (0.5, 0.5)"),
)
OF_CROPS = {
    "camera/fov_y_degrees": "vertical field of view, if the principal point were the image's middle"
}
OF_PANORAMAS = {
    "depth": "distance of the hit along the one ray through the pixel's centre; NaN where it meets"
    " nothing",
    "camera/fov_y_degrees": "vertical field of view of the panorama, which is 360 degrees wide:"
    " columns are longitudes from -180 to 180, 0 straight ahead, rows are latitudes from 90 to -90",
}
FURTHER = {  # columns of `DatasetSpec.truth`, by its names
    "amodal": (
        _column("object/amodal_mask", ("object_slot", "y", "x"), "uint8",
               "1", "pixels: row 0 on top",
               "1 where the ray through the pixel's centre meets the object, whatever stands before"
               " it; parts outside the image do not count", own_chunk=True),
        _column("object/visible_fraction", ("object_slot",), "float32", "1", "-",
               "pixels that show the object, over those of its mask; 0 in unused slots"),
    ),
    "coordinates": (
        _column("object_coordinates", ("y", "x", "xyz"), "float32", "bounding radius", "object",
               "where the hit lies in the frame of its unit shape, -1 to 1; (value + 1) / 2 are the"
               " coordinates of NOCS; NaN where no object is hit", own_chunk=True),
    ),
    "flow": (
        _column("flow", ("y", "x", "offset"), "float32", "pixel", "x right, y down",
               "from the pixel to where the next view of the scene sees its point (the last view:"
               " the first one); NaN where nothing is hit", own_chunk=True),
        _column("flow_occluded", ("y", "x"), "uint8", "1", "pixels: row 0 on top",
               "1 where that view does not show the point, or nothing is hit", own_chunk=True),
    ),
    "albedo": (
        _column("albedo", ("y", "x", "channel"), "float32", "1", "RGB",
               "rho of the surface, linear; NaN where nothing is hit", own_chunk=True),
    ),
    "layers": (
        _column("layers/depth", ("y", "x", "layer"), "float32", "scene unit", "camera",
               "planar depth of the surfaces along the pixel's ray, in order; the first layer is"
               " depth; NaN behind the last one", own_chunk=True, shuffle=False),
        _column("layers/object_id", ("y", "x", "layer"), "int8", "1", "pixels: row 0 on top",
               "whose surface it is: 0 the room, k the k-th object; -1 behind the last one",
               own_chunk=True),
        _column("layers/entering", ("y", "x", "layer"), "int8", "1", "pixels: row 0 on top",
               "1 where the ray enters the object, -1 where it leaves, 0 at surfaces without inside"
               " (the room, open parts) and behind the last one", own_chunk=True),
        _column("object/closed", ("object_slot",), "uint8", "1", "-",
               "1 if all parts of the object's mesh are closed; 0 also in unused slots"),
    ),
}
# fmt: on


def fields(spec: Request) -> list[Column]:
    """Return the columns of a file that answers that spec, without the sizes of their axes."""
    further = [column for name in spec.truth for column in FURTHER[name]]
    lens = spec.lens(FOV[0])
    matrix = LENS if lens.is_flat and not lens.is_centred else ()
    meanings = OF_CROPS if matrix else {} if lens.is_flat else OF_PANORAMAS
    words = {name: {"meaning": meaning} for name, meaning in meanings.items()}
    closed = INTERIOR if spec.interior else ()
    if spec.interior and spec.image_dtype == "uint8":
        words["image"] = DEVELOPED
    unit = "metre" if spec.interior else "scene unit"
    return [
        replace(f, **{"unit": f.unit.replace("scene unit", unit), **words.get(f.name, {})})
        for f in (*FIELDS, *matrix, *closed, *further)
    ]


def conventions(spec: Request) -> str:
    """Return the root attribute of that name."""
    return INTERIOR_CONVENTIONS if spec.interior else CONVENTIONS


def columns(spec: Request) -> list[Column]:
    """Return the datasets of a file that answers that spec, with a row for each image."""
    slots = spec.object_slots
    sizes = {"y": spec.height, "x": spec.width, "light_slot": spec.light_slots, **FIXED}
    sizes |= {"object_slot": slots, "material_slot": slots + 1}
    more: dict[str, dict[str, Any]] = {
        "image": {"scale": 1 / 255 if spec.image_dtype == "uint8" else 1.0},
        "object/shape": {"names": list(spec.shapes)},
    }
    if spec.interior:
        more["image"]["encoding"] = "sRGB" if spec.image_dtype == "uint8" else "linear radiance"
        numbers = [NYU40.get(family_like(name), OTHER_PROPERTY) for name in spec.shapes]
        more["object/shape"]["nyu40"] = numbers
    return [
        replace(
            field,
            shape=tuple(sizes[axis] for axis in field.axes or ()),
            dtype=spec.image_dtype if field.dtype == "image" else field.dtype,
            more=more.get(field.name, {}),
        )
        for field in fields(spec)
    ]


def markdown_table(fields: Iterable[Column]) -> str:
    """Return the layout as a Markdown table."""
    rows = [(f"`{name}`", *row) for name, *row in map(_row, fields)]
    return "\n".join(piped([HEAD, *rows]))


def csv_table() -> str:
    """Return all columns as CSV, with the files that have them."""
    groups = {"all": FIELDS, "interiors": INTERIOR}
    groups |= {"--principal-point, --pixel-aspect": LENS}
    groups |= {f"--with {name}": columns for name, columns in FURTHER.items()}
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow((*HEAD, "files"))
    for files, columns in groups.items():
        table.writerows((*_row(column), files) for column in columns)
    return text.getvalue()


def _row(field: Column) -> tuple[str, ...]:
    shape = ", ".join(str(FIXED.get(axis, axis)) for axis in field.axes or ())
    dtype = {"image": "`--image-dtype`", "text": "UTF-8 string"}.get(field.dtype, field.dtype)
    return field.name, f"({shape})", dtype, field.unit, field.frame, field.meaning


if __name__ == "__main__":
    print(csv_table(), end="")

"""The HDF5 layout of a file of measured truth, as a table.

Images of several sizes are padded to the largest: with plain h5py, row i is

    height, width = file["size"][i]
    image, depth = file["image"][i, :height, :width], file["depth"][i, :height, :width]
"""

import re

from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.schema import DIGEST, Column, Format
from scenegen.layout import TRUTH_DIGEST

FORMAT_NAME = "pix2shape-bench/measured"
CONVENTIONS = (
    "pixels: row 0 on top, centres at +0.5; intrinsics: x right, y down, looks along +z; normals:"
    " x right, y up, z towards the viewer; beyond its size an image is padding"
)
FORMAT = Format(
    FORMAT_NAME,
    "1.0",
    "file of measured ground truth",
    {
        "writer": ".+",
        "source": ".*",
        "license": ".*",
        "conventions": re.escape(CONVENTIONS),
        TRUTH_DIGEST: DIGEST,
        CONTENT_DIGEST: DIGEST,
    },
)
SCORED = ("depth", "normal", "size", "intrinsics", "group")  # what scores depend on


def columns(height: int, width: int, normals: bool) -> tuple[Column, ...]:
    """Return the columns of a file whose largest image is of so many pixels."""
    pixels = "pixels: row 0 on top"
    found = (
        Column("image", (height, width, 3), "uint8", "1", pixels, "the picture, sRGB; 0 beyond its"
               " size", ("y", "x", "channel"), own_chunk=True),
        Column("depth", (height, width), "float32", "metre", "camera", "planar depth, along the"
               " optical axis; NaN where nothing was measured, and beyond the size", ("y", "x"),
               own_chunk=True),
        Column("normal", (height, width, 3), "float32", "1", "camera", "unit normal, facing the"
               " viewer; 0 where nothing was measured", ("y", "x", "xyz"), own_chunk=True),
        Column("size", (2,), "int32", "pixel", pixels, "height and width of the image", ("side",)),
        Column("intrinsics", (3, 3), "float64", "pixel", "camera", "pinhole matrix; NaN where it is"
               " not known", ("matrix_row", "matrix_column")),
        Column("valid_pixels", (), "int64", "pixel", "-", "how many pixels have a depth"),
        Column("name", (), "text", "-", "-", "of the picture"),
        Column("group", (), "text", "-", "-", "images of a scene or drive; intervals resample"
               " groups"),
    )  # fmt: skip
    return tuple(column for column in found if normals or column.name != "normal")

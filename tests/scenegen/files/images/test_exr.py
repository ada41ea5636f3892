"""Which channels of an EXR file are its picture."""

import numpy as np
import OpenEXR
import pytest

from scenegen.common.errors import FileFormatError
from scenegen.files.images.exr import exr_picture

HEAD = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
RGB = np.arange(2 * 4 * 3, dtype=np.float32).reshape(2, 4, 3)
RED = RGB[..., 0].copy()
OTHER = {f"ViewLayer.DiffCol.{letter}": RED + 50 for letter in "RGB"}


def three(layer, letters="RGB", dtype=np.float32):
    planes = np.moveaxis(RGB, 2, 0).astype(dtype)
    return {layer + letter: plane.copy() for letter, plane in zip(letters, planes, strict=True)}


def saved(path, channels):
    with OpenEXR.File(HEAD, channels) as file:
        file.write(str(path))
    return path


@pytest.mark.parametrize(
    "channels",
    [
        three(""),
        three("", dtype=np.float16),
        three("", "rgb"),
        three("ViewLayer.Combined."),
        three("ViewLayer.Combined.") | OTHER,
        three("ViewLayer.Combined.") | {"ViewLayer.Depth.Z": RED},
        three("") | OTHER | {"A": RED, "Z": RED},
        three("rgba.") | OTHER,
    ],
)
def test_the_layer_that_shows_all_is_the_picture(tmp_path, channels):
    picture = exr_picture(saved(tmp_path / "a.exr", channels), 8)
    np.testing.assert_array_equal(picture, RGB)
    assert picture.dtype == np.float32


@pytest.mark.parametrize("name", ["Y", "R", "roughness"])
def test_a_single_channel_is_grey(tmp_path, name):
    picture = exr_picture(saved(tmp_path / "a.exr", {name: RED}), 8)
    np.testing.assert_array_equal(picture, np.stack([RED] * 3, axis=-1))


@pytest.mark.parametrize(
    ("channels", "most"),
    [
        (three("left.") | three("right."), 8),
        (three("a.Combined.") | three("b.Combined."), 8),
        ({"Z": RED, "A": RED}, 8),
        (three(""), 7),
    ],
)
def test_what_is_no_single_picture_is_refused(tmp_path, channels, most):
    with pytest.raises(FileFormatError):
        exr_picture(saved(tmp_path / "a.exr", channels), most)
    (tmp_path / "a.exr").write_bytes(b"v/1\1no")
    with pytest.raises(FileFormatError):
        exr_picture(tmp_path / "a.exr", most)

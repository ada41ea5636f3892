"""Which rows are shown, and pictures that are written whole or not at all."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.images.pictures import (
    opened_picture,
    pick_rows,
    picture_size,
    read_picture,
    save_picture,
    shares_of,
    upright,
)


def test_choice_of_rows():
    assert pick_rows(5, None) == [0, 1, 2, 3, 4]
    assert pick_rows(50, None) == list(range(12))
    assert pick_rows(50, None, default=8) == list(range(8))
    assert pick_rows(50, [7, 3, 7]) == [7, 3, 7]
    some = pick_rows(1000, None, 12, seed=1)
    assert some == pick_rows(1000, None, 12, seed=1)
    assert some != pick_rows(1000, None, 12, seed=2)
    assert len(set(some)) == 12
    assert max(some) < 1000
    assert pick_rows(5, None, 400) == [0, 1, 2, 3, 4]
    for items, number in (([5], None), ([0], 2), ([], None), ([0] * 401, None)):
        with pytest.raises(SpecError):
            pick_rows(5, items, number)


@pytest.mark.parametrize("name", ["s.png", "s.jpg", "S.PNG", "s.webp", "s.tiff"])
def test_saving(tmp_path, name):
    picture = Image.new("RGB", (20, 10), (200, 30, 30))
    save_picture(picture, tmp_path / name)
    with pytest.raises(FileExistsError):
        save_picture(Image.new("RGB", (1, 1)), tmp_path / name)
    save_picture(picture, tmp_path / name, overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    with Image.open(tmp_path / name) as again:
        assert again.size == (20, 10)
        assert np.abs(np.asarray(again)[5, 5].astype(int) - (200, 30, 30)).max() < 8


def test_a_sheet_that_a_format_cannot_hold(tmp_path):
    tall = Image.new("RGB", (8, 16_384))
    for name in ("s.webp", "s.xyz"):
        with pytest.raises(SpecError) as error:
            save_picture(tall, tmp_path / name)
        assert error.value.where == "out"
    save_picture(tall, tmp_path / "s.png")
    assert [p.name for p in tmp_path.iterdir()] == ["s.png"]


SEEN = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3) * 10
STORED = {  # by orientation in EXIF
    1: SEEN, 2: SEEN[:, ::-1], 3: SEEN[::-1, ::-1], 4: SEEN[::-1], 5: SEEN.swapaxes(0, 1),
    6: np.rot90(SEEN), 7: SEEN[::-1, ::-1].swapaxes(0, 1), 8: np.rot90(SEEN, -1),
}  # fmt: skip


@pytest.mark.parametrize("orientation", STORED)
@pytest.mark.parametrize("name", ["a.png", "a.tiff", "a.webp"])
def test_a_picture_is_turned_as_its_exif_data_say(tmp_path, name, orientation):
    exif, path = Image.Exif(), tmp_path / name
    exif[0x0112] = orientation
    stored = Image.fromarray(np.ascontiguousarray(STORED[orientation]))
    stored.save(path, exif=exif, **({"lossless": True} if name == "a.webp" else {}))
    assert picture_size(path, 6) == (2, 3)
    np.testing.assert_array_equal(read_picture(path, 6), SEEN)
    with opened_picture(path, 6) as picture:
        np.testing.assert_array_equal(shares_of(picture, 9), SEEN / np.float32(255))
    with opened_picture(path, 6) as picture:
        np.testing.assert_array_equal(np.asarray(upright(picture)), SEEN)


GREY = np.array([[0, 255, 256], [513, 40_000, 65_535]], np.uint16)


@pytest.mark.parametrize(
    ("name", "picture"),
    [
        ("a.png", Image.fromarray(GREY)),
        ("a.tiff", Image.fromarray(GREY)),
        ("a.tif", Image.frombytes("I;16B", (3, 2), GREY.astype(">u2").tobytes())),
        ("b.tif", Image.fromarray(GREY.astype(np.int32))),
    ],
)
def test_16_bits_of_grey_become_8(tmp_path, name, picture):
    picture.save(tmp_path / name)
    seen = read_picture(tmp_path / name, 6)
    np.testing.assert_array_equal(seen, np.repeat((GREY >> 8)[..., None], 3, axis=2))
    for read in (picture_size, read_picture):
        with pytest.raises(FileFormatError):
            read(tmp_path / name, 5)


def test_negatives_of_16_bits_are_developed(tmp_path):
    told = TiffImagePlugin.ImageFileDirectory_v2()
    told[262] = 0
    Image.fromarray(65_535 - GREY).save(tmp_path / "a.tiff", tiffinfo=told)
    with Image.open(tmp_path / "a.tiff") as picture:
        assert picture.tag_v2[262] == 0
    np.testing.assert_array_equal(read_picture(tmp_path / "a.tiff", 6)[..., 0], GREY >> 8)


def test_numbers_without_a_white_are_no_picture(tmp_path):
    for values in (np.float32(GREY), np.int32(GREY) * 2):
        Image.fromarray(values).save(tmp_path / "a.tiff")
        with pytest.raises(FileFormatError):
            read_picture(tmp_path / "a.tiff", 6)


def test_one_module_opens_pictures():
    """All others call it, so that each is turned and has its levels."""
    root = Path(__file__).parents[4]
    paths = [path for name in ("scenegen", "iqtt", "metrics", "baselines")
             for path in (root / name).rglob("*.py")]  # fmt: skip
    opening = [p.name for p in paths if "Image.open(" in p.read_text() and p.name != "pictures.py"]
    assert not opening

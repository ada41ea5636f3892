"""Which rows are shown, and pictures that are written whole or not at all."""

import numpy as np
import pytest
from PIL import Image

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.pictures import pick_rows, picture_size, read_picture, save_picture


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


def test_a_picture_is_read_as_it_is_seen(tmp_path):
    """Turned as its EXIF data say, and 16 bits of grey as 8."""
    values = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    turned = Image.Exif()
    turned[0x0112] = 6  # the first row is the right-hand side
    Image.fromarray(values).save(tmp_path / "turned.png", exif=turned)
    assert picture_size(tmp_path / "turned.png", 6) == (3, 2)
    np.testing.assert_array_equal(
        read_picture(tmp_path / "turned.png", 6), np.rot90(values, axes=(1, 0))
    )
    grey = np.array([[0, 255, 256], [513, 40_000, 65_535]], np.uint16)
    Image.fromarray(grey).save(tmp_path / "grey.png")
    seen = read_picture(tmp_path / "grey.png", 6)
    np.testing.assert_array_equal(seen, np.repeat((grey >> 8)[..., None], 3, axis=2))
    for read in (picture_size, read_picture):
        with pytest.raises(FileFormatError):
            read(tmp_path / "grey.png", 5)

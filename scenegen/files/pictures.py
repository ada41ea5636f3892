"""Pictures: those of others are read, and those of the rows of a file are chosen and written."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check
from scenegen.files.new_file import written_beside

if TYPE_CHECKING:
    from PIL.Image import Image

DEFAULT_ROWS = 12
MAX_ROWS = 400
ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff")
LARGEST_SIDE = {".webp": 16_383, ".jpg": 65_500, ".jpeg": 65_500, ".gif": 65_535}  # of the formats
READ = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp", ".ppm")  # endings
ORIENTATION, TURNED = 0x0112, (5, 6, 7, 8)  # of EXIF, and its values that swap the sides


def picture_size(path: Path, most: int) -> tuple[int, int]:
    """Return height and width of a picture, from its head, as `read_picture` returns it.

    Raises FileFormatError for what is no picture, or has more than `most` pixels; OSError.
    """
    with _opened(path, most) as picture:
        turned = picture.getexif().get(ORIENTATION) in TURNED
        return picture.size if turned else picture.size[::-1]


def read_picture(path: Path, most: int) -> NDArray[np.uint8]:
    """Return a picture as it is to be seen, (H, W, 3) sRGB bytes, turned as its EXIF data say.

    Raises as `picture_size`, and FileFormatError for a damaged one.
    """
    from PIL import ImageOps

    with _opened(path, most) as picture:
        return np.asarray(as_rgb(ImageOps.exif_transpose(picture)))


def as_rgb(picture: "Image") -> "Image":
    """Return a picture of any mode in 8 bits and three channels."""
    if picture.mode.startswith("I"):  # 16 bits, which `convert` would cut off
        picture = picture.convert("I").point(lambda value: value / 256)
    return picture.convert("RGB")


@contextmanager
def _opened(path: Path, most: int) -> "Iterator[Image]":
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            if picture.width * picture.height > most:
                found = f"{picture.height}x{picture.width}"
                raise FileFormatError(path, found, f"at most {most:,} pixels")
            yield picture
    except (UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise FileFormatError(path, "what is no picture", ", ".join(READ)) from error
    except (OSError, ValueError, SyntaxError) as error:
        if isinstance(error, OSError) and error.filename:
            raise
        reason = " ".join(str(error).split())
        raise FileFormatError(path, f"a picture that cannot be read ({reason:.120})") from error


def pick_rows(
    count: int,
    items: list[int] | None,
    number: int | None = None,
    seed: int = 0,
    default: int = DEFAULT_ROWS,
) -> list[int]:
    """Return the rows to show: `items`, or `number` rows drawn at random, or the first few.

    Raises SpecError for a row beyond the file, and where both are asked for.
    """
    if items is not None and number is not None:
        raise SpecError("items and random", "both", "one of them")
    check(seed >= 0, "seed", seed, "0 or more")
    if number is not None:
        rng = item_rng(seed, 0, Purpose.SELECTION)
        return sorted(rng.choice(count, min(number, count), replace=False).tolist())
    chosen = list(range(min(default, count))) if items is None else items
    outside = [row for row in chosen if row >= count]
    check(not outside, "items", min(outside, default=0), f"rows from 0 to {count - 1}")
    check(0 < len(chosen) <= MAX_ROWS, "items", f"{len(chosen)} rows", f"from 1 to {MAX_ROWS}")
    return chosen


def check_picture_name(path: Path) -> None:
    """Raise SpecError for an ending that names no picture format."""
    is_picture = path.suffix.lower() in ENDINGS
    check(is_picture, "out", repr(path.name), "a picture's name such as sheet.png")


def check_picture_size(picture: "Image", path: Path) -> None:
    """Raise SpecError where a picture is wider or higher than the format of its name can be."""
    most = LARGEST_SIDE.get(path.suffix.lower())
    found = "{} x {} pixels".format(*picture.size)
    expected = f"at most {most} in each direction for {path.suffix}; fewer rows, or a .png"
    check(most is None or max(picture.size) <= most, "out", found, expected)


def save_picture(picture: "Image", path: str | Path, overwrite: bool = False) -> None:
    """Write a picture; the file appears, or is replaced, when it is complete.

    Raises SpecError for an ending that names no picture format, or one whose pictures cannot be so
    large, and OSError for the path.
    """
    path = Path(path)
    check_picture_name(path)
    check_picture_size(picture, path)
    with written_beside(path, overwrite) as temporary:
        picture.save(temporary)

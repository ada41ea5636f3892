"""Pictures: those of others are read, and those of the rows of a file are chosen and written."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check
from scenegen.files.new_file import written_beside

if TYPE_CHECKING:
    from PIL.Image import Image

DEFAULT_ROWS = 12
MAX_ROWS = 400
ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff")
LARGEST_SIDE = {".webp": 16_383, ".jpg": 65_500, ".jpeg": 65_500, ".gif": 65_535}  # of the formats
READ = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp", ".ppm", ".pgm")  # endings
ORIENTATION = 0x0112  # of EXIF
SWAPPED = (5, 6, 7, 8)  # its values that swap the sides
PHOTOMETRIC = 262  # tag of TIFF files, 0 where 0 is white


def after_jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return an image (H, W, 3) as JPEG of a quality, 1 to 95, leaves it."""
    from PIL import Image

    stored = io.BytesIO()
    Image.fromarray(image).save(stored, "jpeg", quality=quality)
    with Image.open(stored) as picture:
        return np.asarray(picture)


@contextmanager
def opened_picture(source: Path | IO[bytes], most: int) -> "Iterator[Image]":
    """Open a picture; all of the project are read so. Its size is known, its pixels are not yet.

    Raises FileFormatError for what is no picture, has more than `most` pixels, or cannot be read
    within the block; OSError.
    """
    from PIL import Image, UnidentifiedImageError

    where = source if isinstance(source, Path) else "picture"
    try:
        with Image.open(source) as picture:
            if picture.width * picture.height > most:
                found = f"{picture.height}x{picture.width}"
                raise FileFormatError(where, found, f"at most {most:,} pixels")
            yield picture
    except (UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise FileFormatError(where, "not an image", ", ".join(READ)) from error
    except (OSError, ValueError, SyntaxError) as error:
        if isinstance(error, SceneGenError) or (isinstance(error, OSError) and error.filename):
            raise
        reason = " ".join(str(error).split())
        raise FileFormatError(where, f"cannot be read ({reason:.120})") from error


def picture_size(path: Path, most: int) -> tuple[int, int]:
    """Return height and width of a picture, from its head, as `read_picture` returns it.

    Raises as `opened_picture`.
    """
    with opened_picture(path, most) as picture:
        is_turned_later = picture.format != "TIFF"  # whose head Pillow turns itself
        swapped = is_turned_later and picture.getexif().get(ORIENTATION) in SWAPPED
        return picture.size if swapped else picture.size[::-1]


def read_picture(path: Path, most: int) -> NDArray[np.uint8]:
    """Return a picture as it is to be seen, (H, W, 3) sRGB bytes, turned as its EXIF data say.

    Raises as `opened_picture`.
    """
    with opened_picture(path, most) as picture:
        return np.asarray(as_rgb(picture))


def as_rgb(picture: "Image") -> "Image":
    """Return a picture of any mode in 8 bits and three channels, turned as its EXIF data say.

    Raises ValueError for numbers of 32 bits, which have no white.
    """
    picture = _turned(picture)
    if picture.mode == "I":
        picture = picture.point(lambda value: value / 256)
    return picture.convert("RGB")


def shares_of(picture: "Image", side: int) -> NDArray[np.float32]:
    """Return a picture's values, (H, W, 3), 0 to 1, at most `side` a side, turned as `as_rgb`.

    16 bits of grey keep their precision. Raises as `as_rgb`.
    """
    from PIL import Image

    turned, white = _turned(picture), 65_535
    if turned.mode == "I":
        picture = Image.fromarray(np.asarray(turned, np.float32))
    else:
        picture, white = turned.convert("RGB"), 255
    if max(picture.size) > side:
        picture = picture.reduce(-(-max(picture.size) // side))
    values = np.asarray(picture, np.float32) / np.float32(white)
    return values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=2)


def _turned(picture: "Image") -> "Image":
    """Return a picture turned as its EXIF data say; of 16 bits a channel in the mode "I"."""
    is_negative = getattr(picture, "tag_v2", {}).get(PHOTOMETRIC) == 0  # which Pillow leaves so
    picture = upright(picture)
    if picture.mode.startswith("I"):  # of which `convert` to bytes would cut off what is white
        picture = picture.convert("I")
        picture = picture.point(lambda value: value * -1 + 65_535) if is_negative else picture
    if picture.mode == "F" or (picture.mode == "I" and np.asarray(picture).max() > 65_535):
        raise ValueError("numbers of 32 bits, expected 8 or 16")
    return picture


def upright(picture: "Image") -> "Image":
    """Return a picture turned as its EXIF data say."""
    from PIL import ImageOps

    return ImageOps.exif_transpose(picture)


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
    check(is_picture, "out", repr(path.name), "the name of an image, such as sheet.png")


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

"""Pictures of the rows of a file: which rows to show, and how a picture is written."""

from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check
from scenegen.files.new_file import written_beside

if TYPE_CHECKING:
    from PIL.Image import Image

DEFAULT_ROWS = 12
MAX_ROWS = 400
ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff")
LARGEST_SIDE = {".webp": 16_383, ".jpg": 65_500, ".jpeg": 65_500, ".gif": 65_535}  # of the formats


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

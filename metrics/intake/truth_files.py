"""Measured truth from files of pictures and of depth, one of each for every row."""

import csv
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.intake.array_files import read_array
from metrics.intake.folders import SHOWN, files_of, numbered
from metrics.intake.outputs import FRAMES, image_of
from metrics.intake.reading import Reading, geometry_reader
from metrics.measured.reader import rays_of_matrix
from metrics.measured.writer import Measured, Source, TruthError
from scenegen.common.errors import SceneGenError
from scenegen.description.specs import MAX_PIXELS
from scenegen.files.images.pictures import READ, picture_size, read_picture

Array = NDArray[Any]
# What the median of a room's or a street's depth in metres is multiplied by, and how to say it.
GUESSES = ((1000.0, "--unit mm"), (256.0, "--scale 1/256"), (100.0, "--unit cm"), (1.0, "--unit m"))
USUAL = (0.5, 60.0)  # metres, of such a median
# Numbers that stand for no value: a few that many pixels share, at so many times the depth of all
# others. That is certain beyond rooms and streets, and for the largest number of 16 bits or more.
MOST_MARKS, CERTAIN, LIKELY = 3, 10.0, 2.0
FARTHEST, NEAREST, ENDLESS = 30.0, 0.01, 1e5  # metres
USUAL_MARK = re.compile(r"(255|65504|65535|9{3,}|10{3,})(\.0)?")


@dataclass(frozen=True)
class Beside:
    """What lies beside pictures and depth.

    Attributes:
        matrices: by name of the picture, or "" for all; pixels.
        groups: by name of the picture.
        normals, masks: patterns of files; a mask is 0 where depth does not count.
    """

    matrices: Mapping[str, Array]
    groups: Mapping[str, str]
    normals: str | None = None
    masks: str | None = None


def truth_of_files(
    images: str,
    depth: str,
    reading: Reading,
    beside: Beside,
    hint: Callable[[str], Any] = lambda text: None,
) -> list[Source]:
    """Return a row for each picture of a pattern, with the depth that has its name or number.

    Rows raise TruthError where numbers are certain to stand for no value; `hint` is called with a
    line where they may.

    Raises MatchError for a picture without truth, two truths for one, or none; TruthError for names
    in `beside` that no picture has; and as `folders.files_of`.
    """
    pictures = files_of(images, READ)
    names = [path.name for path in pictures]
    read, _ = geometry_reader(
        reading, depth, names, lambda: [list(numbered(pictures))], beside.normals, beside.masks,
        partial(_look_for_marks, reading, hint),
    )  # fmt: skip
    matrices = _of_each(pictures, beside.matrices, "intrinsics")
    groups = _of_each(pictures, beside.groups, "groups")
    sizes = [picture_size(path, MAX_PIXELS) for path in pictures]

    def measured(row: int) -> Measured:
        path, matrix = pictures[row], matrices[row]
        geometry, _ = read(row, partial(_rays, matrix, sizes[row], f"{depth}: {path.name}"))
        truth, normal = geometry.geometry, geometry.normal
        if reading.kind == "disparity":
            truth = np.divide(1.0, truth, out=np.full_like(truth, np.nan), where=truth > 0.0)
        normal = None if normal is None else normal * FRAMES[reading.frame]
        return Measured(read_picture(path, MAX_PIXELS), truth, matrix, normal)

    return [
        Source(path.name, groups[row] or path.name, sizes[row], partial(measured, row))
        for row, path in enumerate(pictures)
    ]


def _look_for_marks(
    reading: Reading, hint: Callable[[str], Any], where: str, stored: Array, known: Array
) -> None:
    """Raise TruthError, or give a hint, where numbers among depth stand for no value."""
    values = image_of(stored, "depth")
    known &= (values > 0.0) & (values <= np.finfo(np.float32).max)
    numbers, counts = np.unique(values[known], return_counts=True)
    highest = np.iinfo(stored.dtype).max if stored.dtype.kind in "iu" else 0
    for step in (1, -1):  # the largest numbers, and the smallest
        sizes = (numbers * reading.scale)[::step] ** step  # ascending
        is_far = (step > 0) != (reading.kind == "disparity")
        beyond = FARTHEST if is_far else 1.0 / NEAREST
        for k in range(1, min(MOST_MARKS, len(sizes)) + 1):
            marks, count = numbers[::step][-k:], int(counts[::step][-k:].sum())
            away = sizes[-k] / (sizes[-k - 1] if len(sizes) > k else ENDLESS / CERTAIN)
            is_beyond, is_highest = sizes[-k] > beyond, marks.max() == highest
            texts = [str(stored.dtype.type(mark)) for mark in sorted(marks)]
            is_usual = is_highest or all(map(USUAL_MARK.fullmatch, texts))
            found = f"{' and '.join(texts)} at {count:,} pixels, far from all other numbers"
            says = f"use {' '.join(f'--invalid {text}' for text in texts)}"
            if count <= k and away < 1e4:
                continue
            if away >= (LIKELY if is_highest and highest > 255 else CERTAIN) and (
                is_beyond or is_highest
            ):
                raise TruthError(where, found, "depth; this value marks invalid pixels", says)
            if away >= LIKELY and (is_usual or (is_beyond and away >= 1.5 * LIKELY)):
                hint(f"{where}: {found}; if this value marks invalid pixels, {says}")
                return


def _of_each(pictures: Sequence[Path], by_name: Mapping[str, Any], what: str) -> list[Any]:
    """Return what belongs to each picture, by its name with or without its ending; None for none.

    Raises TruthError where some have one, and others have none.
    """
    by_stem = {Path(name).stem if name else "": value for name, value in by_name.items()}
    missing = sorted(path.stem for path in pictures if path.stem not in by_stem)
    if by_name and "" not in by_stem and missing:
        found = f"none of {', '.join(missing[:SHOWN])}" + ", ..." * (len(missing) > SHOWN)
        raise TruthError(what, found, "one for each image")
    return [by_stem.get("", by_stem.get(path.stem)) for path in pictures]


def _rays(
    matrix: Array | None, size: tuple[int, int], place: str, height: int, width: int
) -> Array:
    if matrix is None:
        raise TruthError(place, "distance along the ray", "a camera: give --intrinsics")
    return rays_of_matrix(matrix, size, height, width)


def read_matrices(path: str | Path) -> dict[str, Array]:
    """Return pinhole matrices of a JSON file: one, or an object of them by name of the picture.

    Raises TruthError for other content, and OSError.
    """
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
        given = document if isinstance(document, dict) else {"": document}
        if set(given) == {"intrinsics"}:
            given = {"": given["intrinsics"]}
        matrices = {str(name): np.array(value, np.float64) for name, value in given.items()}
    except (ValueError, TypeError, RecursionError) as error:
        raise TruthError(path, f"no matrices ({error!s:.80})", _MATRICES) from error
    for name, matrix in matrices.items():
        if matrix.shape != (3, 3):
            raise TruthError(f"{path}: {name}", f"shape {matrix.shape}", _MATRICES)
    return matrices


_MATRICES = (
    "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels, or an object with one matrix per image name"
)


def read_groups(path: str | Path) -> dict[str, str]:
    """Return the group of each picture, from lines `picture,group`. Raises TruthError, OSError."""
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.reader(file) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise TruthError(path, f"no CSV ({error!s:.80})", "lines image,group") from error
    groups: dict[str, str] = {}
    for number, row in enumerate(rows, 1):
        if len(row) != 2 or not row[1].strip() or row[0] in groups:
            raise TruthError(
                f"{path}: line {number}", f"{row!s:.60}", "image,group, each image once"
            )
        groups[row[0]] = row[1].strip()
    return groups


def unknown_unit(depth: str, reading: Reading) -> SceneGenError:
    """Return an error that guesses the unit of depth in files, and says why.

    Of disparity no unit can be guessed.
    """
    path = files_of(depth)[0]
    values = image_of(read_array(path, reading.array), "depth")
    known = values[np.isfinite(values) & (values > 0.0) & ~np.isin(values, reading.invalid)]
    middle = float(np.median(known)) if len(known) else 0.0
    if reading.kind == "disparity":
        found = f"disparity with a median of {middle:g}, and no focal length or baseline"
        wanted = "depth = focal length in pixels x baseline in metres / disparity"
        hint = "use --focal-baseline N, their product, and --disparity-offset if needed"
        return TruthError(path, found, wanted, hint)
    guesses = (says for factor, says in GUESSES if USUAL[0] <= middle / factor <= USUAL[1])
    guess = next(guesses, "--unit m, cm or mm, or --scale")
    found = f"a median of {middle:g}, and no unit" if len(known) else "no depth above 0"
    return TruthError(path, found, "the unit of depth", f"use {guess}, if it applies")

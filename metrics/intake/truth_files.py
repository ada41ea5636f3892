"""Measured truth from files of pictures and of depth, one of each for every row."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from metrics.intake.array_files import ArrayFileError, read_array
from metrics.intake.importing import Reading, unit_vectors
from metrics.intake.matching import MatchError, files_of, numbered
from metrics.intake.outputs import FRAMES, image_of
from metrics.measured.reader import rays_of_matrix
from metrics.measured.writer import Measured, Source, TruthError
from scenegen.common.errors import SceneGenError
from scenegen.description.specs import MAX_PIXELS

Array = NDArray[Any]
PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp", ".ppm")
SHOWN = 3  # pictures that an error lists
# What the median of a room's or a street's depth in metres is multiplied by, and how to say it.
GUESSES = ((1000.0, "--unit mm"), (256.0, "--scale 1/256"), (100.0, "--unit cm"), (1.0, "--unit m"))
USUAL = (0.5, 60.0)  # metres, of such a median


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


def truth_of_files(images: str, depth: str, reading: Reading, beside: Beside) -> list[Source]:
    """Return a row for each picture of a pattern, with the depth that has its name or number.

    Raises MatchError for a picture without truth, two truths for one, or none; TruthError for names
    in `beside` that no picture has; and as `matching.files_of`.
    """
    pictures = files_of(images, PICTURES)
    of_depth = paired(pictures, files_of(depth), reading.match)
    others = {
        name: paired(pictures, files_of(pattern), reading.match)
        for name, pattern in (("normals", beside.normals), ("masks", beside.masks))
        if pattern is not None
    }
    for what, given in (("intrinsics", beside.matrices), ("groups", beside.groups)):
        stems = {path.stem for path in pictures}
        missing = sorted(stems - {Path(name).stem for name in given})
        if given and "" not in given and missing:
            found = f"none of {', '.join(missing[:SHOWN])}" + ", ..." * (len(missing) > SHOWN)
            raise TruthError(what, found, "one for each picture")
    groups, matrices = _by_stem(beside.groups), _by_stem(beside.matrices)
    rows = []
    for i, path in enumerate(pictures):
        matrix = matrices.get("", matrices.get(path.stem))
        more = {name: paths[i] for name, paths in others.items()}
        read = partial(_measured, path, of_depth[i], reading, matrix, more)
        rows.append(Source(path.name, groups.get(path.stem, path.name), size_of(path), read))
    return rows


def _by_stem(given: Mapping[str, Any]) -> dict[str, Any]:
    return {Path(name).stem if name else "": value for name, value in given.items()}


def paired(pictures: Sequence[Path], paths: Sequence[Path], by: str) -> list[Path]:
    """Return for each picture the file of its name, of its number, or in their order by "name".

    Raises MatchError where one has none, or two.
    """
    if by != "number":
        if len(pictures) != len(paths):
            found = f"{len(pictures)} pictures and {len(paths)} files"
            raise MatchError(paths[0].parent, found, "as many of each")
        return list(paths)
    first, second = (_by_stem_alone(some) for some in (pictures, paths))
    if first.keys() != second.keys():
        first, second = (dict(numbered(some)) for some in (pictures, paths))
    for some, other, what in ((first, second, "truth"), (second, first, "picture")):
        alone = [some[key].name for key in some if key not in other]
        if alone:
            found = f"no {what} for {', '.join(alone[:SHOWN])}" + ", ..." * (len(alone) > SHOWN)
            raise MatchError(next(iter(some.values())).parent, found, "one of each")
    return [second[key] for key in first]


def _by_stem_alone(paths: Sequence[Path]) -> dict[Any, Path]:
    """Return files by their names without ending. Raises MatchError where two share one."""
    named: dict[Any, Path] = {}
    for path in paths:
        if path.stem in named:
            found = f"{named[path.stem].name} and {path.name}"
            raise MatchError(path.parent, found, "one file of a name")
        named[path.stem] = path
    return named


def size_of(path: Path) -> tuple[int, int]:
    """Return height and width of a picture, from its head. Raises ArrayFileError."""
    try:
        with Image.open(path) as picture:
            if picture.width * picture.height > MAX_PIXELS:
                found = f"{picture.height}x{picture.width}"
                raise ArrayFileError(path, found, f"at most {MAX_PIXELS:,} pixels")
            return picture.height, picture.width
    except (UnidentifiedImageError, Image.DecompressionBombError, SyntaxError) as error:
        raise ArrayFileError(path, "what is no picture", ", ".join(PICTURES)) from error


def picture_of(path: Path) -> Array:
    """Return a picture, (H, W, 3) sRGB bytes. Raises ArrayFileError."""
    size_of(path)
    try:
        with Image.open(path) as picture:
            return np.asarray(picture.convert("RGB"))
    except (OSError, ValueError, SyntaxError) as error:
        reason = " ".join(str(error).split())
        raise ArrayFileError(path, f"a picture that cannot be read ({reason:.120})") from error


def _measured(
    path: Path, depth_path: Path, reading: Reading, matrix: Array | None, more: Mapping[str, Path]
) -> Measured:
    stored = read_array(depth_path, reading.array)
    rays = partial(_rays, matrix, size_of(path), depth_path)
    depth = reading.geometry(stored, None, rays).geometry
    if reading.kind == "disparity":
        depth = np.divide(1.0, depth, out=np.full_like(depth, np.nan), where=depth > 0.0)
    if "masks" in more:
        mask = image_of(read_array(more["masks"]), "mask")
        if mask.shape != depth.shape:
            raise TruthError(more["masks"], f"shape {mask.shape}", f"{depth.shape}, as the depth")
        depth = np.where(mask > 0.0, depth, np.nan)
    normal = None
    if "normals" in more:
        vectors = unit_vectors(read_array(more["normals"], None, True), more["normals"])
        normal = vectors * FRAMES[reading.frame]
    return Measured(picture_of(path), depth, matrix, normal)


def _rays(
    matrix: Array | None, size: tuple[int, int], path: Path, height: int, width: int
) -> Array:
    if matrix is None:
        raise TruthError(path, "distance along the ray", "a camera: give --intrinsics")
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


_MATRICES = "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels, or an object of them by picture"


def read_groups(path: str | Path) -> dict[str, str]:
    """Return the group of each picture, from lines `picture,group`. Raises TruthError, OSError."""
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.reader(file) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise TruthError(path, f"no CSV ({error!s:.80})", "lines picture,group") from error
    groups: dict[str, str] = {}
    for number, row in enumerate(rows, 1):
        if len(row) != 2 or not row[1].strip() or row[0] in groups:
            raise TruthError(f"{path}: line {number}", f"{row!s:.60}", "picture,group, each once")
        groups[row[0]] = row[1].strip()
    return groups


def unknown_unit(depth: str, reading: Reading) -> SceneGenError:
    """Return an error that guesses the unit of depth in files, and says why."""
    path = files_of(depth)[0]
    values = image_of(read_array(path, reading.array), "depth")
    known = values[np.isfinite(values) & (values > 0.0) & ~np.isin(values, reading.invalid)]
    middle = float(np.median(known)) if len(known) else 0.0
    guesses = (says for factor, says in GUESSES if USUAL[0] <= middle / factor <= USUAL[1])
    guess = next(guesses, "--unit m, cm or mm, or --scale")
    found = f"a median of {middle:g}, and no unit" if len(known) else "no depth above 0"
    return TruthError(path, found, "the unit of depth", f"say {guess}, if that is what it is")

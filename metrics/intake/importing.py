"""Import folders of predicted images as a submission of rooms, or on measured truth."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.intake.array_files import ArrayFileError, read_array
from metrics.intake.matching import By, files_of, match_files, match_names
from metrics.intake.outputs import (
    FILL,
    Frame,
    Geometry,
    Missing,
    OutputError,
    fitted_to,
    image_of,
    planar_from_distance,
)
from metrics.measured.reader import Images as TruthImages
from metrics.measured.reader import MeasuredFile, open_images, rays_of, size_of
from metrics.measures.alignment import Alignment
from metrics.submissions.layout import KINDS, Shown
from metrics.submissions.problems import PredictionError
from metrics.submissions.writer import RoomPredictionWriter
from scenegen.common.errors import SceneGenError, SpecError

Array = NDArray[Any]
Rays = Callable[[int, int], Array]
Kind = Literal["depth", "disparity", "distance", "points"]
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}  # scene units for each, where the room's edge is 1 m


@dataclass(frozen=True)
class Reading:
    """How the numbers of files are to be taken.

    Attributes:
        kind: "depth" is planar, "distance" goes along the ray, "disparity" is large where near,
            "points" are x, y, z.
        scale: scene units for each step; 1 of disparity.
        alignment: what the method does not know; None for "none", or "scale_shift" of disparity.
            Disparity under another alignment is 1 / depth, and becomes depth.
        invalid: stored values that stand for no value.
        frame: of points and normals.
        missing: what to do with pixels without a value.
        array: name of the array in NPZ files, or of the channel in EXR files.
        match: whether files belong to rows by number, or in the order of their names.
    """

    kind: Kind = "depth"
    scale: float = 1.0
    alignment: Alignment | None = None
    invalid: tuple[float, ...] = ()
    frame: Frame = "opencv"
    missing: Missing = "refuse"
    array: str | None = None
    match: By = "number"

    def __post_init__(self) -> None:
        """Raise SpecError where settings contradict each other."""
        kinds = {"distance": KINDS["depth"][:-1], "disparity": KINDS["depth"]}
        allowed = kinds.get(self.kind) or KINDS[self.kind]
        if self.alignment is not None and self.alignment not in allowed:
            expected = f"{' or '.join(allowed)}, for {self.kind}"
            raise SpecError("alignment", repr(self.alignment), expected)
        if not 0.0 < self.scale < np.inf:
            raise SpecError("scale", self.scale, "a number above 0")

    def geometry(self, stored: Array, normal: Array | None, rays: Rays) -> Geometry:
        """Return the geometry of the numbers of a file, (h, w) or (h, w, 3). Raises OutputError.

        `rays` returns the directions of the pixels of an image of a height and a width, z = -1.
        """
        values = image_of(stored, self.kind, vectors=self.kind == "points")
        invalid = np.isin(values, self.invalid)
        values = np.where(
            invalid.all(axis=-1, keepdims=True) if values.ndim == 3 else invalid,
            np.nan,
            values * self.scale,
        )
        kind, alignment = self.kind, self.alignment or "none"
        if kind == "distance":
            values = planar_from_distance(values, rays(*values.shape))
            return Geometry("depth", alignment, values, normal)
        if kind == "disparity" and self.alignment in ("none", "scale", "median_scale"):
            positive = np.where(values > 0.0, values, np.nan)  # what is at infinity has no depth
            return Geometry("depth", alignment, 1.0 / positive, normal)
        if kind == "disparity":
            return Geometry(kind, "scale_shift", values, normal)
        return Geometry(kind, alignment, values, normal)


def import_rooms(
    pattern: str,
    truth: str | Path,
    out: str | Path,
    *,
    method: str,
    reading: Reading,
    normals: str | None = None,
    shown: Shown = "scored_view",
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> str:
    """Write a submission from files of images, and return in words how they were matched.

    Args:
        pattern, normals: a pattern such as `out/*.png`, a folder, or a single NPY or NPZ file with
            an image for each row.
        shown: which image of a scene the method was shown, as `layout.Shown`.
        progress: called with 1 after every row.

    Raises MatchError, ArrayFileError, OutputError and PredictionError, naming file and row; OSError
    and FileFormatError for the truth.
    """
    with open_images(truth) as rooms:
        paths, how = _images(pattern, rooms, reading, reading.kind == "points")
        normal_paths = None
        if normals is not None:
            normal_paths, _ = _images(normals, rooms, reading, vectors=True)
        alignment = _alignment(reading)
        with RoomPredictionWriter(
            out, truth, method=method, run=run, alignment=alignment, shown=shown, notes=notes,
            overwrite=overwrite,
        ) as writer:  # fmt: skip
            for row in range(len(rooms)):
                where, stored = paths(row)
                try:
                    normal = None
                    if normal_paths is not None:
                        where_normal, values = normal_paths(row)
                        normal = unit_vectors(values, where_normal)
                    geometry = reading.geometry(stored, normal, partial(rays_of, rooms, row))
                    fitted = fitted_to(
                        geometry,
                        *size_of(rooms, row),
                        frame=reading.frame,
                        missing=reading.missing,
                    )
                    writer.add(row, **fitted.values)
                except (OutputError, PredictionError) as error:
                    error.where = error.where.removeprefix(f"{out}: row {row}: ")
                    raise told_of_missing(error, where) from error
                progress(1)
    return how


def told_of_missing(error: SceneGenError, where: object) -> SceneGenError:
    """Return an error of one row with its place, and advice where values are missing."""
    hint = FILL if error.found.startswith("NaN") and not error.hint else error.hint
    return type(error)(f"{where}: {error.where}", error.found, error.expected, hint)


Images = Callable[[int], tuple[object, Array]]


def _alignment(reading: Reading) -> Alignment:
    default: Alignment = "scale_shift" if reading.kind == "disparity" else "none"
    return reading.alignment or default


def _images(
    pattern: str, rooms: TruthImages, reading: Reading, vectors: bool
) -> tuple[Images, str]:
    """Return what reads the image of a row, with its place, and how files are matched."""
    files = files_of(pattern)
    count = len(rooms)
    if len(files) == 1 and files[0].suffix in (".npy", ".npz"):
        stack = read_array(files[0], reading.array, vectors)
        if stack.ndim > (3 if vectors else 2) and len(stack) == count:
            return lambda row: (f"{files[0]}: row {row}", stack[row]), "one image for each row"
    if isinstance(rooms, MeasuredFile):
        names = [PurePath(rooms.name(row)).stem for row in range(count)]
        matched = match_names(files, names) or match_files(files, count, None, reading.match)
    else:
        columns = [rooms.read(name, slice(None)) for name in ("scene_index", "view_index")]
        matched = match_files(files, count, np.stack(columns, 1), reading.match)

    def image(row: int) -> tuple[object, Array]:
        path = matched.paths[row]
        return f"{path} (row {row})", read_array(path, reading.array, vectors)

    return image, f"{count} files {matched.how}"


def unit_vectors(values: Array, where: object) -> Array:
    """Return normals (h, w, 3) of a file: whole numbers encode -1 to 1."""
    if values.dtype.kind == "u":
        return image_of(values, "normal", vectors=True) * (2.0 / np.iinfo(values.dtype).max) - 1.0
    if values.dtype.kind != "f":
        raise ArrayFileError(where, f"type {values.dtype}", "floats, or whole numbers from 0")
    return image_of(values, "normal", vectors=True)

"""How the numbers of files are taken: kind, unit, frame, and what stands for no value."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.intake.array_files import ArrayFileError
from metrics.intake.folders import By, Keys, row_reader
from metrics.intake.outputs import (
    Frame,
    Geometry,
    Missing,
    OutputError,
    image_of,
    layers_of,
    planar_from_distance,
)
from metrics.measures.alignment import Alignment
from metrics.submissions.layout import KINDS
from scenegen.common.errors import SpecError

Array = NDArray[Any]
Rays = Callable[[int, int], Array]
GeometryReader = Callable[[int, Rays], tuple[Geometry, str]]
Kind = Literal["depth", "disparity", "distance", "points"]
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}  # scene units for each, where the room's edge is 1 m


@dataclass(frozen=True)
class Reading:
    """How the numbers of files are to be taken.

    Attributes:
        kind: "depth" is planar, "distance" goes along the ray, "disparity" is large where near,
            "points" are x, y, z.
        scale: scene units for each step; of disparity, 1 / scene units.
        offset: of disparity: what is added to it before it is scaled, in its own steps.
        alignment: what the method does not know; None for "none", or "scale_shift" of disparity.
            Disparity under another alignment is 1 / depth, and becomes depth.
        invalid: stored values that stand for no value.
        frame: of points and normals.
        missing: what to do with pixels without a value.
        array: name of the array in NPZ files, or of the channel in EXR files.
        surer: whether confidence is larger where the method is surer, or smaller, as an error is.
        layered: whether each pixel has several depths, distances or points: its layers.
        match: whether files belong to rows by number, or in the order of their names.
    """

    kind: Kind = "depth"
    scale: float = 1.0
    offset: float = 0.0
    alignment: Alignment | None = None
    invalid: tuple[float, ...] = ()
    frame: Frame = "opencv"
    missing: Missing = "refuse"
    array: str | None = None
    layered: bool = False
    match: By = "number"
    surer: Literal["more", "less"] = "more"

    def __post_init__(self) -> None:
        """Raise SpecError where settings contradict each other."""
        kinds = {"distance": KINDS["depth"][:-1], "disparity": KINDS["depth"]}
        if self.layered and self.kind == "disparity":
            raise SpecError("kind", "disparity", "depth, distance or points, for layers")
        allowed = KINDS["layers"] if self.layered else kinds.get(self.kind) or KINDS[self.kind]
        if self.alignment is not None and self.alignment not in allowed:
            expected = f"{' or '.join(allowed)}, for {self.kind}"
            raise SpecError("alignment", repr(self.alignment), expected)
        if not 0.0 < self.scale < np.inf:
            raise SpecError("scale", self.scale, "a number above 0")
        if not np.isfinite(self.offset) or (self.offset and self.kind != "disparity"):
            raise SpecError("disparity offset", self.offset, "a number, for disparity")

    def geometry(self, stored: Array, normal: Array | None, rays: Rays) -> Geometry:
        """Return the geometry of the numbers of a file, (h, w) or (h, w, 3). Raises OutputError.

        `rays` returns the directions of the pixels of an image of a height and a width, z = -1.
        """
        if self.layered:
            depth = layers_of(stored, "layers", self.frame)
            depth[np.isin(depth, self.invalid)] = np.nan
            if self.kind == "distance":
                depth = planar_from_distance(depth, rays(*depth.shape[:2])[:, :, None])
            return Geometry("layers", self.alignment or "none", depth * self.scale)
        values = image_of(stored, self.kind, vectors=self.kind == "points")
        marks = np.asarray(self.invalid)
        if stored.dtype.kind == "f":  # in which a mark such as 255.996 has fewer digits
            with np.errstate(over="ignore"):
                marks = marks.astype(stored.dtype)
        invalid = np.isin(values, marks)
        values = np.where(
            invalid.all(axis=-1, keepdims=True) if values.ndim == 3 else invalid,
            np.nan,
            (values + self.offset) * self.scale,
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


def geometry_reader(
    reading: Reading,
    depth: str,
    names: Sequence[str],
    keys: Keys,
    normals: str | None = None,
    masks: str | None = None,
    look: Callable[[str, Array, Array], None] = lambda where, stored, known: None,
    confidence: str | None = None,
) -> tuple[GeometryReader, str]:
    """Return what reads the geometry of each row from files, and in words how rows have them.

    The reader takes a row and its rays, and returns its geometry with the place of its file.
    Normals are as stored, in the frame of the files.

    Args:
        depth, normals, masks, confidence: patterns of files, as `folders.row_reader`; a mask is 0
            where the geometry has no value.
        names, keys: of the rows, as `folders.match_files`.
        look: is called with each file's place, its numbers, and where they are taken for depth.

    Raises as `row_reader` and `look`; the reader ArrayFileError and OutputError.
    """
    rows = partial(row_reader, names=names, keys=keys, by=reading.match)
    read, how = rows(depth, array=reading.array, vectors=reading.kind == "points")
    read_normal = rows(normals, vectors=True)[0] if normals is not None else None
    read_mask = rows(masks)[0] if masks is not None else None
    read_sure = rows(confidence)[0] if confidence is not None else None

    def geometry(row: int, rays: Rays) -> tuple[Geometry, str]:
        where, stored = read(row)
        normal = None
        try:
            if read_normal is not None:
                place, vectors = read_normal(row)
                normal = _unit_vectors(vectors, place)
            geometry = reading.geometry(stored, normal, rays)
            if read_sure is not None:
                place, values = read_sure(row)
                sure = image_of(values, "confidence")
                geometry = replace(geometry, confidence=sure if reading.surer == "more" else -sure)
            if read_mask is not None:
                place, values = read_mask(row)
                geometry = geometry.within(image_of(values, "mask") > 0.0, place)
            look(where, stored, np.isfinite(geometry.geometry))
        except OutputError as error:
            raise error.inside(where) from error
        return geometry, where

    return geometry, how


def _unit_vectors(values: Array, where: object) -> Array:
    """Return normals (h, w, 3) of a file: whole numbers encode -1 to 1."""
    if values.dtype.kind == "u":
        return image_of(values, "normal", vectors=True) * (2.0 / np.iinfo(values.dtype).max) - 1.0
    if values.dtype.kind != "f":
        raise ArrayFileError(where, f"type {values.dtype}", "floats, or whole numbers from 0")
    return image_of(values, "normal", vectors=True)

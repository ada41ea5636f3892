"""Read files of measured truth, and what they have in common with files of rooms."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.layout import FORMAT, FORMAT_NAME, SCORED, columns
from scenegen.camera import intrinsics, pixel_directions
from scenegen.common.errors import FileFormatError
from scenegen.description.specs import MAX_PIXELS
from scenegen.files.attributes import read_root, read_text
from scenegen.files.content import row_digest
from scenegen.files.input_file import checking
from scenegen.files.rows import RowFile
from scenegen.files.sets.shards import OpenFile
from scenegen.layout import FORMAT as ROOMS
from scenegen.layout import TRUTH_DIGEST
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
PER_PIXEL = ("depth", "normal")
SPARSE = 0.5  # images with a smaller share of measured pixels have no boundaries
UNIT_TOLERANCE = 1e-3  # by which the squared length of a normal may differ from 1


@dataclass(frozen=True, eq=False)
class MeasuredView:
    """The truth of one image, in its own size.

    Attributes:
        depth: planar depth, (H, W), metres; NaN where nothing is measured.
        normal: (H, W, 3), camera frame (x right, y up, z towards the viewer), 0 where nothing was
            measured; None without normals.
        rays: directions of the pixels in the camera frame, (H, W, 3), with z = -1; None where the
            intrinsics are not known.
        digests: of what is stored, by name of PER_PIXEL.
    """

    depth: Array
    normal: Array | None
    rays: Array | None
    digests: tuple[bytes, ...]

    @property
    def mask(self) -> Array:
        """The measured pixels, (H, W) bool."""
        return np.isfinite(self.depth)


class MeasuredFile(RowFile):
    """An open file of measured truth. Use it as a context manager, or close it.

    Attributes, besides those of `RowFile`:
        shape: height and width of the largest image, to which all are padded.
        fingerprint: what submissions name: the digest of what scores depend on.
        groups: number of the group of each row, (N,), in the order of their names.
        dense: whether depth is known at most pixels of each image.
    """

    SCORED = SCORED
    has_truth = True

    def __init__(self, path: str | Path | OpenFile) -> None:
        """Open and check the layout. Raises OSError and FileFormatError as `RoomsFile`."""
        super().__init__(path if isinstance(path, OpenFile) else OpenFile(path, FORMAT.kind))

    def _open_columns(self) -> None:
        self.attributes = read_root(self.opened.file, self.path, FORMAT)
        self.stored_truth_digest = self.fingerprint = self.attributes[TRUTH_DIGEST]
        self._count_rows("image")
        shape = self.opened.array("image").shape
        if not len(self) or len(shape) != 4 or not 0 < shape[1] * shape[2] <= MAX_PIXELS:
            expected = f"(N, H, W, 3), N above 0, at most {MAX_PIXELS:,} pixels"
            raise FileFormatError(f"{self.path}: image", f"shape {shape}", expected)
        self.shape = shape[1], shape[2]
        self.has_normals = "normal" in self.opened.file
        self._take("", columns(*self.shape, self.has_normals))
        self._sizes = self.read("size", slice(None))
        outside = ((self._sizes < 1) | (self._sizes > self.shape)).any(axis=1)
        if outside.any():
            row = int(np.argmax(outside))
            found, expected = self._sizes[row].tolist(), f"1 to {self.shape}"
            raise FileFormatError(self.place("size", row), found, expected)
        _, self.groups = np.unique(self.read("group", slice(None)), return_inverse=True)
        shares = self.read("valid_pixels", slice(None)) / self._sizes.prod(axis=1)
        self.dense = bool((shares >= SPARSE).all())

    def size(self, row: int) -> tuple[int, int]:
        """Return height and width of an image, pixels."""
        height, width = self._sizes[row].tolist()
        return height, width

    def name(self, row: int) -> str:
        """Return the name of a picture."""
        return bytes(self.read("name", row)).decode(errors="replace")

    def picture(self, row: int) -> Array:
        """Return an image in its own size, (H, W, 3) sRGB bytes. Raises FileFormatError."""
        height, width = self.size(row)
        return np.asarray(self.read("image", row)[:height, :width])

    def view(self, row: int) -> MeasuredView:
        """Return the truth of an image.

        Raises FileFormatError where it is damaged or impossible: depth that is neither above 0 nor
        NaN, or beyond the size; no depth at all; normals that are not unit; a broken matrix.
        """
        height, width = self.size(row)
        stored = [self.read(name, row) for name in PER_PIXEL if name in self.fields]
        depth = stored[0]
        inside = np.zeros(self.shape, np.bool_)
        inside[:height, :width] = True
        known = np.isfinite(depth)
        wrong = ~((known & (depth > 0) & inside) | np.isnan(depth))
        if wrong.any() or not known.any():
            found = f"{np.count_nonzero(wrong)} wrong pixels" if wrong.any() else "no pixel"
            expected = "depth above 0 somewhere, and NaN where nothing is measured"
            raise FileFormatError(self.place("depth", row), found, expected)
        normal = stored[1][:height, :width] if len(stored) > 1 else None
        if normal is not None:
            square = np.einsum("ijk,ijk->ij", normal, normal, dtype=np.float64)
            if (~(np.abs(square - 1.0) <= UNIT_TOLERANCE) & (square != 0.0)).any():
                expected = "vectors of length 1, or 0 where there is none"
                raise FileFormatError(
                    self.place("normal", row), "vectors of other lengths", expected
                )
        rays = self.rays(row, height, width)
        return MeasuredView(depth[:height, :width], normal, rays, tuple(map(row_digest, stored)))

    def matrix(self, row: int) -> Array | None:
        """Return the pinhole matrix (3, 3), pixels; None where it is not known.

        Raises FileFormatError for one that is no pinhole camera.
        """
        matrix: Array = self.read("intrinsics", row)
        if np.isnan(matrix).all():
            return None
        fault = matrix_fault(matrix, *self.size(row))
        if fault:
            raise FileFormatError(self.place("intrinsics", row), *fault)
        return matrix

    def rays(self, row: int, height: int, width: int) -> Array | None:
        """Return directions (h, w, 3), z = -1, of an image of this view at any size, or None."""
        matrix = self.matrix(row)
        return None if matrix is None else rays_of_matrix(matrix, self.size(row), height, width)


def rays_of_matrix(matrix: Array, size: tuple[int, int], height: int, width: int) -> Array:
    """Return directions of pixels, (h, w, 3), camera frame (y up), z = -1.

    Args:
        matrix: pinhole matrix (3, 3) in pixels of an image of `size`; the one of height and width
            shows the same.
    """
    x = ((np.arange(width) + 0.5) * (size[1] / width) - matrix[0, 2]) / matrix[0, 0]
    y = ((np.arange(height) + 0.5) * (size[0] / height) - matrix[1, 2]) / matrix[1, 1]
    rays = np.full((height, width, 3), -1.0)
    rays[..., 1] = -y[:, None]
    rays[..., 0] = x - matrix[0, 1] / matrix[0, 0] * y[:, None]
    return rays


def matrix_fault(matrix: Array, height: int, width: int) -> tuple[str, str, str] | None:
    """Return what was found, was expected and is to do where a matrix suits no such image."""
    expected = f"a pinhole matrix (3, 3) in pixels of an image of {height}x{width}"
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        return f"shape {matrix.shape}, or numbers that are not finite", expected, ""
    focal, (x, y) = np.diag(matrix)[:2], matrix[:2, 2]
    others = matrix[1, 0], *matrix[2, :2], matrix[2, 2] - 1.0
    if not (focal > 0.0).all() or any(others):
        return "no pinhole matrix", expected, ""
    if max(*focal, x, y) < 10.0 <= min(height, width):
        hint = "multiply its first row by the width and its second by the height"
        return f"focal lengths {focal.tolist()}, a normalised matrix", expected, hint
    if not (0.0 < x < width and 0.0 < y < height):
        found = f"a principal point at ({x:g}, {y:g}), outside of the image"
        return found, expected, "scale it with the images"
    return None


Images = RoomsFile | MeasuredFile


def open_images(path: str | Path | OpenFile) -> Images:
    """Open a file of rooms or of measured truth, whichever it is. Raises as their readers."""
    opened = path if isinstance(path, OpenFile) else OpenFile(path, ROOMS.kind)
    with checking(opened.file):
        measured = read_text(opened.file, "format", opened.path) == FORMAT_NAME
    return MeasuredFile(opened) if measured else RoomsFile(opened)


def size_of(truth: Images, row: int) -> tuple[int, int]:
    """Return height and width of an image, pixels."""
    if isinstance(truth, MeasuredFile):
        return truth.size(row)
    return truth.spec.height, truth.spec.width


def is_flat(truth: Images) -> bool:
    """Return whether images are planes, as of pinhole cameras."""
    return isinstance(truth, MeasuredFile) or truth.spec.projection == "perspective"


def padded_size(truth: Images) -> tuple[int, int]:
    """Return height and width of what is stored of each image."""
    return truth.shape if isinstance(truth, MeasuredFile) else size_of(truth, 0)


def matrix_of(truth: Images, row: int) -> Array:
    """Return the pinhole matrix (3, 3) in pixels. Raises FileFormatError where it is not known."""
    if not isinstance(truth, MeasuredFile):
        return intrinsics(*size_of(truth, row), truth.lens(row), pixel_centers="half")
    matrix = truth.matrix(row)
    if matrix is None:
        raise FileFormatError(truth.place("intrinsics", row), "none", "a pinhole matrix", NO_MATRIX)
    return matrix


def rays_of(truth: Images, row: int, height: int, width: int) -> Array:
    """Return directions (h, w, 3), z = -1, of a row at any size. Raises as `matrix_of`."""
    if not isinstance(truth, MeasuredFile):
        return pixel_directions(height, width, truth.lens(row))
    matrix_of(truth, row)
    rays = truth.rays(row, height, width)
    assert rays is not None, "its matrix is known"
    return rays


NO_MATRIX = "make the file with bench truth --intrinsics"

"""Write files of measured truth, row by row."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.layout import CONVENTIONS, FORMAT, SCORED, columns
from metrics.measured.reader import matrix_fault
from scenegen.common.errors import SceneGenError
from scenegen.description.specs import MAX_PIXELS
from scenegen.files.content import SHA256, joint_digest, seal
from scenegen.files.row_file import new_hdf5_file, writer_name
from scenegen.files.table import Table
from scenegen.layout import TRUTH_DIGEST

Array = NDArray[Any]
WAITING = 8  # rows that wait to be written; bounds the memory


class TruthError(SceneGenError):
    """What is no measured truth: a picture without depth, sizes that differ, no valid pixel."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured of one picture.

    Attributes:
        image: (H, W, 3) sRGB bytes.
        depth: planar depth, (H, W), metres; what is not finite or not above 0 has no value.
        matrix: pinhole matrix, (3, 3), pixels; None where it is not known.
        normal: (H, W, 3), camera frame (x right, y up, z towards the viewer), of any length; 0 or
            NaN for none; None without normals.
    """

    image: Array
    depth: Array
    matrix: Array | None = None
    normal: Array | None = None


@dataclass(frozen=True)
class Source:
    """A picture that is read when its turn comes: name, group, (height, width), and its reader."""

    name: str
    group: str
    size: tuple[int, int]
    read: Callable[[], Measured]


def write_measured(
    path: str | Path,
    sources: Sequence[Source],
    *,
    source: str,
    licence: str,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Write a file of measured truth; it appears when it is complete.

    Args:
        source, licence: of the data, in words.
        progress: called with 1 after every row.

    Raises TruthError, naming the picture, what was found and what was expected; OSError.
    """
    if not sources:
        raise TruthError(path, "no images", "at least one")
    height, width = (max(source.size[side] for source in sources) for side in (0, 1))
    if height * width > MAX_PIXELS:
        found, expected = f"{height}x{width} for all images", f"at most {MAX_PIXELS:,} pixels"
        raise TruthError(path, found, expected, "reduce the images and their depth")
    table = None
    texts = {"format": FORMAT.name, "format_version": FORMAT.version, "writer": writer_name()}
    texts |= {"source": source, "license": licence, "conventions": CONVENTIONS}
    with new_hdf5_file(path, overwrite) as file:
        for item in sources:
            measured = item.read()
            row = {**_row(item, measured, height, width), "name": item.name, "group": item.group}
            if table is None:
                shapes = columns(height, width, "normal" in row)
                table = Table(file, shapes, len(sources))
            if ("normal" in row) != ("normal" in table.datasets):
                raise TruthError(
                    f"{item.name}: normals",
                    "normals of some images",
                    "normals of all images or of none",
                )
            table.append(row)
            table.write_packed(WAITING)
            progress(1)
        assert table is not None, "there are images"
        digests = {n: str(d.attrs[SHA256]) for n, d in table.datasets.items() if n in SCORED}
        file.attrs.update({**texts, TRUTH_DIGEST: joint_digest(digests)})
        seal(file)


def _row(item: Source, measured: Measured, height: int, width: int) -> dict[str, Any]:
    """Return the values of a row, padded to the largest size. Raises TruthError."""
    image, depth = measured.image, np.asarray(measured.depth)
    if image.shape != (*item.size, 3) or image.dtype != np.uint8:
        found = f"shape {image.shape}, {image.dtype}"
        raise TruthError(f"{item.name}: image", found, f"({item.size[0]}, {item.size[1]}, 3) bytes")
    if depth.shape != image.shape[:2]:
        found, expected = f"shape {depth.shape}", f"{image.shape[:2]}, as the image"
        turned = depth.shape == image.shape[1::-1]
        hint = "EXIF data may rotate the image: rotate the depth as well" if turned else ""
        hint = hint or "depth is never resampled here"
        raise TruthError(f"{item.name}: depth", found, expected, hint)
    with np.errstate(over="ignore", invalid="ignore"):
        single = depth.astype(np.float32)
    valid = np.isfinite(single) & (single > 0.0)
    if not valid.any():
        raise TruthError(f"{item.name}: depth", "no valid pixel", "depth above 0 at some pixels")
    fault = None if measured.matrix is None else matrix_fault(measured.matrix, *item.size)
    if fault:
        raise TruthError(f"{item.name}: intrinsics", *fault)
    row = {
        "image": _padded(image, height, width, 0),
        "depth": _padded(np.where(valid, single, np.float32("nan")), height, width, np.nan),
        "size": item.size,
        "intrinsics": np.full((3, 3), np.nan) if measured.matrix is None else measured.matrix,
        "valid_pixels": np.count_nonzero(valid),
    }
    if measured.normal is not None:
        row["normal"] = _padded(_unit(measured.normal, item), height, width, 0)
    return row


def _unit(normal: Array, item: Source) -> Array:
    """Return normals (H, W, 3) of length 1, or 0 for none. Raises TruthError."""
    if normal.shape != (*item.size, 3):
        raise TruthError(f"{item.name}: normal", f"shape {normal.shape}", f"{(*item.size, 3)}")
    vectors = np.where(np.isfinite(normal).all(axis=-1, keepdims=True), normal, 0.0).astype(float)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)
    return np.asarray(unit)


def _padded(values: Array, height: int, width: int, fill: float) -> Array:
    sides = (0, height - len(values)), (0, width - values.shape[1])
    return np.pad(values, (*sides, *((0, 0),) * (values.ndim - 2)), constant_values=fill)

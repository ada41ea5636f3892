"""What others made, for pictures: a folder of materials, and a picture of the surroundings.

A data set names them by digests of their bytes. Their places are told to each process (`ASSETS`).
"""

import hashlib
import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check
from scenegen.description.specs import InteriorSpec
from scenegen.files.images.exr import exr_picture
from scenegen.files.places import files_below
from scenegen.rendering.backend import point_to_llvm
from scenegen.rendering.materials.folders import MapFiles, check_maps, from_folder
from scenegen.rendering.pictures.places import ASSETS

Array = NDArray[Any]
MEAN = 0.09  # radiance that the upper half of the surroundings is scaled to, that of a clear sky
MOST_COLUMNS = 4096
MOST_PIXELS = 2**28  # of a file
HEAD, ORDER = 2**16, re.compile(rb"-Y +\d+ +\+X +\d+\s*")  # bytes that tell that of an HDR file
ENVIRONMENT = "an equirectangular HDR or EXR image"


def materials_of(spec: InteriorSpec) -> Mapping[str, tuple[MapFiles, ...]] | None:
    """Return the folder of materials that a data set names; None if it has none.

    Raises SpecError where its place is not told, or it is another one.
    """
    if not spec.materials:
        return None
    return _folder(_checked("materials", spec.materials, ASSETS.materials))


def environment_of(spec: InteriorSpec) -> Array | None:
    """Return radiance by direction, (H, W, 3), of the surroundings that a data set names.

    None if it has none. Raises as `materials_of`, and FileFormatError.
    """
    if not spec.environment:
        return None
    return read_environment(_checked("environment", spec.environment, ASSETS.environment))


def _checked(name: str, digest: str, place: Path | None) -> Path:
    if place is None:
        raise SpecError(name, "no place", f"--{name}, which the file was made with")
    found = digest_of(place)
    check(found == digest, f"{name} {place}", f"other files ({found})", f"those of {digest}")
    return place


@lru_cache(maxsize=4)
def _folder(place: Path) -> Mapping[str, tuple[MapFiles, ...]]:
    return from_folder(place)


@lru_cache(maxsize=8)
def digest_of(place: Path) -> str:
    """Return 16 hex digits of the SHA-256 of a file, or of a folder's names and bytes.

    Raises OSError where it cannot be read.
    """
    files = files_below(place) if place.is_dir() else [place]
    digest = hashlib.sha256()
    for path in files:
        name = path.relative_to(place).as_posix()
        digest.update(hashlib.sha256(name.encode()).digest())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


@lru_cache(maxsize=2)
def read_environment(place: Path) -> Array:
    """Return an equirectangular picture, HDR or EXR, as radiance, (H, W, 3) float32.

    Raises FileFormatError where it is broken, has a low dynamic range, or is not twice as wide as
    high.
    """
    if not place.is_file():
        raise FileFormatError(place, "no such file", ENVIRONMENT)
    is_exr, expected = place.suffix.lower() == ".exr", ENVIRONMENT
    values = exr_picture(place, MOST_PIXELS) if is_exr else _radiance(place)
    rows, columns = values.shape[:2]
    if columns != 2 * rows or rows < 2:
        raise FileFormatError(place, f"{columns} x {rows} pixels", f"{expected}, twice as wide")
    if not np.isfinite(values).all() or (values < 0).any():
        raise FileFormatError(place, "radiance that is no finite, positive number", expected)
    values = block_means(values, -(-columns // MOST_COLUMNS))
    mean = float(values[: len(values) // 2].mean())
    if mean == 0.0:
        raise FileFormatError(place, "a black upper half", f"{expected}, with the sky above")
    return np.asarray(values * np.float32(MEAN / mean))


def _radiance(place: Path) -> Array:
    """Return the colours of an HDR file, (H, W, 3) float32. Raises FileFormatError."""
    point_to_llvm()  # before Dr.Jit is imported, with Mitsuba
    import mitsuba

    mi: Any = mitsuba
    if mi.variant() is None:  # bitmaps need one
        mi.set_variant("scalar_rgb")
    with place.open("rb") as file:
        head, _, rest = file.read(HEAD).partition(b"\n\n")
    order, _, pixels = rest.partition(b"\n")
    is_radiance, found = head.startswith(b"#?"), "an unreadable image"
    if is_radiance and (b"xyze" in head or not ORDER.fullmatch(order)):
        found = f"colours as XYZE, or pixels in the order {order[:40].decode(errors='replace')!r}"
        raise FileFormatError(place, found, "RGBE, in the order -Y HEIGHT +X WIDTH")
    if is_radiance and not pixels.startswith(b"\2\2") and b"\1\1\1" in pixels:
        found = "possibly the old run-length encoding"
    try:
        bitmap = mi.Bitmap(str(place))
        if bitmap.component_format() in (mi.Struct.Type.Float16, mi.Struct.Type.Float32):
            rgb = mi.Bitmap.PixelFormat.RGB
            return np.array(bitmap.convert(rgb, mi.Struct.Type.Float32, False))
    except Exception as error:  # Mitsuba raises RuntimeError for whatever it meets
        raise FileFormatError(place, found, ENVIRONMENT, "save it again") from error
    raise FileFormatError(place, "a low dynamic range", ENVIRONMENT)


def block_means(values: Array, step: int) -> Array:
    """Return means of blocks of so many pixels a side, (H, W, C): a small sun keeps its light."""
    for axis in (0, 1):
        starts = np.arange(0, values.shape[axis], step)
        counts = np.diff(starts, append=values.shape[axis]).astype(np.float32)
        sums = np.add.reduceat(values, starts, axis=axis)
        values = sums / counts.reshape((-1, 1, 1) if axis == 0 else (-1, 1))
    return values


def use_assets(materials: str | None, environment: str | None) -> dict[str, str]:
    """Let this process use these places, and return the settings that name them.

    Raises as `materials_of` and `environment_of`, and OSError.
    """
    ASSETS.use(materials, environment)
    settings = {}
    if ASSETS.materials is not None:
        check_maps(_folder(ASSETS.materials))
        settings["materials"] = digest_of(ASSETS.materials)
    if ASSETS.environment is not None:
        read_environment(ASSETS.environment)
        settings["environment"] = digest_of(ASSETS.environment)
    return settings

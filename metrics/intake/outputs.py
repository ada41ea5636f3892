"""What a model returns for one image, as the geometry of the submission format.

The names of keys are those of MoGe (Wang et al. 2025), which wraps other models by them, too.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.intake.resampling import filled, nearest, resampled
from metrics.measures.alignment import Alignment
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.rules import LAYERS
from metrics.submissions.writer import as_array
from scenegen.common.errors import SceneGenError
from scenegen.common.names import did_you_mean
from scenegen.description.specs import MAX_PIXELS

STRETCHED = 0.05  # by so much networks may change the ratio of sides, to multiples of 14 or 32
Array = NDArray[Any]
Frame = Literal["opencv", "opengl"]
Missing = Literal["refuse", "nearest"]
# The geometry of a key, and what is not known of it; the first that a model returns is taken.
KEYS: dict[str, tuple[str, Alignment]] = {
    "points_metric": ("points", "none"),
    "depth_metric": ("depth", "none"),
    "points_scale_invariant": ("points", "scale"),
    "depth_scale_invariant": ("depth", "scale"),
    "points_affine_invariant": ("points", "scale_shift"),
    "depth_affine_invariant": ("depth", "scale_shift"),
    "disparity_affine_invariant": ("disparity", "scale_shift"),
    "layers_metric": ("layers", "none"),
    "layers_scale_invariant": ("layers", "scale"),
    "layers_affine_invariant": ("layers", "scale_shift"),
}
FRAMES: dict[Frame, Array] = {  # what an axis is multiplied by to be one of ours
    "opencv": np.array([1.0, -1.0, -1.0]),
    "opengl": np.array([1.0, 1.0, 1.0]),
}
FILL = "use --missing nearest to fill them from the nearest valid pixel"
_WANTED = "a dict with one of " + ", ".join(KEYS)


class OutputError(SceneGenError):
    """What a model returned, or a file holds, that is no prediction."""


@dataclass(frozen=True, eq=False)
class Geometry(PredictedView):
    """What is predicted for one image, of any size (h, w); NaN for no value.

    Attributes, besides those of `PredictedView`:
        key: the name that the model gave to the geometry.
    """

    key: str = ""

    def within(self, mask: Array, name: str = "mask") -> "Geometry":
        """Return the geometry without values where a mask (h, w) is False. Raises OutputError."""
        shape = self.geometry.shape[:2]
        if mask.shape != shape:
            raise OutputError(name, f"shape {mask.shape}", f"{shape}, as {self.key or self.kind}")
        inside = mask[..., None] if self.geometry.ndim == 3 else mask
        return replace(self, geometry=np.where(inside, self.geometry, np.nan))

    @property
    def values(self) -> dict[str, Any]:
        """The arguments of `RoomPredictionWriter.add`, beside the row."""
        values = {**dict(self.columns), "fov_y_degrees": self.fov_y_degrees}
        return {name: value for name, value in values.items() if value is not None}


@contextmanager
def in_row(out: str | Path, row: int, where: object) -> Iterator[None]:
    """Name `where` in errors of the block, which writes a row of `out`, and what helps them."""
    try:
        yield
    except (OutputError, PredictionError) as error:
        place = error.where.removeprefix(f"{out}: row {row}: ")
        hint = FILL if error.found.startswith("NaN") and not error.hint else error.hint
        raise type(error)(f"{where}: {place}", error.found, error.expected, hint) from error


def read_output(
    output: Any,
    height: int,
    width: int,
    *,
    frame: Frame = "opencv",
    key: str | None = None,
    missing: Missing = "refuse",
) -> Geometry:
    """Return what a model predicts for an image of (H, W) pixels, in that size.

    Args:
        output: a mapping with one of `KEYS`, and maybe `normal` (h, w, 3), `mask` (h, w; what is
            False has no value), `intrinsics` (3, 3), normalised by the image's size or in its
            pixels, and `confidence` or `uncertainty` (h, w). Layers are depths (h, w, L) or points
            (h, w, L, 3), maybe with their number `layer_count` (h, w). Arrays, or tensors of
            torch; axes of size 1 around them are dropped.
        frame: of points and normals: "opencv" has x right, y down, z forward; "opengl" is ours.
        key: which of `KEYS` to take; by default the first that is there.
        missing: "nearest" fills pixels without a value from the nearest that has one.

    Raises OutputError.
    """
    if not isinstance(output, Mapping):
        found = "None" if output is None else _described(output)
        raise OutputError("returned", found, _WANTED)
    chosen = key or next((name for name in KEYS if name in output), None)
    if chosen is None or chosen not in output or chosen not in KEYS:
        names = ", ".join(f"{name!r:.30}" for name in list(output)[:8]) or "none"
        hint = "" if key else did_you_mean(str(next(iter(output), "")), KEYS)
        wanted = _WANTED if chosen is None else f"the key {chosen!r}"
        raise OutputError("returned", f"a dict with the keys {names}", wanted, hint)
    kind, alignment = KEYS[chosen]
    normal, mask = output.get("normal"), output.get("mask")
    if kind == "layers":
        layers = layers_of(output[chosen], chosen, frame, output.get("layer_count"))
        geometry = Geometry(kind, alignment, layers, key=chosen)
        return fitted_to(geometry, height, width, frame=frame, missing=missing)
    geometry = Geometry(
        kind,
        alignment,
        image_of(output[chosen], chosen, vectors=kind == "points"),
        None if normal is None else image_of(normal, "normal", vectors=True),
        _fov(output.get("intrinsics"), height),
        _confidence(output),
        key=chosen,
    )
    if mask is not None:
        geometry = geometry.within(image_of(mask, "mask") > 0.5)
    return fitted_to(geometry, height, width, frame=frame, missing=missing)


def _confidence(output: Mapping[str, Any]) -> Array | None:
    """Return how sure a model is of each pixel, which may be told by how unsure it is."""
    if output.get("uncertainty") is not None:
        return -image_of(output["uncertainty"], "uncertainty")
    found = output.get("confidence")
    return None if found is None else image_of(found, "confidence")


def fitted_to(
    geometry: Geometry, height: int, width: int, *, frame: Frame, missing: Missing
) -> Geometry:
    """Return a geometry of any size and frame in ours, at (H, W) pixels. Raises OutputError."""
    name, image, normal = geometry.key or geometry.kind, geometry.geometry, geometry.normal
    _refuse_shape(image, name, height, width)
    if geometry.kind == "layers":
        return replace(geometry, geometry=nearest(image, height, width))
    _refuse_zeros(geometry, name)
    image = np.where(np.isfinite(image), image, np.nan)
    if geometry.kind == "points":
        image = image * FRAMES[frame]
    image = resampled(geometry.kind, image, height, width)
    valid = np.asarray(np.isfinite(image.reshape(height, width, -1)).all(axis=-1))
    if not valid.any():
        raise OutputError(name, "no finite value", "numbers")
    if normal is not None:
        _refuse_shape(normal, "normal", height, width)
        normal = nearest(normal * FRAMES[frame], height, width)
    sure = geometry.confidence
    if sure is not None:
        _refuse_shape(sure, "confidence", height, width)
        sure = nearest(sure, height, width)
    if missing == "nearest":
        image = filled(image, valid)
        sure = None if sure is None else filled(sure, np.isfinite(sure))
        if normal is not None:
            sensible = np.isfinite(normal) & normal.any(axis=-1, keepdims=True)
            normal = filled(normal, np.asarray(sensible.all(axis=-1)))
    return replace(geometry, geometry=image, normal=normal, confidence=sure)


def image_of(values: Any, name: str, vectors: bool = False) -> Array:
    """Return numbers of pixels as float64, (h, w), or (h, w, 3) of vectors. Raises OutputError."""
    try:
        array = as_array(values, name)
    except SceneGenError as error:
        raise OutputError(error.where, error.found, error.expected) from error
    wanted = "(h, w, 3)" if vectors else "(h, w)"
    shape, axes = array.shape, 3 if vectors else 2
    while array.ndim > axes and array.shape[0] == 1:
        array = array[0]
    while array.ndim > axes and array.shape[-1] == 1:
        array = array[..., 0]
    if array.dtype.kind not in "fiub":
        raise OutputError(name, f"type {array.dtype!s:.40}", f"numbers {wanted}")
    if array.ndim != axes or 0 in array.shape or (vectors and array.shape[-1] != 3):
        first = vectors and len(shape) == 3 and shape[0] == 3
        hint = "move the first axis to the end" if first else ""
        raise OutputError(name, f"shape {shape}", wanted, hint)
    if math.prod(array.shape[:2]) > MAX_PIXELS:
        raise OutputError(name, f"shape {shape}", f"at most {MAX_PIXELS:,} pixels")
    return array.astype(np.float64)


def layers_of(values: Any, name: str, frame: Frame, count: Any = None) -> Array:
    """Return depths (h, w, L), or points (h, w, L, 3), as planar depths (h, w, L).

    `count`, (h, w), is how many of them there are. Raises OutputError.
    """
    array = as_array(values, name)
    vectors = array.shape[-1:] == (3,) and array.ndim > 3
    while array.ndim > 3 + vectors and array.shape[0] == 1:
        array = array[0]
    if array.dtype.kind not in "fiu" or array.ndim != 3 + vectors or 0 in array.shape:
        found = f"type {array.dtype!s:.40}, shape {array.shape}"
        raise OutputError(name, found, "numbers (h, w, L), or points (h, w, L, 3)")
    if math.prod(array.shape[:2]) > MAX_PIXELS or array.shape[2] not in LAYERS:
        raise OutputError(name, f"shape {array.shape}", f"at most {LAYERS[-1]} layers")
    layers = array.astype(np.float64)
    if vectors:
        layers = layers[..., 2] * -FRAMES[frame][2]
    if count is not None:
        layers[np.arange(layers.shape[2]) >= image_of(count, "layer_count")[..., None]] = np.nan
    return layers


def planar_from_distance(distance: Array, rays: Array) -> Array:
    """Return planar depth (h, w) of distances along rays (h, w, 3), z = -1."""
    return np.asarray(distance / np.linalg.norm(rays, axis=-1))


def _fov(matrix: Any, height: int) -> float | None:
    """Return the vertical field of view of intrinsics (3, 3), in degrees; None without any."""
    if matrix is None:
        return None
    values = as_array(matrix, "intrinsics")
    values = values[0] if values.ndim == 3 and len(values) == 1 else values
    if values.shape != (3, 3) or values.dtype.kind not in "fiu" or not values[1, 1] > 0.0:
        found = f"shape {values.shape}" if values.shape != (3, 3) else "no focal length above 0"
        raise OutputError("intrinsics", found, "a matrix (3, 3), normalised or in pixels")
    # Normalised ones have their centre at about 0.5, those in pixels at half the height.
    half = 0.5 if 0.0 < values[1, 2] < 2.0 else height / 2.0
    return math.degrees(2.0 * math.atan(half / float(values[1, 1])))


def _refuse_zeros(geometry: Geometry, name: str) -> None:
    """Raise OutputError for depths of 0: the camera's own place, or a file's mark for no value."""
    zeros = np.count_nonzero(geometry.geometry == 0.0)
    if geometry.kind == "depth" and geometry.alignment != "scale_shift" and zeros:
        hint = (
            "if 0 marks invalid pixels, use bench import --invalid 0, or return NaN from the model"
        )
        raise OutputError(name, f"0 at {zeros} pixels", "depths above 0", hint)


def _refuse_shape(image: Array, name: str, height: int, width: int) -> None:
    """Raise OutputError for an image whose sides have another ratio than those of the truth."""
    if height != width and image.shape[:2] == (width, height):
        found = f"{width} rows and {height} columns"
        raise OutputError(name, found, f"({height}, {width}), rows first", "transpose it")
    tall, wide = image.shape[:2]
    if abs(tall * width - wide * height) > STRETCHED * wide * height:
        expected = f"the ratio of sides of the images, {height}x{width}"
        raise OutputError(name, f"{tall}x{wide} pixels", expected, "undo padding and crops")


def _described(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return type(value).__name__ + ("" if shape is None else f" of shape {tuple(shape)}")

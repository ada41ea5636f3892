"""Pictures of a report: an image, its depths and normals, true and predicted, and their error."""

import base64
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from metrics.measures.normals import normals_from_depth
from scenegen.rooms.preview import NOTHING, srgb_bytes

Array = NDArray[Any]
LARGEST = 128  # pixels across; larger images are shown by every second, third, ... of their pixels
HEAVY = 6_000  # bytes of a picture that is kept to the bit; others lose a little
FARTHEST = 1e6  # scene units; what is predicted beyond is drawn there
ERROR_RAMP = np.array([(255, 255, 255), (253, 212, 158), (227, 74, 51), (127, 0, 0)], float)
IMAGE, TRUE_DEPTH, DEPTH, ERROR = "image", "true depth", "predicted depth", "depth error"
TRUE_NORMALS, NORMALS = "true normals", "predicted normals"
DERIVED_NORMALS = "normals of predicted depth"


def view_pictures(
    radiance: Array,
    true: Array,
    predicted: Array,
    true_normal: Array,
    fov_y_degrees: float,
    predicted_normal: Array | None = None,
) -> dict[str, str]:
    """Return image, depths, error and normals of one view, as data URLs by what they show.

    Both depths share one grey scale, black at the truth's nearest and white at its farthest. The
    error |predicted - true| runs from white (none) to dark red (a tenth of the truth's range, or
    more). Normals are shown as (x, y, z) = (red, green, blue). Pixels that are not scored are
    purple. No value needs to be finite.

    Args:
        radiance: (H, W, 3); true, predicted: planar depth, (H, W), scene units.
        true_normal: camera frame, (H, W, 3).
        fov_y_degrees: with which normals of the predicted depth are made where there are no others.
        predicted_normal: camera frame, (H, W, 3), of any length.
    """
    scored = np.isfinite(true)
    near, far = (true[scored].min(), true[scored].max()) if scored.any() else (0.0, 1.0)
    span = max(float(far - near), 1e-9)
    drawn = np.clip(np.nan_to_num(predicted.astype(np.float64)), -FARTHEST, FARTHEST)
    error = np.clip(np.abs(predicted_or_far(predicted) - true) / (0.1 * span), 0, 1)
    stops = np.linspace(0, 1, len(ERROR_RAMP))
    ramp = [np.interp(np.nan_to_num(error, nan=1.0), stops, ERROR_RAMP[:, c]) for c in range(3)]
    if predicted_normal is None:
        name, normal = DERIVED_NORMALS, normals_from_depth(drawn, fov_y_degrees, scored)[0]
    else:
        name, normal = NORMALS, predicted_normal
    pictures = {
        TRUE_DEPTH: _grey((true - near) / span),
        DEPTH: _grey((drawn - near) / span),
        ERROR: _bytes(np.stack(ramp, axis=2)),
        TRUE_NORMALS: _normals(true_normal),
        name: _normals(normal),
    }
    for picture in pictures.values():
        picture[~scored] = NOTHING
    shown = {IMAGE: srgb_bytes(np.nan_to_num(radiance)), **pictures}
    return {caption: data_url(pixels) for caption, pixels in shown.items()}


def predicted_or_far(predicted: Array) -> Array:
    """Return depth with values that are not finite as far as can be, whose error is the largest."""
    finite = np.nan_to_num(predicted.astype(np.float64), nan=FARTHEST)
    return np.clip(finite, -FARTHEST, FARTHEST)


def data_url(pixels: NDArray[np.uint8]) -> str:
    """Return a picture, (H, W, 3), as a data URL: WebP of at most 128 pixels a side.

    Small ones are kept to the bit; those that would take more than 6 kB, such as noise, are not.
    """
    factor = -(-max(pixels.shape[:2]) // LARGEST)
    picture = Image.fromarray(np.ascontiguousarray(pixels[::factor, ::factor]))
    stream = io.BytesIO()
    picture.save(stream, "WEBP", lossless=True, quality=60, method=4)
    if stream.tell() > HEAVY:
        stream = io.BytesIO()
        picture.save(stream, "WEBP", quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode()


def _grey(shares: Array) -> NDArray[np.uint8]:
    clipped = np.clip(np.nan_to_num(shares), 0, 1)
    return np.repeat(_bytes(255 * clipped)[..., None], 3, axis=2)


def _normals(normal: Array) -> NDArray[np.uint8]:
    vectors = np.clip(np.nan_to_num(normal.astype(np.float64)), -FARTHEST, FARTHEST)
    lengths = np.linalg.norm(vectors, axis=2, keepdims=True)
    unit = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
    return _bytes(255 * (0.5 + 0.5 * unit))


def _bytes(values: Array) -> NDArray[np.uint8]:
    return np.asarray(np.rint(values).astype(np.uint8))

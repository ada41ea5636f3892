"""Pictures of a report: an image, its true and predicted depth, and where they differ."""

import base64
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenegen.rooms.preview import NOTHING, srgb_bytes

Array = NDArray[Any]
SMALLEST = 128  # pixels across; smaller images are enlarged by a whole factor
ERROR_RAMP = np.array([(255, 255, 255), (253, 212, 158), (227, 74, 51), (127, 0, 0)], float)


def view_pictures(radiance: Array, true: Array, predicted: Array) -> list[str]:
    """Return image, true depth, predicted depth and error map of one view, as data URLs.

    Both depths share one grey scale, black at the truth's nearest and white at its farthest. The
    error |predicted - true| runs from white (none) to dark red (a tenth of the truth's range, or
    more). Pixels that are not scored are purple.

    Args:
        radiance: (H, W, 3); true, predicted: planar depth, (H, W), scene units.
    """
    known = np.isfinite(true)
    near, far = (true[known].min(), true[known].max()) if known.any() else (0.0, 1.0)
    span = max(float(far - near), 1e-9)
    with np.errstate(invalid="ignore", over="ignore"):
        grey = [np.clip((depth - near) / span, 0, 1) for depth in (true, predicted)]
        error = np.clip(np.abs(predicted - true) / (0.1 * span), 0, 1)
    shades = [np.repeat(_bytes(255 * np.nan_to_num(g))[..., None], 3, axis=2) for g in grey]
    stops = np.linspace(0, 1, len(ERROR_RAMP))
    ramp = [np.interp(np.nan_to_num(error, nan=1.0), stops, ERROR_RAMP[:, c]) for c in range(3)]
    pictures = [srgb_bytes(radiance), *shades, _bytes(np.stack(ramp, axis=2))]
    for picture in pictures[1:]:
        picture[~known] = NOTHING
    return [data_url(picture) for picture in pictures]


def data_url(pixels: NDArray[np.uint8]) -> str:
    """Return a picture, (H, W, 3), as a data URL that a page can hold."""
    picture = Image.fromarray(pixels)
    factor = -(-SMALLEST // max(picture.size))
    size = picture.width * factor, picture.height * factor
    stream = io.BytesIO()
    picture.resize(size, Image.Resampling.NEAREST).save(stream, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def _bytes(values: Array) -> NDArray[np.uint8]:
    return np.asarray(np.rint(values).astype(np.uint8))

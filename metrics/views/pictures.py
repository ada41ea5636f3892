"""Pictures of a report: an image, its depths and normals, true and predicted, and their error."""

import base64
import io
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from metrics.measures.surfaces.normals import normals_from_depth
from metrics.views.figures import load_matplotlib
from scenegen.camera import Lens
from scenegen.common.text_table import number

Array = NDArray[Any]
LARGEST = 128  # pixels across; larger images are shown by every second, third, ... of their pixels
HEAVY = 6_000  # bytes of a picture that is kept to the bit; others lose a little
FARTHEST = 1e6  # scene units; what is predicted beyond is drawn there
NOT_SCORED = (160, 160, 160)  # a grey that neither colour map has
COLOUR_MAPS = {"depth": "viridis", "error": "inferno"}  # their bars are in templates/style.css
IMAGE, TRUE_DEPTH, DEPTH, ERROR = "image", "true depth", "predicted depth", "depth error"
TRUE_NORMALS, NORMALS = "true normals", "predicted normals"
DERIVED_NORMALS = "normals of predicted depth"


@dataclass(frozen=True)
class Picture:
    """A picture, as a data URL.

    Attributes:
        mark: stands behind the caption; or empty.
        right: whether it shows the right answer.
        bar: the colour map, whose bar stands below the picture; or empty.
        ends: what the first and the last colour stand for.
    """

    caption: str
    url: str
    mark: str = ""
    right: bool = False
    bar: Literal["", "depth", "error"] = ""
    ends: tuple[str, str] = ("", "")


def normal_pictures(
    true: Array,
    predicted: Array,
    true_normal: Array,
    lens: Lens,
    predicted_normal: Array | None = None,
) -> list[Picture]:
    """Return normals, true and predicted, of one view of a room.

    They are shown as (x, y, z) = (red, green, blue). No value needs to be finite.

    Args:
        true, predicted: planar depth, (H, W), scene units.
        true_normal: camera frame, (H, W, 3).
        lens: with which normals of the predicted depth are made where there are no others.
        predicted_normal: camera frame, (H, W, 3), of any length.
    """
    scored = np.isfinite(true)
    if predicted_normal is None:
        drawn = np.clip(np.nan_to_num(predicted.astype(np.float64)), -FARTHEST, FARTHEST)
        name, normal = DERIVED_NORMALS, normals_from_depth(drawn, lens, scored)[0]
    else:
        name, normal = NORMALS, predicted_normal
    pictures = {TRUE_NORMALS: _normals(true_normal), name: _normals(normal)}
    for picture in pictures.values():
        picture[~scored] = NOT_SCORED
    return [Picture(caption, data_url(pixels)) for caption, pixels in pictures.items()]


def depth_pictures(shown: NDArray[np.uint8], true: Array, predicted: Array) -> list[Picture]:
    """Return an image (H, W, 3), sRGB bytes, depths (H, W), true and predicted, and their error.

    Both depths share one scale, from the truth's nearest to its farthest. The error |predicted -
    true| runs from none to a tenth of that range, or more. Pixels that are not scored are grey.
    """
    scored = np.isfinite(true)
    near, far = (true[scored].min(), true[scored].max()) if scored.any() else (0.0, 1.0)
    span = max(float(far - near), 1e-9)
    drawn = np.clip(np.nan_to_num(predicted.astype(np.float64)), -FARTHEST, FARTHEST)
    finite = np.nan_to_num(predicted.astype(np.float64), nan=FARTHEST)  # far off, if not a number
    error = np.abs(np.clip(finite, -FARTHEST, FARTHEST) - true) / (0.1 * span)
    pictures = {
        TRUE_DEPTH: _coloured((true - near) / span, "depth"),
        DEPTH: _coloured((drawn - near) / span, "depth"),
        ERROR: _coloured(error, "error"),
    }
    for picture in pictures.values():
        picture[~scored] = NOT_SCORED
    depths = {"bar": "depth", "ends": (number(float(near)), number(float(far)))}
    errors = {"bar": "error", "ends": ("0", f"≥ {0.1 * span:.2g}")}
    bars: dict[str, dict[str, Any]] = {TRUE_DEPTH: depths, DEPTH: depths, ERROR: errors}
    return [
        Picture(caption, data_url(pixels), **bars.get(caption, {}))
        for caption, pixels in {IMAGE: shown, **pictures}.items()
    ]


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


def _coloured(shares: Array, bar: str) -> NDArray[np.uint8]:
    """Return the colours of a map at shares from 0 to 1."""
    clipped = np.clip(np.nan_to_num(shares), 0, 1)
    return np.array(load_matplotlib().colormaps[COLOUR_MAPS[bar]](clipped, bytes=True)[..., :3])


def _normals(normal: Array) -> NDArray[np.uint8]:
    vectors = np.clip(np.nan_to_num(normal.astype(np.float64)), -FARTHEST, FARTHEST)
    lengths = np.linalg.norm(vectors, axis=2, keepdims=True)
    unit = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
    return np.asarray(np.rint(255 * (0.5 + 0.5 * unit)).astype(np.uint8))

"""The images of questions as PNG files."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenegen.rooms.preview import srgb_bytes

LARGEST = 512  # pixels of a side; larger images are made smaller by a whole factor


def png(radiance: NDArray[Any]) -> bytes:
    """Return linear radiance, (H, W, 3), as a PNG file in sRGB; what is not finite is black."""
    picture = Image.fromarray(srgb_bytes(np.nan_to_num(radiance)))
    factor = -(-max(picture.size) // LARGEST)
    out = io.BytesIO()
    (picture if factor == 1 else picture.reduce(factor)).save(out, "PNG", compress_level=6)
    return out.getvalue()

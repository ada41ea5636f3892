"""The images of questions as PNG files, encoded once for all who are asked."""

import io
from collections import OrderedDict
from collections.abc import Sequence
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenegen.rooms.preview import srgb_bytes

KEPT_BYTES = 256 * 2**20
LARGEST = 512  # pixels of a side; larger images are made smaller by a whole factor


def png(radiance: NDArray[Any]) -> bytes:
    """Return linear radiance, (H, W, 3), as a PNG file in sRGB; what is not finite is black."""
    picture = Image.fromarray(srgb_bytes(np.nan_to_num(radiance)))
    factor = -(-max(picture.size) // LARGEST)
    out = io.BytesIO()
    (picture if factor == 1 else picture.reduce(factor)).save(out, "PNG", compress_level=6)
    return out.getvalue()


class KeptPictures:
    """The encoded images of the questions that were asked last; for any number of threads."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Any, Sequence[bytes]] = OrderedDict()
        self._bytes = 0
        self._lock = Lock()

    def get(self, key: Any) -> Sequence[bytes] | None:
        """Return what was put under a key; None where it is no longer kept."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
            return self._kept.get(key)

    def put(self, key: Any, images: Sequence[bytes]) -> None:
        """Keep images, and drop those that were used longest ago beyond `KEPT_BYTES`."""
        with self._lock:
            if key not in self._kept:
                self._kept[key] = images
                self._bytes += sum(map(len, images))
            while self._bytes > KEPT_BYTES and len(self._kept) > 1:
                self._bytes -= sum(map(len, self._kept.popitem(last=False)[1]))

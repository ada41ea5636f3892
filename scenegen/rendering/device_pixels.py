"""Pixels that stay on the device that rendered them, to be handed on by DLPack."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi


@dataclass(frozen=True, eq=False)
class DeviceImage:
    """A field of one image, among those of its launch.

    Attributes:
        channels: of all images of the launch, Dr.Jit arrays.
        first: place of its first pixel in them.
        height, width: of the image, pixels.
    """

    channels: Sequence[Any]
    first: int
    height: int
    width: int


def stacked(images: Sequence[DeviceImage], shape: tuple[int, ...]) -> Any:
    """Return images as one Dr.Jit tensor of a shape (..., H, W) or (..., H, W, C).

    It has `__dlpack__`, from which torch and others take it without a copy.
    """
    pixels, channels = images[0].height * images[0].width, len(images[0].channels)
    kind: Any = type(images[0].channels[0])
    values = dr.empty(kind, len(images) * pixels * channels)
    launches: dict[int, list[int]] = {}
    for place, image in enumerate(images):
        launches.setdefault(id(image.channels), []).append(place)
    for places in launches.values():
        ray = dr.arange(mi.UInt32, len(places) * pixels)
        row, pixel = ray // pixels, ray % pixels
        source = dr.gather(mi.UInt32, mi.UInt32([images[i].first for i in places]), row) + pixel
        target = dr.gather(mi.UInt32, mi.UInt32(places), row) * pixels + pixel
        for channel, plane in enumerate(images[places[0]].channels):
            dr.scatter(values, dr.gather(kind, plane, source), target * channels + channel)
    dr.eval(values)
    tensor: Any = dr.tensor_t(kind)
    return tensor(values, shape)

"""OpenEXR files: their channels, and the picture among them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError

Array = NDArray[Any]
WHOLE = "Composite.Combined.", "Combined.", "rgba.", "beauty."  # ends of layers that show all


def exr_channels(path: Path, most: int) -> dict[str, Array]:
    """Return all channels by name; before it stands that of the part, where there are several.

    Raises FileFormatError for what is no such file, or has more than `most` pixels.
    """
    import OpenEXR

    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            for part in file.parts:
                low, high = part.header["dataWindow"]
                width, height = (int(b - a) + 1 for a, b in zip(low, high, strict=True))
                if height * width > most:
                    raise FileFormatError(path, f"{height}x{width}", f"at most {most:,} pixels")
        with OpenEXR.File(str(path), separate_channels=True) as file:
            several = len(file.parts) > 1
            return {
                f"{part.name()}.{name}" if several else name: np.asarray(channel.pixels)
                for part in file.parts
                for name, channel in part.channels.items()
            }
    except FileFormatError:
        raise
    except Exception as error:  # the library raises what it meets
        reason = " ".join(str(error).split())
        raise FileFormatError(path, f"cannot be read ({reason:.120})") from error


def layers_of(channels: Mapping[str, Array], names: Sequence[str]) -> dict[str, list[str]]:
    """Return the channels of layers that have all of some names, by what stands before these."""
    before = [c.removesuffix(names[0]) for c in channels if c.endswith(names[0])]
    found = {layer: [layer + n for n in names] for layer in before if layer[-1:] in ("", ".")}
    return {layer: some for layer, some in found.items() if channels.keys() >= set(some)}


def exr_picture(path: Path, most: int) -> Array:
    """Return the colours of a file, (H, W, 3) float32, linear; a single channel is grey.

    Of several layers that which shows all is taken. Raises FileFormatError, naming the channels,
    where none is, and as `exr_channels`.
    """
    channels = exr_channels(path, most)
    found = layers_of(channels, "RGB") or layers_of(channels, "rgb")
    ends = ([layer for layer in found if layer.endswith(end)] for end in WHOLE)
    layers = [""] if "" in found else next(filter(None, ends), [*found])
    names = found[layers[0]] if len(layers) == 1 else []
    grey = list(channels) if len(channels) == 1 else ["Y"]
    if not found and channels.keys() >= set(grey) and not {"RY", "BY"} & channels.keys():
        names = grey * 3
    if len({channels[name].shape for name in names}) != 1:
        listed = f"the channels {', '.join(list(channels)[:12])}"
        raise FileFormatError(path, listed, "R, G and B of one layer", "save only this layer")
    return np.stack([channels[name] for name in names], axis=-1).astype(np.float32)

"""Colours of signed errors of depth: blue is too near, grey is right, red is too far."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
TOO_NEAR, RIGHT, TOO_FAR = (0, 80, 200), (222, 222, 222), (200, 30, 0)
UNKNOWN = (120, 0, 140)  # the truth has no depth there


def error_colors(error: Array, full: float) -> Array:
    """Return colours, (N, 3) uint8, of predicted minus true depths, (N,), NaN where not known.

    Errors of `full` scene units and more have the full colour.
    """
    known = np.isfinite(error)
    place = np.clip(np.where(known, error, 0.0) / full, -1.0, 1.0)
    channels = zip(TOO_NEAR, RIGHT, TOO_FAR, strict=True)
    colors = np.stack([np.interp(place, (-1, 0, 1), channel) for channel in channels], axis=-1)
    colors[~known] = UNKNOWN
    return np.rint(colors).astype(np.uint8)


def legend(full: float) -> str:
    """Return a bar of the colours with its limits, as HTML."""
    stops = ", ".join(f"rgb{color}" for color in (TOO_NEAR, RIGHT, TOO_FAR))
    return (
        '<div style="margin:0.4em 0.8em;font-size:0.85em">'
        f'<div style="height:0.8em;background:linear-gradient(to right, {stops})"></div>'
        '<div style="display:flex;justify-content:space-between">'
        f"<span>{full:g} too near</span><span>right</span><span>{full:g} too far</span>"
        "</div></div>"
    )

"""From radiance to a picture, as cameras do: exposure, white balance, a tone curve, sRGB.

Bright and dark parts of a picture are brought nearer to its middle, as phones do: by a share of
their luminance, smoothed by a guided filter (He, Sun and Tang, 2013). The tone curve is
y = x (1 + x / w^2) / (1 + x), extended Reinhard (2002), of each channel, where w is the exposed
radiance that becomes white. After sRGB's curve, c y^2 (3 - 2 y) + (1 - c) y adds contrast.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.srgb import encoded
from scenegen.rendering.ground_truth import encode_image

Array = NDArray[Any]
# What `develop` finds out: factor of radiance, further factors of red, green and blue, and w.
EXPOSURE = ("exposure", "red", "green", "blue", "white")
KEY = 0.4  # exposed radiance of the middle of a picture
BALANCE = 0.8  # how far white balance goes towards grey light
BRIGHT = 99.5  # percentile of the radiance, WHITER times which becomes white
WHITER = 1.15
LEAST_WHITE = 2.5
HIGHLIGHTS, SHADOWS = 0.4, 0.05  # shares that are taken off above and below KEY
SMOOTH = 10  # windows of the guided filter along a picture's shorter side
EDGE = 1.0  # variance of log2 luminance in such a window that is kept as an edge
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
CONTRAST = 0.7  # share of a smooth step in the tone curve


def develop(radiance: Array, albedo: Array, inside: Array, dtype: str, noise: Array | None) -> Any:
    """Return a picture as it is stored, (H, W, 3), and its EXPOSURE, (5,).

    8-bit pictures are developed; floating-point ones hold the radiance as it is.

    Args:
        radiance: linear RGB, (H, W, 3).
        albedo: of the surfaces, (H, W, 3), by which the colour of the light is told.
        inside: pixels that show the room, not what is outside the windows, (H, W).
        noise: added to the developed picture, (H, W, 3), 1 being white; None for none.
    """
    shown = inside if inside.any() else np.ones_like(inside)
    luminance = radiance @ LUMINANCE
    middle = np.exp(np.log(luminance[shown] + 1e-9).mean())
    light = radiance[shown] / np.maximum(albedo[shown], 0.05)
    mean = np.maximum(np.median(light, axis=0), 1e-9)
    gains = (mean.mean() / mean) ** BALANCE
    gains /= gains @ LUMINANCE
    exposure = KEY / max(float(middle), 1e-9)
    exposed = evened(radiance * (gains * exposure))
    white = max(WHITER * float(np.percentile(exposed.max(axis=-1), BRIGHT)), LEAST_WHITE)
    found = np.array([exposure, *gains, white])
    if dtype != "uint8":
        return encode_image(radiance, dtype), found
    return encode_image(tone(exposed, white, noise), dtype), found


def redeveloped(radiance: Array, found: Array) -> Array:
    """Return radiance, (H, W, 3), as a picture, 0 to 1, with the EXPOSURE of another one."""
    exposed = evened(radiance.astype(np.float64) * (found[0] * found[1:4]))
    return tone(exposed, max(float(found[4]), LEAST_WHITE))


def evened(exposed: Array) -> Array:
    """Return exposed radiance whose bright and dark parts are nearer to KEY; edges stay sharp."""
    from scipy.ndimage import uniform_filter  # takes a while, and is seldom needed

    def mean(values: Array) -> Array:
        return np.asarray(uniform_filter(values, 2 * (min(values.shape) // SMOOTH) + 1))

    level = np.log2(np.maximum(exposed @ LUMINANCE, 1e-4) / KEY)
    middle = mean(level)
    variance = mean(level * level) - middle * middle
    kept = variance / (variance + EDGE)
    smooth = mean(kept) * level + mean((1 - kept) * middle)
    stops = np.where(smooth > 0, HIGHLIGHTS, SHADOWS) * smooth
    return np.asarray(exposed * np.exp2(-stops)[..., None])


def tone(exposed: Array, white: float, noise: Array | None = None) -> Array:
    """Return exposed radiance as sRGB, 0 to 1 where it is not brighter than white."""
    curve = exposed * (1 + exposed / white**2) / (1 + exposed)
    y = encoded(curve)
    y += CONTRAST * (y * y * (3 - 2 * y) - y)
    return np.asarray(np.clip(y if noise is None else y + noise, 0.0, 1.0))

"""The paper's shading equation in numpy: the reference that every renderer is tested against."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def shade(
    points: NDArray[Any],
    normals: NDArray[Any],
    reflectance: NDArray[Any],
    light_positions: NDArray[Any],
    light_colors: NDArray[Any],
    ambient: NDArray[Any],
    attenuation: NDArray[Any],
) -> NDArray[np.float64]:
    """Return linear radiance, Pix2Shape (IJCV 2020), appendix "Rendering Details":

    I = rho (L_a + sum_j L_j max(0, n . d_j / |d_j|) / (k_l |d_j| + k_q |d_j|^2)), d_j = l_j - p.

    All positions and normals are in one frame (camera or world), lengths in scene units.

    Args:
        points, normals: (..., 3); a zero normal receives ambient light only.
        reflectance: rho, (..., 3) or (3,).
        light_positions, light_colors: (L, 3).
        ambient: L_a, (3,).
        attenuation: (k_l, k_q), (2,).
    """
    total = np.broadcast_to(np.asarray(ambient, np.float64), np.shape(points)).copy()
    for position, color in zip(light_positions, light_colors, strict=True):
        to_light = position - np.asarray(points, np.float64)
        distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
        distance[distance == 0] = np.inf  # a light on the surface itself gives nothing
        cosine = np.sum(normals * to_light, axis=-1, keepdims=True) / distance
        falloff = attenuation[0] * distance + attenuation[1] * distance**2
        total += color * np.maximum(cosine, 0.0) / falloff
    return np.asarray(reflectance * total)

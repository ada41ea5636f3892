"""The shading equation in numpy: how light falls off with distance and what a surface reflects.

Every renderer here is tested against `shade`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

SHADOW_OFFSET = 1e-4  # scene units from the surface to the start of its shadow rays


def shade(
    points: NDArray[Any],
    normals: NDArray[Any],
    reflectance: NDArray[Any],
    light_positions: NDArray[Any],
    light_colors: NDArray[Any],
    ambient: NDArray[Any],
    attenuation: NDArray[Any],
    specular: NDArray[Any] | float = 0.0,
    shininess: NDArray[Any] | float = 1.0,
    viewpoint: NDArray[Any] | None = None,
) -> NDArray[np.float64]:
    """Return linear radiance by Pix2Shape (IJCV 2020), appendix "Rendering Details".

    I = rho (L_a + sum_j L_j max(0, n . d_j / |d_j|) / (k_l |d_j| + k_q |d_j|^2)), d_j = l_j - p

    So light falls off as 1 / (k_l |d| + k_q |d|^2). If `specular` is given, Phong's lobe is added
    (Phong, CACM 1975; the paper names the model without an equation):

    k_s sum_j L_j max(0, r . d_j / |d_j|)^m / (k_l |d_j| + k_q |d_j|^2)

    over the lights with n . d_j > 0, where r is the mirrored direction from the viewpoint. All
    positions and normals are in the same frame (camera or world), lengths in scene units.

    Args:
        points, normals: p and n, (..., 3); a zero normal receives ambient light only.
        reflectance: rho, (..., 3) or (3,).
        light_positions, light_colors: l_j and L_j, (L, 3).
        ambient: L_a, (3,).
        attenuation: (k_l, k_q), (2,).
        specular, shininess: k_s and m, scalars or (...).
        viewpoint: the camera's position, (3,); needed if `specular` is not 0.
    """
    total = np.broadcast_to(np.asarray(ambient, np.float64), np.shape(points)).copy()
    shine = np.zeros_like(total)
    if viewpoint is not None:
        view = np.asarray(points, np.float64) - viewpoint
        mirrored = view - 2 * np.sum(view * normals, axis=-1, keepdims=True) * normals
        mirrored /= np.maximum(np.linalg.norm(mirrored, axis=-1, keepdims=True), 1e-300)
    for position, color in zip(light_positions, light_colors, strict=True):
        to_light = position - np.asarray(points, np.float64)
        distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
        distance[distance == 0] = np.inf  # a light at the point itself gives nothing
        cosine = np.sum(normals * to_light, axis=-1, keepdims=True) / distance
        falloff = attenuation[0] * distance + attenuation[1] * distance**2
        total += color * np.maximum(cosine, 0.0) / falloff
        if viewpoint is not None:
            toward = np.sum(mirrored * to_light, axis=-1, keepdims=True) / distance
            lobe = np.maximum(toward, 0.0) ** np.asarray(shininess)[..., None]
            shine += np.where(cosine > 0, color * lobe / falloff, 0.0)
    return np.asarray(reflectance * total + np.asarray(specular)[..., None] * shine)

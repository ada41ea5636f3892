"""Texture coordinates in metres, without stretching: every part is wrapped or papered.

A part that was lofted or swept is wrapped in its sheet, as in cloth. Where that would be stretched,
and on flat sides, it is papered: each triangle is projected along the axis that it faces most,
which shortens lengths by 1 / sqrt(3) at most. The second coordinate runs along a sheet or, on flat
sides, along the longest side of a piece, as the grain of wood does.
"""

import numpy as np

from scenegen.objects.families.parts.surfaces import Part
from scenegen.objects.solids import Array

LEAST_STRETCH, MOST_STRETCH = 0.65, 1.6  # of a wrapped triangle
_SHIFT = np.array([0.7548776662, 0.5698402910])  # R2 sequence: no two boards show the same grain


def corner_uv(part: Part, vertices: Array, *, whole: bool = False) -> Array:
    """Return texture coordinates of a part's corners, (F, 3, 2).

    Args:
        vertices: the part's vertices in metres, (V, 3).
        whole: whether the coordinates run from 0 to 1 over each piece as seen from the front, as
            those of pictures do, instead of being in metres.
    """
    blocks = vertices.reshape(part.pieces, -1, 3)
    low, high = blocks.min(axis=1), blocks.max(axis=1)
    piece = np.repeat(np.arange(part.pieces), len(part.faces) // part.pieces)
    corners = vertices[part.faces]
    if whole:
        if part.sheet is not None and (high - low)[:, 2].min() > 1e-3 and part.pieces > 1:
            return np.asarray(part.sheet[part.faces][..., :2])
        share = (corners - low[piece, None]) / np.maximum(high - low, 1e-9)[piece, None]
        flat = (high - low)[piece, 1] < (high - low)[piece, 2]
        return np.asarray(np.where(flat[:, None, None], share[..., ::2], share[..., :2]))
    longest = np.argmax(high - low, axis=1)[piece]
    uv = _papered(corners, longest)
    if part.sheet is not None:
        wrapped = _wrapped(part, corners)
        least, most = stretches(corners, wrapped)
        fits = (least > LEAST_STRETCH) & (most < MOST_STRETCH)
        fits &= (part.sheet[part.faces][..., 2] > 0.0).all(axis=1)
        uv = np.where(fits[:, None, None], wrapped, uv)
    return np.asarray(uv + (_SHIFT * piece[:, None])[:, None] % 1.0)


def _papered(corners: Array, longest: Array) -> Array:
    """Project triangles along their main axes; the second coordinate is that along `longest`."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.argmax(np.abs(normal), axis=1)
    first, second = (facing + 1) % 3, (facing + 2) % 3
    swap = first == longest
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    pick = np.stack([first, second], axis=1)[:, None].repeat(3, axis=1)
    return np.take_along_axis(corners, pick, axis=2)


def _wrapped(part: Part, corners: Array) -> Array:
    """Return coordinates around and along; exchanged for a low rim, such as a table top's edge."""
    assert part.sheet is not None
    sheet = part.sheet[part.faces]
    around, along, whole = sheet[..., 0], sheet[..., 1], sheet[..., 2]
    crosses = np.ptp(around, axis=1) > 0.5 * whole[:, 0]  # the seam
    around = around + np.where(crosses[:, None] & (around < 0.5 * whole), whole, 0.0)
    flat = np.stack([around, along], axis=2)
    # Parts are scaled differently along y, so distances on the sheet are fitted to the edges.
    wound = (whole > 0.0).all(axis=1)
    sides = np.square(np.roll(flat, 1, axis=1) - flat)[wound].reshape(-1, 2)
    lengths = np.square(np.roll(corners, 1, axis=1) - corners)[wound].sum(axis=2).ravel()
    (a, b), (c, d) = sides.T @ sides
    e, f = sides.T @ lengths
    determinant = max(a * d - b * c, 1e-30)
    factors = np.array([d * e - b * f, a * f - c * e]) / determinant
    factors = np.maximum(factors, 1e-12)
    flat = flat * np.sqrt(factors)
    low = whole.max() * factors[0] ** 0.5 > 4 * np.ptp(along) * factors[1] ** 0.5
    return np.asarray(flat[..., ::-1] if low else flat)


def stretches(corners: Array, uv: Array) -> tuple[Array, Array]:
    """Return the least and greatest factor by which the map from surface to texture scales lengths.

    They are the singular values of its Jacobian, (F,) each, for triangles (F, 3, 3) and texture
    coordinates (F, 3, 2).
    """
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.maximum(np.linalg.norm(a, axis=1), 1e-12)
    along = (a * b).sum(axis=1) / length
    across = np.linalg.norm(np.cross(a, b), axis=1) / length
    p, q = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    first = p / length[:, None]
    second = (q - first * along[:, None]) / np.maximum(across, 1e-12)[:, None]
    total = np.square(first).sum(axis=1) + np.square(second).sum(axis=1)
    area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    root = np.sqrt(np.maximum(total * total / 4 - area * area, 0.0))
    return np.sqrt(np.maximum(total / 2 - root, 0.0)), np.sqrt(total / 2 + root)

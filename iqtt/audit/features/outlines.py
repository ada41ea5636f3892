"""Numbers that describe an outline: all that a silhouette tells that turning the picture keeps.

`outlines` makes them of silhouettes, with numpy alone and no learned part: sizes, moments,
widths, the boundary's shape, and how the silhouette's parts lie to each other. None of them knows
of cubes, rotations or 3D. The audit's probes and `baselines/outline.py` look at them.
"""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
DIRECTIONS = 64  # directions in the picture in which widths and reaches are taken
RADII = 8  # distances from the middle, each a sixteenth of the shorter side
RINGS = 16  # rings of the power spectrum
HARMONICS = 8  # Fourier descriptors of a closed curve
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_CHUNK = 256  # silhouettes at a time: bounds the memory
_GRID = 64  # pixels a side of the smaller silhouettes whose power spectrum is taken


def outlines(shown: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return features of the silhouettes of Q questions, and distances between them.

    Args:
        shown: silhouettes of the images of each question, (Q, I, H, W).

    Returns features, (Q, I, len(FEATURES)) float32, and distances between any two images of a
    question, (Q, I, I, len(DISTANCES)) float32. An empty silhouette has only zeros.
    """
    questions, images = shown.shape[:2]
    step = max(1, _CHUNK // images)
    features = [np.zeros((0, images, len(FEATURES)))]
    distances = [np.zeros((0, images, images, len(DISTANCES)))]
    for start in range(0, questions, step):
        masks = shown[start : start + step].reshape(-1, *shown.shape[2:])
        numbers, signature = _describe(masks)
        features.append(numbers.reshape(-1, images, len(FEATURES)))
        distances.append(_distances(signature.reshape(-1, images, *signature.shape[1:])))
    return tuple(np.concatenate(v).astype(np.float32) for v in (features, distances))  # type: ignore[return-value]


def nearest_outline(distances: Array) -> Array:
    """Return how far an outline is from another where both lie on each other as well as may be.

    That is the distance of their areas in polar cells, turned and perhaps flipped.

    Args:
        distances: as `outlines` gives them, (..., len(DISTANCES)).
    """
    return np.asarray(distances[..., DISTANCES.index("area in polar cells")])


def _describe(masks: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the features of silhouettes, (N, D), and their signatures, (N, C, DIRECTIONS).

    A signature holds, for each direction from the silhouette's middle, how far the silhouette
    reaches, where its boundary is, and how much of it lies at each of RADII distances.
    """
    short = min(masks.shape[1:])
    empty = ~np.asarray(masks.any(axis=(1, 2)))
    left, right, rows = _row_ends(masks)
    middle, invariants = moments(masks)
    points = np.stack([np.concatenate([left, right], 1), np.concatenate([rows, rows], 1)], 2)
    reach = _reaches((points - middle[:, None]) / short)
    half = DIRECTIONS // 2
    widths = reach[:, :half] + reach[:, half:]
    # Cauchy: the mean width of a convex body times pi is its perimeter.
    hull_perimeter = widths.mean(axis=1) * np.pi
    slope = np.fft.irfft(np.fft.rfft(reach) * 1j * np.arange(half + 1), DIRECTIONS)
    hull_area = np.pi * (reach**2 - slope**2).mean(axis=1)
    area = masks.sum(axis=(1, 2)) / short**2
    perimeter = _perimeters(masks) / short
    across = widths[np.arange(len(masks)), (widths.argmax(axis=1) + half // 2) % half]
    boundary, polar, distances = _polar(masks, middle, short)
    most, least = widths.max(axis=1), widths.min(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = [
            area / hull_area,
            perimeter / hull_perimeter,
            4 * np.pi * area / perimeter**2,
            least / most,
        ]
    columns = [
        *(area, perimeter, hull_area, hull_perimeter, *ratios, most, least, across),
        *np.quantile(widths, (0.25, 0.5, 0.75), axis=1),
        *np.abs(np.fft.rfft(reach) / DIRECTIONS)[:, : HARMONICS + 1].T,
        *np.abs(np.fft.rfft(boundary) / DIRECTIONS)[:, : HARMONICS + 1].T,
        *distances.T,
        *invariants.T,
        *_spectrum(masks).T,
    ]
    signature = np.concatenate([reach[:, None], boundary[:, None], polar], axis=1)
    signature[empty] = 0
    return np.where(empty[:, None], 0, np.stack(columns, axis=1)), signature


def _distances(signature: Array) -> Array:
    """Return how far apart signatures are, turned as well as may be, (Q, I, I, len(DISTANCES)).

    One of the two may also be flipped, as an outline seen from behind is its own mirror image.

    Args:
        signature: (Q, I, C, DIRECTIONS).
    """
    images = signature.shape[1]
    waves = np.fft.rfft(signature)
    result = np.zeros((len(signature), images, images, len(DISTANCES)))
    for a, b in itertools.combinations(range(images), 2):
        for k, rows in enumerate(_SIGNATURE_PARTS):
            norm = (signature[:, [a, b], rows] ** 2).sum(axis=(1, 2, 3))
            first, second = waves[:, a, rows], waves[:, b, rows]
            # The correlation at all turns at once; without the conjugate, with the mirror image.
            same = np.fft.irfft((first * second.conj()).sum(axis=1), DIRECTIONS).max(axis=1)
            mirrored = np.fft.irfft((first * second).sum(axis=1), DIRECTIONS).max(axis=1)
            apart = np.sqrt(np.maximum(norm - 2 * np.maximum(same, mirrored), 0))
            result[:, a, b, k] = result[:, b, a, k] = apart
    return result


FEATURES = (
    *("area", "perimeter", "hull area", "hull perimeter", "convexity", "roughness"),
    *("roundness", "slenderness", "largest width", "least width", "width across the largest"),
    *("width, 1st quartile", "width, median", "width, 3rd quartile"),
    *(f"reach, harmonic {k}" for k in range(HARMONICS + 1)),
    *(f"boundary, harmonic {k}" for k in range(HARMONICS + 1)),
    *(f"distance from the middle, {100 * q:g}%" for q in QUANTILES),
    *("longer spread", "shorter spread"),
    *(f"moment {order}, {fold}-fold" for order, fold in ((3, 1), (3, 3), (4, 0), (4, 2), (4, 4))),
    *(f"power spectrum, ring {k}" for k in range(RINGS)),
)
DISTANCES = ("reach in all directions", "boundary in all directions", "area in polar cells")
_SIGNATURE_PARTS = (slice(0, 1), slice(1, 2), slice(2, None))


def _row_ends(masks: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return the x of the first and last pixel of each row, and its y; empty rows repeat others."""
    height, width = masks.shape[1:]
    shown = masks.any(axis=2)
    left, right = masks.argmax(axis=2) + 0.5, width - masks[:, :, ::-1].argmax(axis=2) - 0.5
    rows = np.broadcast_to(np.arange(height) + 0.5, left.shape)
    first = shown.argmax(axis=1)[:, None]
    return tuple(  # type: ignore[return-value]
        np.where(shown, values, np.take_along_axis(values, first, axis=1))
        for values in (left, right, rows)
    )


def _reaches(apart: Array) -> Array:
    """Return how far the points reach in each direction: the support function, (N, DIRECTIONS)."""
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    towards = np.stack([np.cos(angle), np.sin(angle)]).astype(np.float32)
    return np.asarray((apart.astype(np.float32) @ towards).max(axis=1).astype(np.float64))


def _perimeters(masks: NDArray[np.bool_]) -> Array:
    """Return the boundaries' lengths, pixels, by Crofton's formula in four directions."""
    padded = np.pad(masks, ((0, 0), (1, 1), (1, 1)))
    straight = [padded[:, 1:] ^ padded[:, :-1], padded[:, :, 1:] ^ padded[:, :, :-1]]
    slanted = [padded[:, 1:, 1:] ^ padded[:, :-1, :-1], padded[:, 1:, :-1] ^ padded[:, :-1, 1:]]
    count = [sum(np.count_nonzero(c, axis=(1, 2)) for c in two) for two in (straight, slanted)]
    return np.asarray(np.pi / 8 * (count[0] + count[1] / np.sqrt(2)))


def moments(masks: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the middle, (N, 2) x and y in pixels, and moment invariants, (N, 7).

    The invariants are lengths: roots of the moduli of complex moments, which are
    those of Hu ("Visual pattern recognition by moment invariants", 1962), kept at their size.
    """
    height, width = masks.shape[1:]
    short = min(height, width)
    weight = masks.astype(np.float64)
    total = np.maximum(weight.sum(axis=(1, 2)), 1)
    y, x = np.arange(height) + 0.5, np.arange(width) + 0.5
    middle = np.stack([weight.sum(axis=1) @ x, weight.sum(axis=2) @ y], axis=1) / total[:, None]
    powers = np.arange(5)[:, None]
    xs = ((x - middle[:, :1]) / short)[:, None] ** powers
    ys = ((y - middle[:, 1:]) / short)[:, None] ** powers
    m = np.moveaxis(ys @ weight @ xs.swapaxes(1, 2), 0, 2) / total  # m[p, q]: y^p x^q
    c20 = m[0, 2] - m[2, 0] + 2j * m[1, 1]
    c11 = m[0, 2] + m[2, 0]
    c30 = m[0, 3] - 3 * m[2, 1] + 1j * (3 * m[1, 2] - m[3, 0])
    c21 = m[0, 3] + m[2, 1] + 1j * (m[1, 2] + m[3, 0])
    c40 = m[0, 4] - 6 * m[2, 2] + m[4, 0] + 4j * (m[1, 3] - m[3, 1])
    c31 = m[0, 4] - m[4, 0] + 2j * (m[1, 3] + m[3, 1])
    c22 = m[0, 4] + 2 * m[2, 2] + m[4, 0]
    spread = np.sqrt(np.maximum([c11 + np.abs(c20), c11 - np.abs(c20)], 0) / 2)
    third = np.cbrt([np.abs(c21), np.abs(c30)])
    fourth = np.power([c22, np.abs(c31), np.abs(c40)], 1 / 4)
    return middle, np.concatenate([spread, third, fourth]).T


def _polar(masks: NDArray[np.bool_], middle: Array, short: int) -> tuple[Array, Array, Array]:
    """Return what lies around the middle of each silhouette, in shares of the shorter side.

    That are the farthest pixel in each sector, (N, DIRECTIONS); the area in each cell of a polar
    grid, (N, RADII, DIRECTIONS); and QUANTILES of the pixels' distances, (N, len(QUANTILES)).
    """
    which, row, column = np.nonzero(masks)
    x, y = column + 0.5 - middle[which, 0], row + 0.5 - middle[which, 1]
    distance = np.hypot(x, y) / short
    sector = ((np.arctan2(y, x) / (2 * np.pi)) % 1 * DIRECTIONS).astype(np.int64) % DIRECTIONS
    farthest = np.zeros(len(masks) * DIRECTIONS)
    np.maximum.at(farthest, which * DIRECTIONS + sector, distance)
    radius = np.minimum((distance * 2 * RADII).astype(np.int64), RADII - 1)
    cell = (which * RADII + radius) * DIRECTIONS + sector
    area: Array = np.bincount(cell, minlength=len(masks) * RADII * DIRECTIONS) / short**2
    levels = 256
    bins = np.minimum((distance * levels).astype(np.int64), levels - 1)
    counts = np.bincount(which * levels + bins, minlength=len(masks) * levels)
    within = np.cumsum(counts.reshape(-1, levels), axis=1)
    share = within / np.maximum(within[:, -1:], 1)
    quantiles = np.stack([(share < q).sum(axis=1) for q in QUANTILES], axis=1) / levels
    grid = area.reshape(-1, RADII, DIRECTIONS)
    return farthest.reshape(-1, DIRECTIONS), grid, quantiles


def _spectrum(masks: NDArray[np.bool_]) -> Array:
    """Return the power of each ring of frequencies, logarithms, (N, RINGS)."""
    height, width = masks.shape[1:]
    step = max(1, min(height, width) // _GRID)
    rows, columns = height // step * step, width // step * step
    small = masks[:, :rows, :columns].astype(np.float32)
    small = small.reshape(len(masks), rows // step, step, columns // step, step).mean(axis=(2, 4))
    power = np.abs(np.fft.fft2(small)) ** 2
    frequency = np.hypot(
        np.fft.fftfreq(small.shape[1])[:, None], np.fft.fftfreq(small.shape[2])[None]
    )
    # Rings of equal width; the first holds the slowest waves that fit the image.
    ring = np.minimum((frequency * 4 * RINGS).astype(np.int64), RINGS)
    weights = np.stack([(ring == k) / max(1, np.count_nonzero(ring == k)) for k in range(RINGS)])
    rings = power.reshape(len(masks), -1) @ weights.reshape(RINGS, -1).T
    return np.asarray(np.log(rings / small[0].size + 1e-6))

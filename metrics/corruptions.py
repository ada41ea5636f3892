"""Corrupted images: how much of a method's score rests on clean pictures.

A corrupted file has other images and the same truth, so `bench compare` pairs the scores of both.

Twelve of the corruptions of RoboDepth (Kong et al. 2023), most of them with the five severities of
ImageNet-C (Hendrycks and Dietterich 2019). Blurs are as wide in an image of 224 pixels as there,
and in proportion in others. Fog is the same over the image, as fog by distance would show depth.
Images are sRGB, (H, W, 3), from 0 to 1; what exceeds that is cut off.
"""

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from metrics.measured.reader import Images, open_images, size_of
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.names import check_choice
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.files.content import SHA256, dataset_digest, seal
from scenegen.files.images.pictures import after_jpeg
from scenegen.files.input_file import is_virtual
from scenegen.files.new_file import written_beside
from scenegen.layout import CORRUPTION

Array = NDArray[Any]
Rng = np.random.Generator
USUAL_SIDE = 224  # pixels of the images for which the widths of blurs were chosen
SEVERITIES = range(1, 6)


class Corruption(NamedTuple):
    """How an image is changed, and by how much at each severity."""

    change: Callable[[Array, Any, Rng], Array]
    levels: Sequence[Any]


def _noise(image: Array, deviation: float, rng: Rng) -> Array:
    return image + rng.normal(0.0, deviation, image.shape)


def _shot(image: Array, photons: float, rng: Rng) -> Array:
    return rng.poisson(image * photons) / photons


def _impulse(image: Array, share: float, rng: Rng) -> Array:
    where, white = rng.random((2, *image.shape))
    return np.where(where < share, white < 0.5, image)


def _blur(image: Array, radius: float, _: Rng) -> Array:
    size = radius * min(image.shape[:2]) / USUAL_SIDE
    reach = int(np.ceil(size + 0.5))
    x = np.arange(-reach, reach + 1)
    return _filtered(image, np.clip(size + 0.5 - np.hypot(x[:, None], x), 0.0, 1.0))


def _motion(image: Array, length: float, rng: Rng) -> Array:
    size, angle = length * min(image.shape[:2]) / USUAL_SIDE, rng.uniform(0.0, np.pi)
    reach = int(np.ceil(size / 2.0 + 0.5))
    x = np.arange(-reach, reach + 1)
    along = x * np.cos(angle) + x[:, None] * np.sin(angle)
    across = x * np.sin(angle) - x[:, None] * np.cos(angle)
    ends = np.clip(size / 2.0 + 0.5 - np.abs(along), 0.0, 1.0)
    return _filtered(image, ends * np.clip(1.0 - np.abs(across), 0.0, 1.0))


def _filtered(image: Array, kernel: Array) -> Array:
    from scipy.signal import fftconvolve

    reach = len(kernel) // 2
    padded = np.pad(image, ((reach, reach), (reach, reach), (0, 0)), mode="symmetric")
    weights = (kernel / kernel.sum())[..., None]
    return np.asarray(fftconvolve(padded, weights, mode="valid", axes=(0, 1)))


def _fog(image: Array, thickness: float, rng: Rng) -> Array:
    height, width = image.shape[:2]
    cloud = np.zeros((height, width))
    for step in (2, 4, 8, 16, 32):  # smooth noise of ever smaller patches, each half as strong
        coarse = rng.random((step + 1, step + 1))
        rows, columns = np.linspace(0, step, height), np.linspace(0, step, width)
        cloud += _bilinear(coarse, rows, columns) / step
    cloud = (cloud - cloud.min()) / max(float(np.ptp(cloud)), 1e-12)
    brightest = image.max()
    return np.asarray((image + thickness * cloud[..., None]) * brightest / (brightest + thickness))


def _bilinear(grid: Array, rows: Array, columns: Array) -> Array:
    i, j = (
        np.minimum(at.astype(int), n - 2) for at, n in zip((rows, columns), grid.shape, strict=True)
    )
    v, u = (rows - i)[:, None], columns - j
    top = grid[np.ix_(i, j)] * (1 - u) + grid[np.ix_(i, j + 1)] * u
    bottom = grid[np.ix_(i + 1, j)] * (1 - u) + grid[np.ix_(i + 1, j + 1)] * u
    return np.asarray(top * (1 - v) + bottom * v)


def _brightness(image: Array, more: float, _: Rng) -> Array:
    value = image.max(axis=-1, keepdims=True)
    hue = np.where(value > 0.0, image / np.maximum(value, 1e-12), 1.0)
    return np.asarray(hue * np.minimum(value + more, 1))


def _dark(image: Array, level: tuple[float, float, float], rng: Rng) -> Array:
    brightest, photons, deviation = level
    span = max(float(np.ptp(image)), 1e-12)
    dim = brightest * np.square((image - image.min()) / span)
    return np.asarray(rng.poisson(dim * photons) / photons + rng.normal(0, deviation, image.shape))


def _contrast(image: Array, kept: float, _: Rng) -> Array:
    mean = image.mean(axis=(0, 1))
    return np.asarray((image - mean) * kept + mean)


def _pixelate(image: Array, kept: float, _: Rng) -> Array:
    from PIL import Image

    height, width = image.shape[:2]
    small = max(int(width * kept), 1), max(int(height * kept), 1)
    picture = Image.fromarray(_bytes(image)).resize(small, Image.Resampling.BOX)
    return np.asarray(picture.resize((width, height), Image.Resampling.NEAREST)) / 255.0


def _jpeg(image: Array, quality: int, _: Rng) -> Array:
    return after_jpeg(_bytes(image), quality) / 255.0


def _quantize(image: Array, bits: int, _: Rng) -> Array:
    return (_bytes(image) >> (8 - bits) << (8 - bits)) / 255.0


def _bytes(image: Array) -> NDArray[np.uint8]:
    return np.asarray(np.rint(np.clip(image, 0.0, 1.0) * 255.0), np.uint8)


CORRUPTIONS = {
    "noise": Corruption(_noise, (0.08, 0.12, 0.18, 0.26, 0.38)),
    "shot": Corruption(_shot, (60, 25, 12, 5, 3)),
    "impulse": Corruption(_impulse, (0.03, 0.06, 0.09, 0.17, 0.27)),
    "blur": Corruption(_blur, (3, 4, 6, 8, 10)),
    "motion": Corruption(_motion, (10, 15, 18, 22, 26)),
    "fog": Corruption(_fog, (1.5, 2.0, 2.5, 2.75, 3.0)),
    "brightness": Corruption(_brightness, (0.1, 0.2, 0.3, 0.4, 0.5)),
    "dark": Corruption(
        _dark,
        (
            (0.6, 600, 0.008),
            (0.5, 250, 0.012),
            (0.4, 120, 0.018),
            (0.3, 50, 0.026),
            (0.2, 30, 0.038),
        ),
    ),
    "contrast": Corruption(_contrast, (0.4, 0.3, 0.2, 0.1, 0.05)),
    "pixelate": Corruption(_pixelate, (0.6, 0.5, 0.4, 0.3, 0.25)),
    "jpeg": Corruption(_jpeg, (25, 18, 15, 10, 7)),
    "quantize": Corruption(_quantize, (5, 4, 3, 2, 1)),
}


def corrupted(image: Array, kind: str, severity: int, seed: int, row: int) -> NDArray[np.uint8]:
    """Return an image, (H, W, 3) bytes of sRGB, after a corruption; random by seed and row.

    Raises SpecError for another kind or severity.
    """
    check_choice("kind", kind, CORRUPTIONS)
    if severity not in SEVERITIES:
        raise SpecError("severity", severity, "1 to 5")
    corruption = CORRUPTIONS[kind]
    rng = item_rng(seed, row, Purpose.CORRUPTION)
    return _bytes(corruption.change(image / 255.0, corruption.levels[severity - 1], rng))


def write_corrupted(
    data: str | Path,
    out: str | Path,
    kind: str,
    severity: int,
    *,
    seed: int = 0,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Write a file of rooms or of measured truth with corrupted images, and the same truth.

    Its attribute `corruption` says which. Fingerprint and truth digest stay as they are.

    Raises SpecError as `corrupted`, FileFormatError for shards, images that are not of 8 bits, or
    that were corrupted before, and OSError.
    """
    with open_images(data) as images, written_beside(out, overwrite) as temporary:
        source = images.opened.file
        if is_virtual(source["image"]):
            hint = "merge it with `scenegen merge`"
            raise FileFormatError(data, "a set of shards", "one file", hint)
        if source["image"].dtype != np.uint8:
            raise FileFormatError(data, f"images of {source['image'].dtype}", "images of 8 bits")
        if CORRUPTION in source.attrs:
            raise FileFormatError(data, f"images with {source.attrs[CORRUPTION]}", "clean images")
        shutil.copyfile(images.path, temporary)
        os.chmod(temporary, 0o600 | os.stat(temporary).st_mode)
        with h5py.File(temporary, "r+") as file:
            _corrupt(file, images, kind, severity, seed, progress)


def _corrupt(
    file: h5py.File, images: Images, kind: str, severity: int, seed: int,
    progress: Callable[[int], Any],
) -> None:  # fmt: skip
    stored = file["image"]
    for row in range(len(images)):
        height, width = size_of(images, row)
        image = images.read("image", row)[:height, :width]
        stored[row, :height, :width] = corrupted(image, kind, severity, seed, row)
        progress(1)
    stored.attrs[SHA256] = dataset_digest(stored)
    file.attrs[CORRUPTION] = f"{kind}, severity {severity}, seed {seed}"
    seal(file)

"""Intel's Open Image Denoise, where its wheel `pyoidn` is installed (extra `denoise`)."""

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import BackendError

Array = NDArray[Any]
HOW_TO_GET = 'pip install "pix2shape-bench[denoise]", or use --no-denoise and a larger --spp'


def has_denoiser() -> bool:
    """Return whether pictures can be denoised here."""
    return importlib.util.find_spec("pyoidn") is not None


def check_denoiser() -> None:
    """Raise BackendError where pictures cannot be denoised here."""
    if not has_denoiser():
        raise BackendError("denoise", "no denoiser", hint=HOW_TO_GET)


@contextmanager
def _without_torch() -> Iterator[None]:
    """Hide torch while pyoidn is imported: it would load it, which arrays of numpy do not need."""
    hidden = "torch" not in sys.modules
    if hidden:
        sys.modules["torch"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if hidden:
            del sys.modules["torch"]


def denoised(radiance: Array, albedo: Array, normal: Array) -> Array:
    """Return radiance, (H, W, 3), without the noise of few samples.

    Args:
        albedo, normal: of the surfaces that are seen, (H, W, 3), averaged like the radiance.

    Raises BackendError where the denoiser is not installed.
    """
    check_denoiser()
    with _without_torch():
        import pyoidn

    images = [np.ascontiguousarray(x, np.float32) for x in (radiance, albedo, normal)]
    found: Array = np.asarray(pyoidn.denoise(*images, hdr=True))
    return found

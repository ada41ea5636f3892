"""How the field takes numbers of depth on measured truth: one row of a table for each protocol.

A protocol says which pixels are scored, what the truth decides for a prediction, how that is
clipped after it, and how means are taken. Predictions have the size of the truth in all of them:
`bench import` resamples. `depth_under` computes one image; docs/real-data.md shows the table.
"""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, align, depth_of_disparity
from metrics.measures.depth import DepthPair
from scenegen.common.errors import SceneGenError

Array = NDArray[Any]


class ProtocolError(SceneGenError):
    """A protocol that does not suit a truth, or what a method predicts."""


class Crop(NamedTuple):
    """Rows and columns that are scored, from `top` to `bottom`, from `left` to `right`.

    "pixels" are of images of `size`; "fractions" of height and width are cut to whole pixels.
    "bottom" is a box of `size` at the lower edge and in the middle, of which nothing else is asked.
    """

    unit: Literal["pixels", "fractions", "bottom"]
    size: tuple[int, int] = (0, 0)
    top: float = 0.0
    bottom: float = 1.0
    left: float = 0.0
    right: float = 1.0


@dataclass(frozen=True)
class Protocol:
    """One row of the table.

    Attributes:
        crops: applied one after another, each to what the one before it left.
        least, largest: metres; only true depths between them, not at them, are scored.
        alignment: as in `measures.alignment`; None for the one that a submission declares. A scale
            is never below 0, also where the source fits one without that bound.
        clip: to what predictions are clipped after the alignment, metres; None for nothing.
        mean: over "images", or over the "pixels" of all images together.
        source: where the rules stand.
    """

    name: str
    source: str
    crops: tuple[Crop, ...] = ()
    least: float = 0.0
    largest: float = np.inf
    alignment: Alignment | None = "none"
    clip: tuple[float, float] | None = None
    mean: Literal["images", "pixels"] = "images"


NYU = Crop("pixels", (480, 640), 45, 471, 41, 601)
GARG = Crop("fractions", (0, 0), 0.40810811, 0.99189189, 0.03594771, 0.96405229)
EIGEN = Crop("fractions", (0, 0), 0.3324324, 0.91351351, 0.0359477, 0.96405229)
KB = Crop("bottom", (352, 1216))
TO_10, TO_80 = (1e-3, 10.0), (1e-3, 80.0)
_BTS = "Lee et al. 2019 (BTS)"
_MONODEPTH2 = "Godard et al. 2019 (Monodepth2)"
_MARIGOLD = "Ke et al. 2024 (Marigold)"
_MIDAS = "Ranftl et al. 2020 (MiDaS), section 5"
_DPT = "DPT's sample code for"
_MOGE = "Wang et al. 2025 (MoGe), fitted to all pixels"
DECLARED = Protocol("declared", "all measured pixels, aligned as the submission declares",
                    alignment=None)  # fmt: skip
PROTOCOLS = (
    DECLARED,
    Protocol("nyu-eigen", _BTS, (NYU,), *TO_10, clip=TO_10),
    Protocol("nyu-eigen-pixels", "Eigen et al. 2014, over all pixels of the test set", (NYU,),
             *TO_10, clip=TO_10, mean="pixels"),
    Protocol("kitti-eigen", _BTS, (EIGEN,), *TO_80, clip=TO_80),
    Protocol("kitti-eigen-garg", _BTS, (GARG,), *TO_80, clip=TO_80),
    Protocol("kitti-eigen-garg-median", _MONODEPTH2, (GARG,), *TO_80, "median_scale", TO_80),
    Protocol("kitti-kb", "image size of the KITTI depth benchmark, Uhrig et al. 2017", (KB,),
             *TO_80, clip=TO_80),
    Protocol("affine-depth", f"{_MARIGOLD}, as for ETH3D", (), 1e-5, np.inf, "scale_shift",
             (1e-5, np.inf)),
    Protocol("affine-depth-nyu", _MARIGOLD, (NYU,), *TO_10, "scale_shift", TO_10),
    Protocol("affine-depth-kitti", _MARIGOLD, (KB, EIGEN), 1e-5, 80.0, "scale_shift",
             (1e-5, 80.0)),
    Protocol("affine-disparity", f"{_MIDAS}; depth capped at the largest true one",
             alignment="disparity_scale_shift"),
    Protocol("affine-disparity-10m", f"{_MIDAS}; {_DPT} NYUv2", (), 0.0, 10.0,
             "disparity_scale_shift", (0.0, 10.0)),
    Protocol("affine-disparity-80m", f"{_MIDAS}; {_DPT} KITTI",
             alignment="disparity_scale_shift", clip=(0.0, 80.0)),
    Protocol("moge", _MOGE, alignment="scale_shift_l1"),
    Protocol("moge-scale", _MOGE, alignment="scale_l1"),
)  # fmt: skip
BY_NAME = {protocol.name: protocol for protocol in PROTOCOLS}


def crop_mask(crops: tuple[Crop, ...], height: int, width: int) -> Array:
    """Return which pixels of an image (H, W) crops leave. Raises ProtocolError for other sizes."""
    top, left, tall, wide = 0, 0, height, width
    for crop in crops:
        if crop.unit == "pixels" and (tall, wide) != crop.size:
            expected = f"{crop.size[0]}x{crop.size[1]}, to which its crop belongs"
            raise ProtocolError("images", f"{tall}x{wide} pixels", expected)
        if crop.unit == "bottom":
            if tall < crop.size[0] or wide < crop.size[1]:
                expected = f"at least {crop.size[0]}x{crop.size[1]}"
                raise ProtocolError("images", f"{tall}x{wide} pixels", expected)
            top, left = top + tall - crop.size[0], left + (wide - crop.size[1]) // 2
            tall, wide = crop.size
            continue
        rows, across = (1, 1) if crop.unit == "pixels" else (tall, wide)
        first, last = int(crop.top * rows), int(crop.bottom * rows)
        begin, end = int(crop.left * across), int(crop.right * across)
        top, left, tall, wide = top + first, left + begin, last - first, end - begin
    mask = np.zeros((height, width), np.bool_)
    mask[top : top + tall, left : left + wide] = True
    return mask


def scored_pixels(protocol: Protocol, depth: Array) -> Array:
    """Return the pixels (H, W) of a true depth (H, W) that a protocol scores.

    Raises ProtocolError for images of another size than its crop, or where none is left.
    """
    with np.errstate(invalid="ignore"):
        inside = (depth > protocol.least) & (depth < protocol.largest)
    inside &= crop_mask(protocol.crops, *depth.shape)
    if not inside.any():
        raise ProtocolError(
            "depth", "no scored pixel", "pixels inside the crop and the range of depth"
        )
    return np.asarray(inside)


def depth_under(
    protocol: Protocol, kind: str, declared: Alignment, predicted: Array, true: Array
) -> DepthPair:
    """Return predicted and true depth of the scored pixels, (N,) each, as a protocol takes them.

    Args:
        kind: of the values: "depth", or "disparity" up to scale and shift.
        declared: the alignment of the submission.
    """
    alignment = protocol.alignment or declared
    cap = protocol.clip[1] if protocol.clip and np.isfinite(protocol.clip[1]) else None
    if kind == "disparity":
        fitted = depth_of_disparity(predicted, true, cap)
    else:
        fitted = align(predicted, true, alignment, cap)
    if protocol.clip is not None:
        fitted = np.clip(fitted, *protocol.clip)
    return DepthPair(fitted, true)

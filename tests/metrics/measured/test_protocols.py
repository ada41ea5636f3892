"""Each protocol against plain numpy, written from the definition of its source."""

import numpy as np
import pytest
from page_blocks import ROOT

from metrics.measured.protocols import (
    BY_NAME,
    PROTOCOLS,
    ProtocolError,
    crop_mask,
    depth_under,
    scored_pixels,
)
from metrics.measures.depth import depth_scores
from metrics.views.protocols import csv_table

SIZES = {"nyu": (480, 640), "kitti": (375, 1242)}
SMALL = 1e-9


def data(name, kind):
    """True depth with holes and outliers in range, and a prediction (depth or disparity)."""
    rng = np.random.default_rng(len(name))
    height, width = SIZES["nyu" if "nyu" in name else "kitti"]
    true = rng.uniform(0.5, 12.0 if "nyu" in name else 90.0, (height, width))
    true[rng.random(true.shape) < 0.3] = np.nan
    said = np.nan_to_num(true, nan=3.0) * rng.uniform(0.8, 1.3, true.shape)
    said = 0.4 * said + 1.0 if kind == "depth" and "affine" in name else said
    return true, said if kind == "depth" else 3.0 / said + 0.2


def kept(name, true):
    """The scored pixels, as the code of the sources selects them."""
    height, width = true.shape
    crop = np.zeros(true.shape, bool)
    benchmark = np.s_[height - 352 : height, (width - 1216) // 2 : (width - 1216) // 2 + 1216]

    def shares(top, bottom, left, right, h=height, w=width):
        return np.s_[int(top * h) : int(bottom * h), int(left * w) : int(right * w)]

    eigen = 0.3324324, 0.91351351, 0.0359477, 0.96405229
    if "nyu" in name:
        crop[45:471, 41:601] = True
    elif name.startswith("kitti-eigen-garg"):
        crop[shares(0.40810811, 0.99189189, 0.03594771, 0.96405229)] = True
    elif name == "kitti-eigen":
        crop[shares(*eigen)] = True
    elif name == "kitti-kb":
        crop[benchmark] = True
    elif name == "affine-depth-kitti":
        crop[benchmark][shares(*eigen, 352, 1216)] = True
    else:
        crop[:] = True
    ends = {"nyu": (1e-3, 10.0), "kitti": (1e-3, 80.0), "affine-depth": (1e-5, np.inf)}
    ends |= {"affine-depth-nyu": (1e-3, 10.0), "affine-depth-kitti": (1e-5, 80.0)}
    ends |= {"affine-disparity-10m": (0.0, 10.0)}
    low, high = ends.get(name, ends.get(name.split("-", maxsplit=1)[0], (0.0, np.inf)))
    filled = np.nan_to_num(true)
    return crop & (filled > 0) & (filled > low) & (filled < high)


def aligned(name, p, t):
    """The prediction after the alignment and the clipping of the source."""
    if name == "kitti-eigen-garg-median":
        return np.clip(p * np.median(t) / np.median(p), 1e-3, 80.0)
    if name.startswith("affine-depth"):
        (scale, shift), *_ = np.linalg.lstsq(np.stack([p, np.ones_like(p)], 1), t, rcond=None)
        ends = {"affine-depth-nyu": (1e-3, 10.0), "affine-depth-kitti": (1e-5, 80.0)}
        return np.clip(scale * p + shift, *ends.get(name, (1e-5, np.inf)))
    if name.startswith("affine-disparity"):
        (scale, shift), *_ = np.linalg.lstsq(np.stack([p, np.ones_like(p)], 1), 1 / t, rcond=None)
        cap = {"affine-disparity-10m": 10.0, "affine-disparity-80m": 80.0}.get(name, t.max())
        return 1.0 / np.maximum(scale * p + shift, 1.0 / cap)
    if name.startswith(("nyu", "kitti")):
        return np.clip(p, 1e-3, 10.0 if name.startswith("nyu") else 80.0)
    return p


def numbers(p, t):
    """The measures of Eigen et al. 2014, as their formulas read."""
    ratio, logs = np.maximum(p / t, t / p), np.log(p) - np.log(t)
    return {
        "abs_rel": np.mean(np.abs(p - t) / t),
        "sq_rel": np.mean((p - t) ** 2 / t),
        "rmse": np.sqrt(np.mean((p - t) ** 2)),
        "rmse_log": np.sqrt(np.mean(logs**2)),
        "log10": np.mean(np.abs(np.log10(p) - np.log10(t))),
        "silog": 100.0 * np.sqrt(np.mean(logs**2) - np.mean(logs) ** 2),
        **{f"delta_{k}": np.mean(ratio < 1.25**k) for k in (1, 2, 3)},
    }


@pytest.mark.parametrize("name", [p.name for p in PROTOCOLS if not p.name.startswith("moge")])
def test_a_protocol_is_that_of_its_source(name):
    """To 1e-9, with holes, values out of range and predictions beyond the clip."""
    kind = "disparity" if "disparity" in name else "depth"
    true, said = data(name, kind)
    protocol = BY_NAME[name]
    mask = scored_pixels(protocol, true)
    assert np.array_equal(mask, kept(name, true))
    pair = depth_under(protocol, kind, "scale_shift" if kind == "disparity" else "none",
                       said[mask], true[mask])  # fmt: skip
    found, expected = depth_scores(pair), numbers(aligned(name, said[mask], true[mask]), true[mask])
    assert {key: found[key] for key in expected} == pytest.approx(expected, rel=SMALL, abs=SMALL)


@pytest.mark.parametrize(("name", "shift"), [("moge", True), ("moge-scale", False)])
def test_moge_is_an_optimum_in_l1(name, shift):
    """No line near the fitted one has a smaller mean of |s p + b - t| / t."""
    rng = np.random.default_rng(0)
    t = rng.uniform(1.0, 9.0, 400)
    p = 0.3 * t + 0.5 * shift + 0.05 * rng.standard_normal(400)
    fitted = depth_under(BY_NAME[name], "depth", "none", p, t).predicted
    least = np.mean(np.abs(fitted - t) / t)
    scale, offset = np.polyfit(p, fitted, 1)
    for ds in (-1e-3, 0.0, 1e-3):
        for db in (-1e-3, 0.0, 1e-3) if shift else (0.0,):
            assert np.mean(np.abs((scale + ds) * p + offset + db - t) / t) >= least - 1e-12


def test_a_crop_of_another_size_is_refused():
    """NYU's crop is of 480x640; the benchmark's crop of KITTI needs 352x1216; none may be empty."""
    for name, size in (("nyu-eigen", (479, 640)), ("kitti-kb", (352, 1215))):
        with pytest.raises(ProtocolError):
            crop_mask(BY_NAME[name].crops, *size)
    with pytest.raises(ProtocolError):
        scored_pixels(BY_NAME["nyu-eigen"], np.full((480, 640), 11.0))


def test_the_docs_have_the_table():
    assert (ROOT / "docs" / "data" / "protocols.csv").read_text() == csv_table()

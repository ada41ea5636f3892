"""Files that are shared, as the programs of others read them: none may reach for the network."""

import os

import numpy as np

os.environ |= {"HF_HUB_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1", "HF_HUB_DISABLE_TELEMETRY": "1"}


def loader(cache):
    """Return `datasets.load_dataset` with a cache of its own, for the split "train" by default."""
    import datasets

    datasets.disable_progress_bars()
    return lambda *names, **how: datasets.load_dataset(
        *names, cache_dir=str(cache), **{"split": "train", **how}
    )


def of_archive(row, name):
    """Return the value of a column from a row of a WebDataset archive."""
    for ending in ("png", "npy"):
        if f"{name}.{ending}" in row:
            return row[f"{name}.{ending}"]
    return row["json"][name]


VALUES = {"parquet": dict.__getitem__, "webdataset": of_archive}  # of a row, by format


def check_srgb(codes, radiance):
    """The radiance is within half a step of the 8-bit sRGB codes, decoded as IEC 61966-2-1 says."""
    half = np.stack([codes - 0.5, codes + 0.5]).clip(0, 255) / 255
    low, high = np.where(half <= 0.04045, half / 12.92, ((half + 0.055) / 1.055) ** 2.4)
    assert ((low - 1e-7 <= radiance) & (radiance <= high + 1e-7)).all()

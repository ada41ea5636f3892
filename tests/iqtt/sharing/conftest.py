"""Splits that are shared: whole, in shards, and with floating-point images of two answers."""

from dataclasses import replace

import pytest

from iqtt.files.make import make_split
from tests.support.loaders import loader
from tests.support.made_splits import TINY

SEED = 8_123_456_789_012_345
SPECS = {
    "shards": (replace(TINY, seed=SEED, train=9, labeled=5, test=6, with_depth=True), 4),
    "floats": (replace(TINY, answers=2, image_dtype="float16"), 99),
}


@pytest.fixture(scope="session")
def splits(split_folder, tmp_path_factory):
    """Return folders of splits that no test changes, by "whole", "shards" and "floats"."""
    made = tmp_path_factory.mktemp("splits")
    for name, (spec, size) in SPECS.items():
        make_split(made / name, spec, shard_size=size, command=f"iqtt --seed {spec.seed}")
    return {"whole": split_folder, **{name: made / name for name in SPECS}}


@pytest.fixture
def load(tmp_path):
    """Return `datasets.load_dataset` with a cache of its own, for the split "train"."""
    return loader(tmp_path / "cache")

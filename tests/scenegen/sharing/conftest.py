"""Files of rooms that are shared, and loaders that may not reach for the network."""

import os
from pathlib import Path
from typing import Any

import pytest

os.environ |= {"HF_HUB_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1", "HF_HUB_DISABLE_TELEMETRY": "1"}


@pytest.fixture(scope="session")
def holey_set(make_rooms: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return 14 images in three shards; so wide a view that some pixels show nothing."""
    folder = tmp_path_factory.mktemp("set")
    how = {"shard_size": 3}
    return make_rooms(folder / "set.h5", 7, how, seed=5, views=(0.0, 35.0), fov_degrees=90.0)


@pytest.fixture
def load(tmp_path: Path) -> Any:
    """Return `datasets.load_dataset` with a cache of its own, for the split "train"."""
    import datasets

    datasets.disable_progress_bars()
    return lambda *names, **how: datasets.load_dataset(
        *names, cache_dir=str(tmp_path / "cache"), split="train", **how
    )

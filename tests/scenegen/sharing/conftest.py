"""Files of rooms that are shared, and a loader."""

import pytest

from tests.support.loaders import loader


@pytest.fixture(scope="session")
def holey_set(make_rooms, tmp_path_factory):
    """Return 14 images in three shards; so wide a view that some pixels show nothing."""
    folder = tmp_path_factory.mktemp("set")
    how = {"shard_size": 3}
    return make_rooms(folder / "set.h5", 7, how, seed=5, views=(0.0, 35.0), fov_degrees=90.0)


@pytest.fixture
def load(tmp_path):
    """Return `datasets.load_dataset` with a cache of its own, for the split "train"."""
    return loader(tmp_path / "cache")

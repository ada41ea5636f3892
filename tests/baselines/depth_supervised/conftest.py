"""One thread a test process; rooms seen from neighbouring views."""

from collections.abc import Callable
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)


@pytest.fixture(scope="session")
def turned_path(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of 3 rooms seen from 0, 10 and 80 degrees, 32x32."""
    path = tmp_path_factory.mktemp("turned") / "turned.h5"
    return make_rooms(path, 3, views=(0.0, 10.0, 80.0), min_visible_pixels=2)

"""A tiny model, and files to predict."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pix2shape_models import made, tiny


@pytest.fixture(scope="session")
def model() -> Any:
    """Return a tiny model of rooms, which no test changes."""
    return made(tiny())


@pytest.fixture(scope="session")
def several_path(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of 3 rooms seen from 0, 35 and 80 degrees, 64x64."""
    size = {"height": 64, "width": 64, "min_visible_pixels": 6, "object_radius": (0.08, 0.16)}
    path = tmp_path_factory.mktemp("several") / "several.h5"
    return make_rooms(path, 3, **size, views=(0.0, 35.0, 80.0), lights=(1, 3))


@pytest.fixture(scope="session")
def single_path(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of 4 rooms with one object of two classes."""
    path = tmp_path_factory.mktemp("single") / "single.h5"
    return make_rooms(path, 4, objects=(1, 1), shapes=("box", "sphere"))

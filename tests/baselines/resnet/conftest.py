"""Labelled questions of 32x32 pixels, and weights that a few steps made of them."""

from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)
SMALL = {"width": 4, "size": 16, "batch": 2, "device": "cpu"}


@pytest.fixture(scope="session")
def questions(truths: Any) -> Path:
    """Return a file of 3 labelled questions and 3 others."""
    return Path(truths.iqtt).with_name("iqtt-train.h5")


@pytest.fixture(scope="session")
def small() -> dict[str, Any]:
    """Return settings that train within a second."""
    return SMALL


@pytest.fixture(scope="session")
def run_folders(questions: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the folder of a short run of each method, which no test changes."""
    from baselines import cnn, siamese

    folder = tmp_path_factory.mktemp("runs")
    for package in (cnn, siamese):
        name = package.__name__.rpartition(".")[2]
        package.train(questions, folder / name, seed=1, iterations=3, **SMALL)
    return {name: folder / name for name in ("cnn", "siamese")}

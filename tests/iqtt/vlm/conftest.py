"""Questions of a split for models, drawn small."""

from pathlib import Path

import pytest

from iqtt.vlm.rows import Asked


@pytest.fixture(scope="session")
def asked(split_folder: Path) -> Asked:
    """Return how the six questions of validation are asked in every order, at 64 pixels."""
    return Asked(split_folder / "iqtt-val.h5", rotations=3, size=64)

"""The weights that come with the package: they load, are small, and answer questions."""

import h5py
import numpy as np
import pytest

torch = pytest.importorskip("torch")
from baselines import cnn, siamese  # noqa: E402
from baselines.checkpoints import load_weights  # noqa: E402

PACKAGES = {"cnn": cnn, "siamese": siamese}


@pytest.mark.parametrize("name", PACKAGES)
def test_bundled_weights(name, tmp_path):
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec

    method = PACKAGES[name].network.METHOD
    paths = list(method.files.glob("*.safetensors"))
    if not paths:
        pytest.skip("no weights are bundled")
    (path,) = paths
    assert path.stat().st_size < 15_000_000
    card = load_weights(path, method.recipe).card
    assert (card.labels, card.answers, card.seed) == (1000, 3, 0)
    assert card.iteration == card.iterations
    spec = SplitSpec(train=0, labeled=0, val=0, test=2, height=64, width=64, min_cube_pixels=0)
    make_split(tmp_path / "split", spec)
    PACKAGES[name].write_submission(tmp_path / "split/iqtt-test.h5", tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert len(np.unique(file["scores"][:])) == 6

"""Outlines: the same outline turned is nearest, trees learn, and what is unfair is refused."""

import h5py
import numpy as np
from refusals import refused

from baselines.outline import write_outline
from scenegen.common.errors import SpecError


def boxes(count=80, seed=0):
    """Questions of rectangles, the right one turned by 90 degrees, and where it is."""
    rng = np.random.default_rng(seed)
    masks, right = np.zeros((count, 4, 48, 48), bool), rng.integers(0, 3, count)
    for row in range(count):
        sides = rng.permutation(np.arange(4, 40, 6))[:4] + rng.integers(0, 3, 4)
        for k in range(3):
            masks[row, 1 + k, 4 : 4 + sides[k], 6:17] = True
        masks[row, 0] = np.rot90(masks[row, 1 + right[row]])
    return masks, right


def write(path, masks, right):
    with h5py.File(path, "w") as file:
        file["questions"] = np.where(masks[..., None], 40, 255).astype(np.uint8).repeat(3, axis=-1)
        if right is not None:
            file["answers"] = right
    return path


def test_submissions_and_what_is_refused(tmp_path):
    masks, right = boxes(30)
    data = write(tmp_path / "test.h5", masks, None)
    train = write(tmp_path / "train.h5", *boxes(30, 2))
    write_outline(data, tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        assert (file["scores"][:].argmax(axis=1) == right).mean() > 0.9
    write_outline(data, tmp_path / "trees.h5", train, 20)
    for training, labels, where in ((data, None, "train"), (train, 31, "labels")):
        with refused(SpecError, where):
            write_outline(data, tmp_path / "x.h5", training, labels)
        assert not (tmp_path / "x.h5").exists()

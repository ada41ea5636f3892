"""The preset v2: a split in the form of the files that the authors released."""

from pathlib import Path

import h5py
import numpy as np

from iqtt.files.make import make_split
from iqtt.questions.specs import preset_spec


def as_released(path: Path) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Load images and answers as whoever has the released files does: with plain h5py, by the
    names and types that their description tells.
    """
    tables = []
    with h5py.File(path) as file:
        for group in (file["labeled"], file["unlabeled"]) if "labeled" in file else (file,):
            images = group["questions"][()]
            assert (images.dtype, images.ndim) == (np.float32, 5)
            assert images.shape[1:] == (4, 32, 32, 3)
            assert 0 <= images.min() < 0.5 < images.max() <= 1
            answers = group["answers"][()] if "answers" in group else None
            assert answers is None or (answers.dtype, answers.shape) == (np.uint8, images.shape[:1])
            tables.append((images, answers))
    return tables


def test_the_preset_v2_takes_the_place_of_the_released_files(tmp_path):
    spec = preset_spec("v2", train=9, labeled=6, val=6, test=3, height=32, width=32)
    make_split(tmp_path / "v2", spec)
    labeled, unlabeled = as_released(tmp_path / "v2" / "iqtt-train.h5")
    [val], [test] = (as_released(tmp_path / "v2" / f"iqtt-{name}.h5") for name in ("val", "test"))
    assert [len(images) for images, _ in (labeled, unlabeled, val, test)] == [6, 3, 6, 3]
    assert unlabeled[1] is test[1] is None
    assert sorted(labeled[1]) == sorted(val[1]) == [0, 0, 1, 1, 2, 2]
    for images, _ in (labeled, unlabeled, val, test):
        assert (images[:, :, 0, 0] == 1).all(), "the background is white"
        assert len(np.unique(images)) > 256, "more than bytes"

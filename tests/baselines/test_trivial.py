"""Baselines: right where they can be, and learned from the training file alone."""

import h5py
import numpy as np
import pytest
from refusals import refused

from baselines.trivial import write_chance, write_room_baseline
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from metrics.scoring.evaluate import score
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile


def test_means_come_from_the_training_file_and_baselines_rank(make_rooms, rooms_path, tmp_path):
    train = make_rooms(tmp_path / "train.h5", 20, seed=77)
    chamfer = {}
    for name in ("oracle", "empty-room", "mean-depth", "constant"):
        learned = train if name in ("mean-depth", "constant") else None
        write_room_baseline(name, rooms_path, tmp_path / f"{name}.h5", train=learned)
        chamfer[name] = score([tmp_path / f"{name}.h5"]).metrics["chamfer"].value
    assert chamfer["oracle"] == 0
    assert chamfer["oracle"] < chamfer["empty-room"] < chamfer["mean-depth"] < chamfer["constant"]
    with h5py.File(train) as file:
        depths = file["depth"][:]
    with h5py.File(tmp_path / "constant.h5") as file:
        assert np.unique(file["depth"][:]) == pytest.approx(np.nanmean(depths), rel=1e-6)
        assert "normal" not in file
    with h5py.File(tmp_path / "mean-depth.h5") as file:
        assert file["depth"][3] == pytest.approx(np.nanmean(depths, axis=0), rel=1e-6)


@pytest.mark.parametrize(
    ("name", "train", "field"),
    [
        ("best", None, "baseline"),
        ("constant", None, "train"),
        ("oracle", {"seed": 5}, "train"),
        ("constant", {"seed": 3, "random_reflectance": True}, "train"),  # the same cameras, places
        ("mean-depth", {"seed": 5, "height": 40, "width": 40}, "train"),
        ("nearest", None, "train"),
        ("cut-out", {"seed": 5}, "train"),
        ("outline-relief", {"seed": 3}, "train"),
        ("nearest", {"seed": 5, "height": 40, "width": 40}, "train"),
    ],
)
def test_what_would_be_unfair_is_refused(make_rooms, rooms_path, tmp_path, name, train, field):
    path = make_rooms(tmp_path / "train.h5", 2, **train) if train else None
    with RoomsFile(rooms_path) as rooms:
        assert rooms.spec.seed == 3
    with refused(SpecError, field):
        write_room_baseline(name, rooms_path, tmp_path / "x.h5", train=path)
    assert not (tmp_path / "x.h5").exists()


def test_chance_is_a_third_and_the_seed_decides(tmp_path):
    size = {"cubes": (6, 6), "height": 16, "width": 16, "min_cube_pixels": 0}
    spec = SplitSpec(seed=1, train=0, labeled=0, val=0, test=45, **size)
    make_split(tmp_path / "split", spec)
    answers = []
    for seed in (0, 0, 1):
        path = tmp_path / "chance.h5"
        write_chance(tmp_path / "split/iqtt-test.h5", path, seed, overwrite=True)
        with h5py.File(path) as file:
            answers.append(file["answer"][:])
    assert (answers[0] == answers[1]).all()
    assert (answers[0] != answers[2]).any()
    found = score([path]).metrics["iqtt_accuracy"]
    assert found.low < 1 / 3 < found.high

"""Corrupted images: the truth stays, severities grow, the same command gives the same bytes."""

import h5py
import numpy as np
import pytest
from pix2shape_commands import invoke
from refusals import refused

import cli
from metrics.corruptions import CORRUPTIONS, SEVERITIES, corrupted, write_corrupted
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.verify import verify_file


@pytest.fixture(scope="module")
def rooms(make_rooms, tmp_path_factory):
    return make_rooms(tmp_path_factory.mktemp("clean") / "rooms.h5", 2, height=64, width=72)


@pytest.mark.parametrize("kind", CORRUPTIONS)
def test_each_severity_is_farther_from_the_image(kind, rooms):
    with RoomsFile(rooms) as file:
        image = file.read("image", 0)
    found = [corrupted(image, kind, severity, 0, 0) for severity in SEVERITIES]
    apart = [float(np.square(one.astype(float) - image).mean()) for one in found]
    assert apart == sorted(apart)
    assert apart[0] > 0.0
    assert {one.shape for one in found} == {image.shape}
    again = corrupted(image, kind, 3, 0, 0)
    assert np.array_equal(again, found[2])
    random = not np.array_equal(corrupted(image, kind, 3, 0, 1), again)
    assert random == (kind in ("noise", "shot", "impulse", "motion", "fog", "dark"))


def test_the_truth_is_the_same_and_the_file_verifies(rooms, tmp_path):
    out = tmp_path / "jpeg.h5"
    invoke(cli.bench, "corrupt", rooms, "--kind", "jpeg", "--severity", "2", "--out", out)
    with RoomsFile(rooms) as clean, RoomsFile(out) as file:
        assert file.stored_truth_digest == clean.stored_truth_digest
        assert file.fingerprint == clean.fingerprint
        assert np.array_equal(file.read("depth", 1), clean.read("depth", 1), equal_nan=True)
        assert not np.array_equal(file.read("image", 1), clean.read("image", 1))
        assert all(check.ok for check in verify_file(file, 1))
    with refused(FileFormatError):
        write_corrupted(out, tmp_path / "twice.h5", "fog", 1)
    for kind, severity in (("rain", 1), ("fog", 6)):
        with refused(SpecError):
            write_corrupted(rooms, tmp_path / "none.h5", kind, severity)
    assert [path.name for path in tmp_path.iterdir()] == ["jpeg.h5"]
    with h5py.File(out) as file:
        assert file.attrs["corruption"].startswith("jpeg")

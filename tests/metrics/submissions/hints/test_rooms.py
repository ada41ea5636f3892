"""Hints on whole submissions of rooms: what must not spoil them."""

import h5py
import numpy as np
import pytest


def test_rooms_of_another_file_get_no_hint(hints, make_rooms, tmp_path):
    """Rooms, and good ones, but others: among many there is always one that is like them."""
    truth, path = (make_rooms(tmp_path / f"{seed}.h5", 300, seed=seed) for seed in (98, 99))
    with h5py.File(path) as file:
        assert hints(file["depth"][()], file["normal"][()], truth=truth) == []


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300])
@pytest.mark.parametrize("share", [0.01, 1.0])
def test_odd_values_are_passed_over(hints, room_arrays, odd, share):
    depth, normal, _, _ = room_arrays
    spoiled = np.random.default_rng(4).random(depth.shape) < share
    bent = np.where(spoiled, odd, depth[:, ::-1])
    normals = np.where(spoiled[..., None], odd, -normal)
    told = hints(bent, normals)
    assert len(told) <= 3
    if share == 0.01:
        assert any("upside down" in line for line in told)
        assert any("facing away" in line for line in told)


def test_a_truth_with_holes(hints, hint_truth, room_arrays, tmp_path):
    depth, normal, _, stretch = room_arrays
    path = tmp_path / "holes.h5"
    path.write_bytes(hint_truth.read_bytes())
    with h5py.File(path, "r+") as file:
        file["depth"][:, 10:30, 20:40] = np.nan
        file["normal"][:, 10:30, 20:40] = 0.0
    assert hints(depth, normal, truth=path) == []
    told = hints(depth * stretch, -normal, truth=path)
    assert ["along the ray" in told[0], "away" in told[1]] == [True, True]

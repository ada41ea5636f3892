"""Hints on whole submissions of rooms: shuffled rows, and what must not spoil the others."""

import h5py
import numpy as np
import pytest
from hint_noise import smooth

from metrics.submissions.hints.samples import mirrored_grid


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


COUNT = 16  # rooms that `hints` knows
AT_RANDOM = np.random.default_rng(3).permutation(COUNT)


@pytest.mark.parametrize("order", [np.roll(np.arange(COUNT), 1), AT_RANDOM], ids=["late", "random"])
@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_shuffled_rows(hints, room_arrays, order, scale):
    depth = scale * (room_arrays[0] + smooth(9, room_arrays[0].shape, 8, 0.03))
    (line,) = hints(depth[order], alignment="none" if scale == 1.0 else "scale")
    assert line.startswith("row: ")
    assert hints(depth[order], rows=order, alignment="scale") == [], "rightly named"


def test_a_few_rows_swapped_are_no_pattern_and_a_part_of_them_is(hints, room_arrays):
    order = np.r_[1, 0, 3, 2, 4:COUNT]
    assert hints(room_arrays[0][order]) == []
    rows = np.arange(2, 15)
    (line,) = hints(room_arrays[0][rows], rows=rows[::-1])
    assert line.startswith("row: ")


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 127, 128, 129, 1000, 4096])
def test_the_grid_is_its_own_mirror_image(count):
    grid = mirrored_grid(count, 32)
    assert np.array_equal(np.sort(count - 1 - grid), grid)
    assert min(count, 32) <= len(grid) <= 64
    assert (grid[0], grid[-1]) == (0, count - 1)

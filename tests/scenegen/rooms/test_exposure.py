"""How much of 8-bit images is saturated or black is told, and warned of."""

import h5py
import pytest

from scenegen import open_rooms
from scenegen.rooms.exposure import MANY, clipped_shares, exposure_warnings
from scenegen.rooms.info import describe


@pytest.mark.parametrize(
    ("level", "ambient", "warned"), [(0.95, 0.1, 0), (8.0, 0.1, 1), (1e-3, 0.0, 1)]
)
def test_shares_are_those_of_the_stored_values(level, ambient, warned, make_rooms, tmp_path):
    light = {"light_level": level, "ambient": (ambient,) * 3, "fov_degrees": 60.0}
    path = make_rooms(tmp_path / "x.h5", 4, **light)
    with h5py.File(path) as file:
        shown = file["image"][()][file["object_id"][()] >= 0]
    with open_rooms(path) as rooms:
        shares = clipped_shares(rooms, range(4))
    assert shares == ((shown == 255).mean(), (shown == 0).mean())
    assert len(exposure_warnings(shares)) == warned == (max(shares) >= MANY)
    assert describe(path).count("warning: ") == warned

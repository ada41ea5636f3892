"""Silhouettes from the image alone: the truth's, where the paper's shading holds."""

import numpy as np
import pytest
from refusals import refused

from baselines.ptn.rooms import RoomImages, Silhouettes
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile


@pytest.mark.parametrize("dtype", ["uint8", "float16", "float32"])
def test_what_differs_from_the_empty_room_is_an_object(make_rooms, tmp_path, dtype):
    path = make_rooms(tmp_path / "rooms.h5", 6, image_dtype=dtype, random_reflectance=True)
    with RoomsFile(path) as rooms:
        pixels = np.arange(32 * 32)
        for row in range(len(rooms)):
            rays = RoomImages(rooms, 32).rays(row)
            found, ids = (Silhouettes(rooms, s).at(row, pixels, *rays) for s in ("image", "ids"))
            assert (ids == (rooms[row].object_id > 0).flatten()).all()
            assert not (found & ~ids).any()
            assert (ids & ~found).sum() <= 0.02 * ids.sum()


@pytest.mark.parametrize("settings", [{"shadows": True}, {"spp": 4}], ids=["shadows", "spp"])
def test_images_in_which_walls_change_are_refused(make_rooms, tmp_path, settings):
    with RoomsFile(make_rooms(tmp_path / "rooms.h5", 1, **settings)) as rooms:
        with refused(SpecError, hint="ids"):
            Silhouettes(rooms)
        Silhouettes(rooms, "ids")

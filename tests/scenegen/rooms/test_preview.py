"""Contact sheets: measured, since nobody looks at them in a test."""

import numpy as np
import pytest
from PIL import Image

from scenegen import open_rooms
from scenegen.rooms.preview import (
    contact_sheet,
    cut_places,
    cuts,
    depth_bytes,
    id_colors,
    srgb_bytes,
)


@pytest.fixture(scope="module")
def rooms(rooms_path):
    with open_rooms(rooms_path) as file:
        return list(file)


def test_near_is_dark():
    depth = np.array([[1.0, 1.5, 2.0], [1.25, np.nan, 1.0]], np.float32)
    shown = depth_bytes(depth)
    assert shown.shape == (2, 3, 3)
    assert shown[..., 0][np.isfinite(depth)].tolist() == [0, 128, 255, 64, 0]
    assert (shown[..., :1] == shown).all()
    assert depth_bytes(np.full((2, 2), np.nan)).shape == (2, 2, 3)
    assert np.ptp(depth_bytes(np.full((2, 2), 1.5))) == 0


def test_srgb_is_the_standard_curve():
    encoded = np.arange(256) / 255  # decoded here by the standard's other formula
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert srgb_bytes(linear).tolist() == list(range(256))
    assert srgb_bytes(np.array([-1.0, 7.0])).tolist() == [0, 255]


def test_the_command(run, rooms_path, rooms):
    result = run("preview", rooms_path, "--items", "6,1", "--out", "a.png")
    assert result.exit_code == 0
    assert "a.png: 2 images of" in result.output
    with Image.open("a.png") as sheet:
        assert np.array_equal(np.asarray(sheet), np.asarray(contact_sheet([rooms[6], rooms[1]])))
    for name in ("b", "c"):
        assert run("preview", rooms_path, "--random", "3", "--out", f"{name}.png").exit_code == 0
    assert run("preview", rooms_path, "--random", "3", "--seed", "1").exit_code == 0
    first, second, other = (Image.open(name) for name in ("b.png", "c.png", "sheet.png"))
    with first, second, other:
        assert np.array_equal(np.asarray(first), np.asarray(second))
        assert not np.array_equal(np.asarray(first), np.asarray(other))


def test_cuts_show_what_is_inside_of_objects():
    """An object from depth 2 to 3 in the left of two columns, a room at 4, and a sheet at 3.5."""
    depth = np.full((2, 2, 4), np.nan)
    depth[0, 0], depth[0, 1, 0], depth[1, :, 0] = (2, 3, 3.5, 4), 4, 4
    ids, kinds = np.full((2, 2, 4), -1), np.zeros((2, 2, 4), int)
    ids[0, 0], ids[0, 1, 0], ids[1, :, 0], kinds[0, 0, :2] = (1, 1, 2, 0), 0, 0, (1, -1)
    assert cut_places(kinds) == (0, 0)
    wide = [np.repeat(np.repeat(x, 50, axis=0), 50, axis=1) for x in (depth, ids, kinds)]
    above, aside = cuts(wide, 10, 10, (2.0, 4.0))
    assert above.shape == aside.shape == (100, 100, 3)
    levels = np.linspace(1.9, 4.1, 100)[::-1]
    names = {tuple(id_colors(np.array([k]))[0]): k for k in range(3)} | {(255, 255, 255): -1}
    at = [names[tuple(color)] for color in above[:, 10].tolist()]
    for level, name in zip(levels, at, strict=True):
        sheet = 3.5 <= level < 3.5 + 2.2 / 99
        assert name == (1 if 2 <= level < 3 else 0 if level >= 4 else 2 if sheet else -1)
    np.testing.assert_array_equal(aside[10], above[::-1, 10])

"""Contact sheets: measured, since nobody looks at them in a test."""

import dataclasses

import numpy as np
import pytest
from PIL import Image
from sheets import enlarged, find

from scenegen import open_rooms
from scenegen.rooms.preview import contact_sheet, depth_bytes, srgb_bytes, tiles

BACKGROUND = 250
TILE = 128  # images of 32 pixels are shown four times as large


@pytest.fixture(scope="module")
def rooms(rooms_path):
    with open_rooms(rooms_path) as file:
        return list(file)


def places_of(sheet, rooms):
    """Return (row, column) of the top left corner of each tile of some rooms."""
    return [find(sheet, enlarged(picture, 4)) for room in rooms for picture in tiles(room)]


def test_the_sheet_shows_every_picture_once_with_labels(rooms):
    sheet = np.asarray(contact_sheet(rooms[:3]))
    assert sheet.dtype == np.uint8
    assert sheet.shape[1] >= 2 * 4 * TILE, "two rooms side by side"
    assert sheet.shape[0] >= 2 * TILE, "the third below them"
    places = places_of(sheet, rooms[:3])
    assert [y for y, _ in places[:8]] == [places[0][0]] * 8
    assert sorted(places) == places, "image, depth, normal, ids of each room, in reading order"
    for y, x in places[:8]:
        title = sheet[y - 16 : y, x : x + 60]
        assert (title.min(axis=-1) < 100).sum() > 30, "a title in dark ink above each column"
    for y, x in places[::4]:
        caption = sheet[y + TILE : y + TILE + 18, x : x + 200]
        assert (caption.min(axis=-1) < 150).sum() > 100, "a caption below each room"
    bare = sheet.copy()
    for y, x in places:
        bare[y - 18 : y + TILE + 18, x : x + TILE + 300] = BACKGROUND
    assert (bare == BACKGROUND).all(), "nothing is drawn elsewhere"


def test_near_is_dark():
    depth = np.array([[1.0, 1.5, 2.0], [1.25, np.nan, 1.0]], np.float32)
    shown = depth_bytes(depth)
    assert shown.shape == (2, 3, 3)
    assert shown[..., 0][np.isfinite(depth)].tolist() == [0, 128, 255, 64, 0]
    assert (shown[..., :1] == shown).all()
    assert depth_bytes(np.full((2, 2), np.nan)).shape == (2, 2, 3)
    assert np.ptp(depth_bytes(np.full((2, 2), 1.5))) == 0


def test_pictures_of_a_real_room(rooms):
    room = max(rooms, key=lambda r: len(r.scene.objects))
    image, depth, normal, ids = tiles(room)
    assert all(p.shape == (32, 32, 3) and p.dtype == np.uint8 for p in (image, depth, normal, ids))
    order = np.argsort(room.depth, axis=None)
    assert (np.diff(depth[..., 0].ravel()[order].astype(int)) >= 0).all()
    expected = np.rint((room.normal.astype(float) + 1) / 2 * 255)
    assert np.abs(normal - expected).max() <= 1
    colours = {tuple(ids[room.object_id == k].reshape(-1, 3)[0]) for k in np.unique(room.object_id)}
    assert len(colours) == len(np.unique(room.object_id)) >= 3
    for k in np.unique(room.object_id):
        assert np.ptp(ids[room.object_id == k], axis=0).max() == 0, "one colour for one object"
    assert image.mean() > room.image.mean(), "encoded for the eye: brighter than linear bytes"


def test_where_nothing_is_hit_no_picture_pretends(rooms):
    room = rooms[0]
    gone = np.zeros((32, 32), bool)
    gone[:9, :9] = True
    room = dataclasses.replace(
        room,
        depth=np.where(gone, np.nan, room.depth),
        normal=np.where(gone[..., None], 0, room.normal),
        object_id=np.where(gone, -1, room.object_id).astype(np.int8),
    )
    for picture in tiles(room):
        nothing = {tuple(c) for c in picture[gone].reshape(-1, 3)}
        assert len(nothing) == 1
        assert nothing.isdisjoint({tuple(c) for c in picture[~gone].reshape(-1, 3)})


def test_srgb_is_the_standard_curve():
    encoded = np.arange(256) / 255  # decoded here by the standard's other formula
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert srgb_bytes(linear).tolist() == list(range(256))
    assert srgb_bytes(np.array([-1.0, 7.0])).tolist() == [0, 255]


def test_the_command(run, rooms_path, rooms):
    result = run("preview", rooms_path, "--items", "6,1", "--out", "a.png")
    assert result.exit_code == 0
    assert "a.png: 2 of" in result.output
    with Image.open("a.png") as sheet:
        assert np.array_equal(np.asarray(sheet), np.asarray(contact_sheet([rooms[6], rooms[1]])))
    for name in ("b", "c"):
        assert run("preview", rooms_path, "--random", "3", "--out", f"{name}.png").exit_code == 0
    assert run("preview", rooms_path, "--random", "3", "--seed", "1").exit_code == 0
    first, second, other = (Image.open(name) for name in ("b.png", "c.png", "sheet.png"))
    with first, second, other:
        assert np.array_equal(np.asarray(first), np.asarray(second))
        assert not np.array_equal(np.asarray(first), np.asarray(other))

"""Contact sheets: measured, since nobody looks at them in a test."""

import dataclasses

import numpy as np
import pytest
from PIL import Image

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.files.pictures import pick_rows, save_picture
from scenegen.rooms.preview import contact_sheet, depth_bytes, srgb_bytes, tiles

BACKGROUND = 250
TILE = 128  # images of 32 pixels are shown four times as large


@pytest.fixture(scope="module")
def rooms(rooms_path):
    with open_rooms(rooms_path) as file:
        return list(file)


def find_tiles(sheet, rooms):
    """Return (row, column) of the top left corner of each tile of the first line of rooms."""
    found = []
    for room in rooms:
        for picture in tiles(room):
            large = picture.repeat(4, axis=0).repeat(4, axis=1)
            places = [
                (y, x)
                for y in range(sheet.shape[0] - TILE + 1)
                for x in np.flatnonzero((sheet[y, : -TILE + 1] == large[0, 0]).all(axis=-1))
                if np.array_equal(sheet[y : y + TILE, x : x + TILE], large)
            ]
            assert len(places) == 1, "each picture is there once, whole and unchanged"
            found.append(places[0])
    return found


def test_the_sheet_shows_every_picture_once_with_labels(rooms):
    sheet = np.asarray(contact_sheet(rooms[:3]))
    assert sheet.dtype == np.uint8
    assert sheet.shape[1] >= 2 * 4 * TILE, "two rooms side by side"
    assert sheet.shape[0] >= 2 * TILE, "the third below them"
    places = find_tiles(sheet, rooms[:3])
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


def test_captions_tell_rooms_apart(rooms):
    """Number and shapes are in the caption: it changes with either, pixels being equal."""
    base = np.asarray(contact_sheet(rooms[:1]))
    renumbered = np.asarray(contact_sheet([dataclasses.replace(rooms[0], index=7)]))
    emptied = dataclasses.replace(rooms[0].scene, objects=())
    reshaped = np.asarray(contact_sheet([dataclasses.replace(rooms[0], scene=emptied)]))
    assert base.shape == renumbered.shape == reshaped.shape
    assert not np.array_equal(base, renumbered)
    assert not np.array_equal(base, reshaped)


def test_a_long_caption_stays_in_its_place(rooms):
    many = dataclasses.replace(rooms[0].scene, objects=rooms[0].scene.objects[:1] * 90)
    sheet = np.asarray(contact_sheet([dataclasses.replace(rooms[0], scene=many), rooms[1]]))
    (y, x), *_ = find_tiles(sheet, [rooms[1]])
    assert (sheet[y + TILE : y + TILE + 18, x - 8 : x] == BACKGROUND).all()


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


def test_choice_of_rows():
    assert pick_rows(5, None) == [0, 1, 2, 3, 4]
    assert pick_rows(50, None) == list(range(12))
    assert pick_rows(50, [7, 3, 7]) == [7, 3, 7]
    some = pick_rows(1000, None, 12, seed=1)
    assert some == pick_rows(1000, None, 12, seed=1)
    assert some != pick_rows(1000, None, 12, seed=2)
    assert len(set(some)) == 12
    assert max(some) < 1000
    assert pick_rows(5, None, 400) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("items", "number"), [([5], None), ([0], 2), ([], None), ([0] * 401, None)]
)
def test_impossible_choices_of_rows(items, number):
    with pytest.raises(SpecError):
        pick_rows(5, items, number)


@pytest.mark.parametrize("name", ["s.png", "s.jpg", "S.PNG", "s.webp", "s.tiff"])
def test_saving(tmp_path, name):
    picture = Image.new("RGB", (20, 10), (200, 30, 30))
    save_picture(picture, tmp_path / name)
    with pytest.raises(FileExistsError):
        save_picture(Image.new("RGB", (1, 1)), tmp_path / name)
    save_picture(picture, tmp_path / name, overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    with Image.open(tmp_path / name) as again:
        assert again.size == (20, 10)
        assert np.abs(np.asarray(again)[5, 5].astype(int) - (200, 30, 30)).max() < 8


def test_a_sheet_that_a_format_cannot_hold(tmp_path):
    tall = Image.new("RGB", (8, 16_384))
    with pytest.raises(SpecError) as error:
        save_picture(tall, tmp_path / "s.webp")
    assert (error.value.where, "16384" in error.value.found) == ("out", True)
    save_picture(tall, tmp_path / "s.png")
    assert [p.name for p in tmp_path.iterdir()] == ["s.png"]


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

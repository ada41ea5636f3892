"""Tiles of pictures in a sheet, found by their pixels."""

import numpy as np


def enlarged(picture, factor):
    """Return a picture so many times as large, each pixel as a square."""
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def find(sheet, tile):
    """Return (row, column) of the one place where a tile lies whole and unchanged."""
    height, width = tile.shape[:2]
    y, x = np.unravel_index(tile.sum(axis=-1).argmin(), (height, width))  # no background there
    places = np.argwhere((sheet == tile[y, x]).all(axis=-1)) - (y, x)
    limits = np.array(sheet.shape[:2]) - (height, width)
    places = places[(places >= 0).all(axis=1) & (places <= limits).all(axis=1)]
    for y, x in np.random.default_rng(0).integers(0, (height, width), (300, 2)):
        places = places[(sheet[places[:, 0] + y, places[:, 1] + x] == tile[y, x]).all(axis=-1)]
    assert len(places) == 1, "each picture is there once, whole and unchanged"
    top, left = places[0].tolist()
    assert np.array_equal(sheet[top : top + height, left : left + width], tile)
    return top, left

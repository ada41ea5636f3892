"""Pictures as escapes, drawn by terminals of the tests' own."""

import io
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image
from terminals import kitty_picture, sixel_pixels

from scenegen.common.terminal.pictures import escapes, kitty, quantized, sixel

SHAPES = st.tuples(st.integers(1, 20), st.integers(1, 20))
ROUNDING = 2  # sixels tell colours in per cent


@given(SHAPES.flatmap(lambda shape: arrays.arrays(np.uint8, (*shape, 3))))
def test_kitty_draws_any_picture(pixels):
    text = kitty(Image.fromarray(pixels))
    assert np.array_equal(np.asarray(kitty_picture(text)), pixels)
    assert text.isascii()


@given(SHAPES.flatmap(lambda shape: arrays.arrays(np.uint8, shape, elements=st.integers(0, 3))))
def test_sixels_draw_pictures_of_few_colours(indices):
    palette = np.array([(0, 0, 0), (255, 255, 255), (230, 159, 0), (0, 114, 178)], np.uint8)
    drawn = sixel_pixels(sixel(Image.fromarray(palette[indices]))).astype(int)
    assert abs(drawn - palette[indices]).max() <= ROUNDING


@given(SHAPES.flatmap(lambda shape: arrays.arrays(np.uint8, (*shape, 3))))
def test_sixels_draw_every_pixel(pixels):
    picture = Image.fromarray(pixels)
    drawn = sixel_pixels(sixel(picture)).astype(int)
    nearest = np.asarray(quantized(picture).convert("RGB")).astype(int)
    assert abs(drawn - nearest).max() <= ROUNDING


def photo(width, height):
    """A picture of many colours that change slowly."""
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    return Image.fromarray(np.rint(255 * np.stack([x, y, (x + y) / 2], -1)).astype(np.uint8))


def test_a_picture_of_many_colours_is_near_to_itself_and_soon_drawn():
    picture, start = photo(1000, 700), time.monotonic()
    drawn = sixel_pixels(sixel(picture)).astype(int)
    assert time.monotonic() - start < 10
    assert abs(drawn - np.asarray(picture)).max() < 40


def test_kitty_takes_a_png_in_chunks():
    noise = np.random.default_rng(0).integers(0, 256, (60, 60, 3), np.uint8)
    file = io.BytesIO()
    Image.fromarray(noise).save(file, "PNG")
    text = kitty(Image.fromarray(noise))
    assert text.count("\x1b_G") == -(-len(file.getvalue()) * 4 // 3 // 4096) > 2
    assert np.array_equal(np.asarray(kitty_picture(text)), noise)


@pytest.mark.parametrize(("width", "shown"), [(400, (300, 200)), (300, (300, 200)), (90, (90, 60))])
def test_a_picture_fits_the_terminal(width, shown):
    picture = photo(300, 200)
    assert kitty_picture(escapes(picture, "kitty", width)).size == shown
    assert sixel_pixels(escapes(picture, "sixel", width)).shape[1::-1] == shown


def test_other_modes_are_drawn_too():
    for mode in ("L", "P", "RGBA", "1"):
        assert sixel_pixels(escapes(photo(9, 7).convert(mode), "sixel", 100)).shape == (7, 9, 3)

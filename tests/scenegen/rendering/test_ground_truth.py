"""The storage of radiance, and the count of visible pixels."""

import numpy as np
import pytest

from scenegen.rendering.ground_truth import decode_image, encode_image


def test_eight_bits_by_hand():
    radiance = np.array([-1.0, 0.0, 0.4 / 255, 0.6 / 255, 0.5, 1.0, 7.0])
    assert encode_image(radiance, "uint8").tolist() == [0, 0, 0, 1, 128, 255, 255]
    assert encode_image(radiance, "uint8").dtype == np.uint8


@pytest.mark.parametrize(("dtype", "rtol"), [("float16", 2**-11), ("float32", 2**-24)])
def test_floats_keep_radiance_beyond_one(dtype, rtol):
    radiance = np.array([0.001, 0.5, 1.0, 37.5])
    stored = encode_image(radiance, dtype)
    assert stored.dtype == np.dtype(dtype)
    np.testing.assert_allclose(decode_image(stored), radiance, rtol=rtol)
    assert decode_image(stored).dtype == np.float32


def test_every_stored_byte_comes_back():
    every = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(encode_image(decode_image(every), "uint8"), every)

"""Philox against the known answers that the authors published with Random123."""

import numpy as np
import pytest

from scenegen.common.random.philox import philox

FULL = 0xFFFFFFFF
PI = (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344)


@pytest.mark.parametrize(
    ("counter", "key", "bits"),
    [
        ((0,) * 4, (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((FULL,) * 4, (FULL, FULL), (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (PI, (0xA4093822, 0x299F31D0), (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1)),
    ],
)
def test_known_answers(
    counter: tuple[int, ...], key: tuple[int, int], bits: tuple[int, ...]
) -> None:
    other = np.array([[7, word] for word in counter], np.uint64)  # two counters at once
    words = philox((other[0], other[1], other[2], other[3]), key)
    assert tuple(int(word[1]) for word in words) == bits

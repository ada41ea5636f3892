"""Values in memory are those used last."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.common.recent import bytes_alive, recent


@dataclass
class Recorded:
    make: Callable[[], Any]


def test_bytes_are_those_that_a_value_keeps_alive() -> None:
    large, whole = np.zeros(10**6), np.zeros(10**5)
    data = bytes(10**6)
    part = np.frombuffer(memoryview(data)[: 8 * 10])
    for value, least in (
        (large, 8_000_000),
        (whole[:3], 800_000),  # a view
        (part, 1_000_000),
        ((large, [whole, whole[5:]], {"text": "x" * 10**5}), 8_900_000),
        (Recorded(lambda: large + 1.0), 8_000_000),
        (np.broadcast_to(whole, (50, 10**5)), 800_000),
    ):
        assert least < bytes_alive(value) < 1.01 * least + 2000


def test_results_used_last_are_kept_by_their_bytes() -> None:
    calls = []

    @recent(2_500)
    def row(number: int, *, size: int = 100) -> np.ndarray:
        calls.append(number)
        return np.full(size, number)

    for number in (1, 2, 1, 2, 3, 2, 1):
        assert row(number)[0] == number
    assert calls == [1, 2, 3, 1]
    row(2, size=1000)
    row(2, size=1000)
    assert calls == [1, 2, 3, 1, 2]

"""Numbers that stand for no value among the depth of others."""

import numpy as np
import pytest

from metrics.intake.reading import Reading
from metrics.intake.truth_files import _look_for_marks
from metrics.measured.writer import TruthError

ROWS = np.mgrid[:48, :64][0]
ROOM = 1000.0 + 60 * ROWS  # millimetres
STREET = 3 + 77 * np.random.default_rng(0).random((48, 64)) ** 3  # metres
MM, UNSIGNED, SINGLE = 0.001, np.uint16, np.float32


@pytest.mark.parametrize(
    ("values", "marks", "dtype", "scale", "kind", "told"),
    [
        (ROOM, 65535, UNSIGNED, MM, "depth", "refused"),
        (ROOM, 65535, UNSIGNED, MM, "distance", "refused"),
        (ROOM, [65534, 65535], UNSIGNED, MM, "depth", "refused"),
        (5 * ROOM, 65535, UNSIGNED, 1 / 5000, "depth", "refused"),
        (ROOM, 65504, np.float16, MM, "depth", "refused"),
        (ROOM / 1000, 1e10, SINGLE, 1.0, "depth", "refused"),
        (STREET, 3.4028235e38, SINGLE, 1.0, "depth", "refused"),
        (STREET, 0.001, SINGLE, 1.0, "depth", "refused"),
        (256 * STREET, 65535, UNSIGNED, 1 / 256, "depth", "refused"),
        (1 / STREET, 1e-6, SINGLE, 1.0, "disparity", "refused"),
        (256 / STREET, 65535, UNSIGNED, 1.0, "disparity", "refused"),
        (STREET, 65535 / 256, SINGLE, 1.0, "depth", "hint"),
        (ROOM, 10_000, UNSIGNED, MM, "depth", "hint"),
        (20.0 + ROWS, 255, np.uint8, 0.05, "depth", "hint"),
        (STREET, -1, SINGLE, 1.0, "depth", ""),
        (1 / STREET, 0, SINGLE, 1.0, "disparity", ""),
        (STREET, 80, SINGLE, 1.0, "depth", ""),
        (np.ones((48, 64)), 5, SINGLE, 1.0, "depth", ""),
        (20.0 + 5 * ROWS, 255, np.uint8, 0.05, "depth", ""),
        (ROOM, 1000, UNSIGNED, MM, "depth", ""),
    ],
)
def test_numbers_that_stand_for_no_value(values, marks, dtype, scale, kind, told):
    """What is said then leaves them out, as the numbers of such files are read."""
    stored, hints = values.copy(), []
    stored[:4] = np.resize(marks, (4, 64))
    stored = stored.astype(dtype)
    reading = Reading(kind, scale)

    def look(reading):
        geometry = reading.geometry(stored, None, lambda h, w: np.full((h, w, 3), -1.0)).geometry
        _look_for_marks(reading, hints.append, "0.png", stored, np.isfinite(geometry))
        return geometry

    if told == "refused":
        with pytest.raises(TruthError) as error:
            look(reading)
        hints.append(error.value.hint)
    else:
        look(reading)
    assert len(hints) == bool(told)
    for hint in hints[:1]:
        words = hint.split()
        said = [float(words[i + 1]) for i, word in enumerate(words) if word == "--invalid"]
        known = np.isfinite(look(Reading(kind, scale, invalid=tuple(said))))
        assert len(hints) == 1
        assert not known[:4].any()
        assert known[4:].all()


def test_a_single_pixel_beyond_all_bounds_stands_for_no_value():
    stored = ROOM / 1000
    stored[0, 0] = 1e10
    with pytest.raises(TruthError):
        _look_for_marks(Reading(), print, "0.npy", stored, stored > 0)

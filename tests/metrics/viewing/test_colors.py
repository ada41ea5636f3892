"""Colours of errors."""

import numpy as np

from metrics.viewing.colors import RIGHT, TOO_FAR, TOO_NEAR, UNKNOWN, error_colors, legend


def test_colours_tell_sign_and_size():
    found = error_colors(np.array([-9.0, -0.1, 0.0, 0.05, 0.1, np.inf, np.nan]), 0.1)
    half = np.rint(np.add(RIGHT, TOO_FAR) / 2 + 1e-9)
    assert np.abs(found[3] - half).max() <= 1
    others = [TOO_NEAR, TOO_NEAR, RIGHT, TOO_FAR, UNKNOWN, UNKNOWN]
    assert found[[0, 1, 2, 4, 5, 6]].tolist() == [list(color) for color in others]


def test_the_legend_names_its_limit():
    assert "0.02 too far" in legend(0.02)

"""Hints on normals: for mistakes of sign, frame and range, and for nothing else."""

import numpy as np
import pytest
from hint_noise import smooth
from scipy import ndimage


def tilted(normal, degrees, seed=0):
    axis = np.random.default_rng(seed).normal(size=normal.shape)
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    a = np.radians(degrees)
    along = (axis * normal).sum(-1, keepdims=True)
    return normal * np.cos(a) + np.cross(axis, normal) * np.sin(a) + axis * along * (1 - np.cos(a))


@pytest.mark.slow
def test_innocent_normals_get_no_hint(hints, room_arrays):
    depth, normal, _, _ = room_arrays
    rng = np.random.default_rng(6)
    made = {
        "the truth": normal,
        "long": 7 * normal,
        "tilted by 30": tilted(normal, 30),
        "tilted by 90": tilted(normal, 90),
        "very wavy": normal + smooth(2, normal.shape, 15, 2.0),
        "blurred": ndimage.gaussian_filter(normal, (0, 6, 6, 0)),
        "the mean image": np.broadcast_to(normal.mean(axis=0), normal.shape),
        "towards the viewer": np.broadcast_to([0.0, 0.0, 1.0], normal.shape),
        "a corner": np.broadcast_to([1.0, 1.0, 1.0], normal.shape),
        "of other rooms": normal[np.random.default_rng(3).permutation(len(normal))],
        "random from 0 to 1": rng.random(normal.shape),
        "without signs": np.abs(normal) + 1e-3,
        "cut off at 0": np.maximum(normal, 0) + 1e-3,
        "zero": np.zeros_like(normal),
        "almost no x": normal * [-0.1, 1.0, 1.0],
        "away, and poor": -tilted(normal, 60),
    }
    told = {name: found for name, values in made.items() if (found := hints(depth[:8], values[:8]))}
    assert told == {}


NORMALS = {
    "away": (lambda n, r: -n, "facing away"),
    "world": (lambda n, r: np.einsum("nij,nhwj->nhwi", r, n), "world frame"),
    "OpenCV": (lambda n, r: n * [1, -1, -1], "OpenCV"),
    "y": (lambda n, r: n * [1, -1, 1], "y axis flipped"),
    "z": (lambda n, r: n * [1, 1, -1], "z axis flipped"),
    "xz": (lambda n, r: n * [-1, 1, -1], "x and z flipped"),
    "BGR": (lambda n, r: n[..., ::-1], "BGR"),
    "from 0 to 1": (lambda n, r: (n + 1) / 2, "0..1 for -1..1"),
    "from 0 to 255": (lambda n, r: np.rint(127.5 * (n + 1)), "0..255 for -1..1"),
    "from 0 to 1, bent": (lambda n, r: 0.55 * n + 0.5, "0..1 for -1..1"),
}


@pytest.mark.parametrize("kind", NORMALS)
def test_mistakes_in_normals(hints, room_arrays, kind):
    depth, normal, rotation, _ = room_arrays
    mistake, words = NORMALS[kind]
    guess = normal + smooth(3, normal.shape, 8, 0.2)
    guess = guess / np.linalg.norm(guess, axis=-1, keepdims=True)
    (line,) = hints(depth, mistake(guess, rotation))
    assert line.startswith("normal: looks ")
    assert words in line

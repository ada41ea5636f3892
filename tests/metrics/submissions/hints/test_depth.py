"""Hints on depth come for known mistakes, noise or not, and stay away from everything else.

The models here are imitated: the truth, blurred, bent and noisy. What the truth alone shows with
each mistake is in the corpus (`broken.HINTS`, by `test_validation`).
"""

import h5py
import numpy as np
import pytest
from hint_noise import smooth
from scipy import ndimage


@pytest.fixture(scope="module")
def square_path(make_rooms, tmp_path_factory):
    path = tmp_path_factory.mktemp("hints") / "square.h5"
    return make_rooms(path, 12, height=48, width=48, seed=12, min_visible_pixels=6)


def ramps(depth):
    """Depth images that know nothing of the room: planes and bowls, about as far as rooms are."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in depth.shape[1:]), indexing="ij")
    return {
        "a floor": 1.6 - 0.3 * y,
        "a wall": 1.6 + 0.2 * x,
        "a corner": 1.9 - 0.4 * (x * x + y * y),
        "a ball": 1.3 + 0.4 * (x * x + y * y),
    }


def innocent(depth, stretch):
    """Good, middling, poor, constant and random predictions, none of them a known mistake."""
    n = len(depth)
    rng = np.random.default_rng(5)
    mean = depth.mean(axis=0)
    each = np.exp(0.2 * rng.normal(size=(n, 1, 1)))
    made = {
        "the truth": depth,
        "noise": depth + 0.05 * rng.normal(size=depth.shape),
        "much noise": depth + 0.3 * rng.normal(size=depth.shape),
        "wavier": depth + smooth(2, depth.shape, 15, 0.1),
        "very wavy": depth + smooth(3, depth.shape, 25, 0.3),
        "blurred": ndimage.gaussian_filter(depth, (0, 6, 6)),
        "too far by a tenth": 1.1 * depth,
        "the mean image": np.broadcast_to(mean, depth.shape),
        "scaled at random": each * depth,
        "too far, scaled at random": 1.8 * each * depth,
        "blurred, scaled at random": each * ndimage.gaussian_filter(depth, (0, 6, 6)),
        "each image's median": 0 * depth + np.median(depth, axis=(1, 2), keepdims=True),
        "a constant": np.full_like(depth, 1.6),
        "constants at random": 0 * depth + 1.6 * each,
        "medians of other images": 0 * depth + np.roll(np.median(depth, (1, 2)), 3)[:, None, None],
        "zero": np.zeros_like(depth),
        "from 0 to 1": rng.random(depth.shape),
        "about right": 1.6 + 0.3 * rng.normal(size=depth.shape),
        "smooth from 0 to 1": np.clip(0.5 + smooth(5, depth.shape, 15, 0.3), 0, 1),
        "constant along the ray": 1.6 / np.broadcast_to(stretch, depth.shape),
        "long rays": 1.6 * np.broadcast_to(stretch, depth.shape),
    }
    return made | {name: np.broadcast_to(one, depth.shape) for name, one in ramps(depth).items()}


def test_innocent_depth_gets_no_hint(hints, room_arrays):
    """A claim of alignment only ever takes hints away."""
    depth, _, _, stretch = room_arrays
    made = innocent(depth, stretch)
    assert {name: found for name, values in made.items() if (found := hints(values[:8]))} == {}


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 4])
def test_few_rows(hints, room_arrays, count):
    depth, normal, _, stretch = room_arrays
    for values in innocent(depth, stretch).values():
        assert hints(values[:count], normal[:count]) == []
    assert len(hints(1000 * depth[:count], -normal[:count])) == 2


MISTAKES = {
    "ray": (lambda d, s: d * s, "distance along the ray"),
    "ray, 5% noise, scaled": (
        lambda d, s: 0.8 * d * s * np.random.default_rng(3).normal(1, 0.05, d.shape),
        "distance along the ray"),
    "ray, scaled": (lambda d, s: 1.2 * d * s, "distance along the ray"),
    "upside down, wavy": (lambda d, s: d[:, ::-1] + smooth(6, d.shape, 8, 0.03), "upside down"),
    "mirrored": (lambda d, s: d[:, :, ::-1], "mirrored"),
    "turned": (lambda d, s: d[:, ::-1, ::-1], "turned by 180"),
    "disparity, wavy": (lambda d, s: 1 / (d + smooth(7, d.shape, 8, 0.05)), "disparity"),
    "disparity from 0 to 1": (lambda d, s: (1 / d - 0.4) / 0.7, "disparity"),
    "far minus depth": (lambda d, s: 3 - d, "disparity"),
    "z, blurred": (lambda d, s: -ndimage.gaussian_filter(d, (0, 6, 6)), "negative"),
}  # fmt: skip


SCALES = {
    "millimetres": (lambda d: 1000 * d, "1,000 times the truth, as if millimetres"),
    "centimetres": (lambda d: 100 * d, "100 times the truth, as if centimetres"),
    "kilometres": (lambda d: d / 1000, "0.001 times the truth, as if another unit"),
    "a room of edge 2": (lambda d: 2 * d, "2 times the truth"),
    "a constant in millimetres": (lambda d: np.full_like(d, 1600.0), "as if millimetres"),
    "from 0 to 1, each": (
        lambda d: (d - d.min((1, 2), keepdims=True)) / np.ptp(d, axis=(1, 2), keepdims=True),
        "normalised to 0..1"),
    "from 0 to 65535, each, wavy": (
        lambda d: 65535 * np.clip((d - d.min((1, 2), keepdims=True)) / np.ptp(
            d, axis=(1, 2), keepdims=True) + smooth(9, d.shape, 8, 0.05), 0, 1),
        "picture of depth, 0..65535"),
    "from 0 to 1, all": (lambda d: (d - d.min()) / np.ptp(d), "normalised to 0..1"),
    "at most 1": (lambda d: d / d.max(), "normalised to 0..1"),
}  # fmt: skip


@pytest.mark.parametrize("alignment", ["none", "scale_shift"])
@pytest.mark.parametrize("kind", MISTAKES)
def test_mistakes_whatever_may_be_aligned(hints, room_arrays, kind, alignment):
    depth, _, _, stretch = room_arrays
    mistake, words = MISTAKES[kind]
    (line,) = hints(mistake(depth, stretch), alignment=alignment)
    assert line.startswith("depth: looks ")
    assert words in line


@pytest.mark.parametrize("kind", SCALES)
def test_scales(hints, room_arrays, kind):
    mistake, words = SCALES[kind]
    values = mistake(room_arrays[0])
    (line,) = hints(values)
    assert words in line
    assert hints(values, alignment="scale_shift") == [], "a claim of alignment takes it out"


def test_a_claimed_scale_excuses_scale_but_not_shift(hints, room_arrays):
    for alignment in ("scale", "median_scale"):
        for kind in ("millimetres", "a room of edge 2", "at most 1"):
            assert hints(SCALES[kind][0](room_arrays[0]), alignment=alignment) == []
        (line,) = hints(SCALES["from 0 to 1, each"][0](room_arrays[0]), alignment=alignment)
        assert "normalised" in line


def test_transposed_images(hints, square_path):
    with h5py.File(square_path) as file:
        depth = file["depth"][()]
    (line,) = hints(depth.swapaxes(1, 2), truth=square_path)
    assert "transposed" in line

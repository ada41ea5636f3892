"""Hints on noisy and sparse truth: each mistake is named, and nothing is said of what is right."""

import h5py
import numpy as np
import pytest
from measured_scenes import scene
from scipy import ndimage

from metrics.measured.reader import MeasuredFile
from metrics.measured.writer import Measured, Source, write_measured
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import hints
from metrics.submissions.writer import RoomPredictionWriter

SHARES = (0.9, 0.06)  # of the pixels that were measured


@pytest.fixture(scope="module", params=SHARES)
def truth(request, measured):
    """Images whose depth has noise of 2%, dense or sparse."""
    return measured(request.param, noise=0.02, groups=False)


@pytest.fixture
def told(truth, predicted):
    """What the hints say of a change of the true depth, with noise of 3% as a model's."""

    def say(change, noise=0.03, **texts):
        def made(depth, rng):
            noisy = depth * (1.0 + noise * rng.standard_normal(depth.shape))
            return change(noisy, rng)

        with (
            open_predictions(predicted(truth, made, **texts)) as file,
            MeasuredFile(truth) as open_,
        ):
            return [str(hint) for hint in hints(file, open_)]

    return say


def moved(y, x):
    return lambda depth, rng: ndimage.shift(depth, (y, x), order=1, mode="nearest")


def distance(depth, rng):
    height, width = depth.shape
    y, x = np.mgrid[:height, :width] + 0.5
    return depth * np.sqrt(1 + ((x - 31) / 60) ** 2 + ((y - 23) / 61) ** 2)


def zeros(depth, rng):
    return np.where(rng.random(depth.shape) < 0.1, 0.0, depth)


MISTAKES = {
    "millimetres": (lambda depth, rng: 1000.0 * depth, {}, "millimetres"),
    "disparity for depth": (lambda depth, rng: 1.0 / depth, {}, "disparity"),
    "depth for disparity": (lambda depth, rng: {"disparity": depth}, {}, "looks like depth"),
    "distance": (distance, {}, "distance along the ray"),
    "mirrored": (lambda depth, rng: depth[:, ::-1], {}, "mirrored"),
    "upside down": (lambda depth, rng: depth[::-1], {}, "upside down"),
    "no value as 0": (zeros, {}, "marker of invalid pixels"),
    "half a pixel right": (moved(0, 0.5), {}, "0.5 pixel right"),
    "half a pixel left": (moved(0, -0.5), {"alignment": "scale"}, "0.5 pixel left"),
    "a pixel up": (moved(-1, 0), {}, "1 pixel up"),
    "two pixels down and left": (moved(2, -2), {}, "pixels left"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named(name, told):
    """Whether depth is known at most pixels, or at a few."""
    change, texts, words = MISTAKES[name]
    said = told(change, **texts)
    assert any(words in hint for hint in said), said


def edges_too_near(depth, rng):
    return ndimage.minimum_filter(depth, 3)


RIGHT = {
    "the truth": lambda depth, rng: depth,
    "blurred": lambda depth, rng: ndimage.gaussian_filter(depth, 3),
    "edges too near": edges_too_near,
    "from a quarter of the pixels": lambda depth, rng: np.kron(depth[::2, ::2], np.ones((2, 2)))[
        : len(depth), : depth.shape[1]
    ],
    "too far": lambda depth, rng: 1.2 * depth,
    "a tilt": lambda depth, rng: depth * np.linspace(0.8, 1.2, len(depth))[:, None],
    "bent": lambda depth, rng: np.maximum(depth, 0.1) ** 1.2,
    "wavy": lambda depth, rng: (
        depth + 0.3 * ndimage.gaussian_filter(rng.standard_normal(depth.shape), 4) * 8
    ),
    "a floor": lambda depth, rng: np.broadcast_to(
        6.0 / np.linspace(1, 4, len(depth))[:, None], depth.shape
    ),
}


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.parametrize(
    "noise", [0.03, *(pytest.param(some, marks=pytest.mark.slow) for some in (0.0, 0.15))]
)
def test_nothing_is_said_of_what_is_no_mistake(name, noise, told):
    """Of good, blurred, biased and poor predictions."""
    assert not told(RIGHT[name], noise)


def test_values_that_are_not_finite_are_no_shift(truth, predicted):
    """Nor do they end the hints."""
    path = predicted(truth, lambda depth, rng: depth)
    with h5py.File(path, "r+") as file:
        depth = file["depth"][()]
        depth[:, ::3, ::5], depth[:, ::4, ::7], depth[:, ::5, ::3] = np.nan, np.inf, -np.inf
        file["depth"][...] = depth
    with open_predictions(path) as file, MeasuredFile(truth) as opened:
        assert not hints(file, opened)


@pytest.mark.parametrize("crop", [True, False])
def test_the_crop_of_nyu_is_named(crop, tmp_path):
    """Where predictions of 480x640 pixels show rows 45 to 471 and columns 41 to 601, enlarged."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:480, :640]
    depth = 4.0 + np.sin(y / 31) * np.cos(x / 37) + scene(1, 480, 640)
    image = np.zeros((480, 640, 3), np.uint8)
    sparse = np.where(rng.random(depth.shape) < 0.05, depth, np.nan)
    row = Source("a", "a", depth.shape, lambda: Measured(image, sparse))
    write_measured(tmp_path / "truth.h5", [row], source="", licence="")
    rows = (np.arange(480) + 0.5) * 426 / 480 + 44.5
    columns = (np.arange(640) + 0.5) * 560 / 640 + 40.5
    places = np.meshgrid(rows, columns, indexing="ij")
    said = ndimage.map_coordinates(depth, places, order=1) if crop else depth
    said = said * (1.0 + 0.03 * rng.standard_normal(said.shape))
    with RoomPredictionWriter(tmp_path / "p.h5", tmp_path / "truth.h5", method="m") as out:
        out.add(0, said)
    with open_predictions(tmp_path / "p.h5") as file, MeasuredFile(tmp_path / "truth.h5") as truth:
        assert ["crop" in str(hint) for hint in hints(file, truth)] == [True] * crop

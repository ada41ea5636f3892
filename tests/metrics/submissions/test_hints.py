"""Hints come for known mistakes, noise or not, and stay away from everything else.

Models are imitated: the truth, blurred, bent and noisy. What the truth alone shows with each
mistake is in the corpus (`broken.HINTS`, by `test_validation`).
"""

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import ndimage

from metrics.prediction_writer import RoomPredictionWriter
from metrics.submissions.hints.no_value import no_value_mark
from metrics.submissions.hints.samples import mirrored_grid
from metrics.submissions.hints.tasks import answer_hints
from metrics.submissions.inspection import Inspection
from metrics.submissions.reader import QuestionPredictions
from metrics.submissions.validation import validate
from scenegen.camera import back_project
from scenegen.rooms.reader import RoomsFile


def smooth(seed, shape, width, size):
    """Noise that varies over `width` pixels, of standard deviation `size`."""
    values = np.random.default_rng(seed).normal(size=shape)
    values = ndimage.gaussian_filter(values, (0, width, width, 0)[: len(shape)])
    return size * values / values.std()


@pytest.mark.parametrize("count", [80, pytest.param(300, marks=pytest.mark.slow)])
def test_rooms_of_another_file_get_no_hint(count, hints, make_rooms, tmp_path):
    """Rooms, and good ones, but others: among many there is always one that is like them."""
    truth, path = (make_rooms(tmp_path / f"{seed}.h5", count, seed=seed) for seed in (98, 99))
    with h5py.File(path) as file:
        assert hints(file["depth"][()], file["normal"][()], truth=truth) == []


@pytest.mark.parametrize(
    "odd",
    [np.nan, np.inf, -1e300, *(pytest.param(x, marks=pytest.mark.slow) for x in (-np.inf, 1e-300))],
)
@pytest.mark.parametrize("share", [0.01, 1.0])
def test_odd_values_are_passed_over(hints, room_arrays, odd, share):
    depth, normal, _, _ = room_arrays
    spoiled = np.random.default_rng(4).random(depth.shape) < share
    bent = np.where(spoiled, odd, depth[:, ::-1])
    normals = np.where(spoiled[..., None], odd, -normal)
    told = hints(bent, normals)
    assert len(told) <= 3
    if share == 0.01:
        assert any("upside down" in line for line in told)
        assert any("facing away" in line for line in told)


def test_a_truth_with_holes(hints, hint_truth, room_arrays, tmp_path):
    depth, normal, _, stretch = room_arrays
    path = tmp_path / "holes.h5"
    path.write_bytes(hint_truth.read_bytes())
    with h5py.File(path, "r+") as file:
        file["depth"][:, 10:30, 20:40] = np.nan
        file["normal"][:, 10:30, 20:40] = 0.0
    assert hints(depth, normal, truth=path) == []
    told = hints(depth * stretch, -normal, truth=path)
    assert ["along the ray" in told[0], "away" in told[1]] == [True, True]


COUNT = 16  # rooms that `hints` knows
AT_RANDOM = np.random.default_rng(3).permutation(COUNT)


@pytest.mark.parametrize("order", [np.roll(np.arange(COUNT), 1), AT_RANDOM], ids=["late", "random"])
@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_shuffled_rows(hints, room_arrays, order, scale):
    depth = scale * (room_arrays[0] + smooth(9, room_arrays[0].shape, 8, 0.03))
    (line,) = hints(depth[order], alignment="none" if scale == 1.0 else "scale")
    assert line.startswith("row: ")
    assert hints(depth[order], rows=order, alignment="scale") == [], "rightly named"


def test_a_few_rows_swapped_are_no_pattern_and_a_part_of_them_is(hints, room_arrays):
    order = np.r_[1, 0, 3, 2, 4:COUNT]
    assert hints(room_arrays[0][order]) == []
    rows = np.arange(2, 15)
    (line,) = hints(room_arrays[0][rows], rows=rows[::-1])
    assert line.startswith("row: ")


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 127, 128, 129, 1000, 4096])
def test_the_grid_is_its_own_mirror_image(count):
    grid = mirrored_grid(count, 32)
    assert np.array_equal(np.sort(count - 1 - grid), grid)
    assert min(count, 32) <= len(grid) <= 64
    assert (grid[0], grid[-1]) == (0, count - 1)


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
    y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in depth.shape[1:]), indexing="ij")
    bowl = 0.4 * (x * x + y * y)
    shapes = {"floor": 1.6 - 0.3 * y, "wall": 1.6 + 0.2 * x, "corner": 1.9 - bowl}
    shapes["ball"] = 1.3 + bowl
    return made | {name: np.broadcast_to(one, depth.shape) for name, one in shapes.items()}


def test_innocent_depth_gets_no_hint(hints, room_arrays):
    """A claim of alignment only ever takes hints away."""
    depth, _, _, stretch = room_arrays
    made = innocent(depth, stretch)
    assert {name: found for name, values in made.items() if (found := hints(values[:8]))} == {}


MISTAKES = {
    "ray": (lambda d, s: d * s, "distance along the ray"),
    "ray, 5% noise, scaled": (
        lambda d, s: 0.8 * d * s * np.random.default_rng(3).normal(1, 0.05, d.shape),
        "distance along the ray"),
    "ray, scaled": (lambda d, s: 1.2 * d * s, "distance along the ray"),
    "upside down, wavy": (lambda d, s: d[:, ::-1] + smooth(6, d.shape, 8, 0.03), "upside down"),
    "mirrored": (lambda d, s: d[:, :, ::-1], "mirrored"),
    "turned": (lambda d, s: d[:, ::-1, ::-1], "by 180"),
    "disparity, wavy": (lambda d, s: 1 / (d + smooth(7, d.shape, 8, 0.05)), "disparity"),
    "disparity from 0 to 1": (lambda d, s: (1 / d - 0.4) / 0.7, "disparity"),
    "far minus depth": (lambda d, s: 3 - d, "disparity"),
    "z, blurred": (lambda d, s: -ndimage.gaussian_filter(d, (0, 6, 6)), "negative"),
}  # fmt: skip
SCALES = {
    "millimetres": (lambda d: 1000 * d, "1,000 times the ground truth (millimetres"),
    "centimetres": (lambda d: 100 * d, "100 times the ground truth (centimetres"),
    "kilometres": (lambda d: d / 1000, "0.001 times the ground truth (another unit"),
    "a room of edge 2": (lambda d: 2 * d, "2 times the ground truth"),
    "a constant in millimetres": (lambda d: np.full_like(d, 1600.0), "millimetres"),
    "from 0 to 1, each": (
        lambda d: (d - d.min((1, 2), keepdims=True)) / np.ptp(d, axis=(1, 2), keepdims=True),
        "normalised to 0..1"),
    "from 0 to 65535, each, wavy": (
        lambda d: 65535 * np.clip((d - d.min((1, 2), keepdims=True)) / np.ptp(
            d, axis=(1, 2), keepdims=True) + smooth(9, d.shape, 8, 0.05), 0, 1),
        "0..65535"),
    "from 0 to 1, all": (lambda d: (d - d.min()) / np.ptp(d), "normalised to 0..1"),
    "at most 1": (lambda d: d / d.max(), "normalised to 0..1"),
}  # fmt: skip


@pytest.mark.parametrize("alignment", ["scale_shift", pytest.param("none", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", MISTAKES)
def test_mistakes_whatever_may_be_aligned(hints, room_arrays, kind, alignment):
    depth, _, _, stretch = room_arrays
    mistake, words = MISTAKES[kind]
    (line,) = hints(mistake(depth, stretch), alignment=alignment)
    assert line.startswith("depth: looks ")
    assert words in line


SHIFTED = ("from 0 to 1, each", "from 0 to 65535, each, wavy", "from 0 to 1, all")


@pytest.mark.parametrize("kind", SCALES)
def test_scales(hints, room_arrays, kind):
    mistake, words = SCALES[kind]
    values = mistake(room_arrays[0])
    (line,) = hints(values)
    assert words in line
    assert hints(values, alignment="scale_shift") == [], "a claim of alignment takes it out"
    told = [words in line for line in hints(values, alignment="scale")]
    assert told == [True] * (kind in SHIFTED)


def test_transposed_images(hints, make_rooms, tmp_path):
    path = make_rooms(tmp_path / "x.h5", 12, height=48, width=48, seed=12, min_visible_pixels=6)
    with h5py.File(path) as file:
        depth = file["depth"][()]
    (line,) = hints(depth.swapaxes(1, 2), truth=path)
    assert "transposed" in line


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


SLOW = ("OpenCV", "y", "z", "xz", "from 0 to 1")  # others are like them
KINDS = [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in NORMALS]


@pytest.mark.parametrize("kind", KINDS)
def test_mistakes_in_normals(hints, room_arrays, kind):
    depth, normal, rotation, _ = room_arrays
    mistake, words = NORMALS[kind]
    guess = normal + smooth(3, normal.shape, 8, 0.2)
    guess = guess / np.linalg.norm(guess, axis=-1, keepdims=True)
    (line,) = hints(depth, mistake(guess, rotation))
    assert line.startswith("normal: looks ")
    assert words in line


def told(truth, path, made, alignment="none", noise=0.01):
    """What is said of points made of the true ones (H, W, 3), the pose and a generator."""
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="m", alignment=alignment) as out,
    ):
        for row, room in enumerate(rooms):
            rng = np.random.default_rng(row)
            points = np.nan_to_num(back_project(room.depth, room.fov_y_degrees))
            points = points * (1.0 + noise * rng.standard_normal((*points.shape[:2], 1)))
            out.add(row, points=made(points, room.world_from_camera, rng))
    return [p.found for p in validate(path, truth) if p.is_hint and p.dataset == "points"]


def in_world(points, pose):
    return points @ pose[:3, :3].T + pose[:3, 3]


POINTS = {
    "mirrored": (lambda p, *_: p * [-1, 1, 1], "x axis flipped"),
    "swapped": (lambda p, *_: p[..., [1, 0, 2]], "y, x, z"),
    "doubled": (lambda p, *_: p * [2, 2, 1], "another field of view"),
    "narrow": (lambda p, *_: p * [0.8, 0.8, 1], "another field of view"),
    "world of OpenCV": (lambda p, pose, _: in_world(p, pose) * [1, -1, -1], "world frame"),
}


@pytest.mark.parametrize("name", POINTS)
def test_mistakes_in_points(rooms_path, tmp_path, name):
    made, words = POINTS[name]
    off, looks = told(rooms_path, tmp_path / "p.h5", made)
    assert "pixels" in off
    assert words in looks


@pytest.mark.parametrize("alignment", ["none", "scale", "scale_shift"])
def test_points_on_their_rays_get_no_hint(rooms_path, tmp_path, alignment):
    factor = 1.0 if alignment == "none" else 3.0
    shift = np.array([0.5, -0.2, -1.0]) * (alignment == "scale_shift")
    assert told(rooms_path, tmp_path / "p.h5", lambda p, *_: factor * p + shift, alignment) == []


def marks(path):
    """What hints say of marks in a submission."""
    return [p for p in validate(path, None) if p.is_hint and "--invalid" in p.found]


def submission(truth, path, holes, value, kind="depth", alignment="none"):
    """The truth, with a value at some pixels of every row."""
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="m", alignment=alignment) as out,
    ):
        for row, room in enumerate(rooms):
            image = room.points if kind == "points" else room.depth.astype(float)
            image = 1 / image if kind == "disparity" else image
            image.reshape(image.shape[0] * image.shape[1], -1)[holes] = value
            out.add(row, **{kind: image})
    return path


SOME, ONE = slice(40, 80), slice(7, 8)


@pytest.mark.parametrize(
    ("value", "holes", "kind", "alignment"),
    [
        (1e10, SOME, "depth", "none"),
        (1e10, ONE, "depth", "none"),
        (65504.0, SOME, "depth", "scale"),
        (65.535, SOME, "depth", "none"),
        (3.4e38, ONE, "depth", "scale_shift"),
        (1e10, slice(0, 1000), "depth", "none"),  # nearly all
        (0.0, ONE, "depth", "median_scale"),
        (-1.0, SOME, "depth", "none"),
        (1e10, SOME, "disparity", "scale_shift"),
        ((0.0, 0.0, -1e10), SOME, "points", "none"),
        (0.0, SOME, "points", "scale"),
    ],
)
def test_a_mark_is_told(value, holes, kind, alignment, truths, tmp_path):
    path = submission(truths.rooms, tmp_path / "p.h5", holes, value, kind, alignment)
    (hint,) = marks(path)
    assert hint.dataset == kind
    assert len(hint.ids) == 5


def test_where_the_truth_has_no_surface_anything_may_stand(make_rooms, tmp_path):
    truth = make_rooms(tmp_path / "x.h5", 4, fov_degrees=60.0)
    with RoomsFile(truth) as rooms:
        depth = rooms.read("depth", slice(None))
    assert np.isnan(depth).any()
    for value, told in ((1e10, 0), (np.inf, 0)):
        with RoomPredictionWriter(tmp_path / f"{value}.h5", truth, method="m") as out:
            for row, image in enumerate(depth):
                out.add(row, depth=np.where(np.isnan(image), value, image))
        assert len(marks(tmp_path / f"{value}.h5")) == told


def test_no_mark_in_what_methods_predict(room_arrays):
    depth, *_ = room_arrays
    rng = np.random.default_rng(0)
    made = [
        depth, 65504 * depth, 1e-3 * depth, depth + rng.normal(size=depth.shape),
        np.maximum(depth, 1.5), np.minimum(depth, 1.5), np.exp(3 * rng.normal(size=depth.shape)),
        np.full(depth.shape, 80.0), np.where(depth > 1.6, 2.0, 1.2), rng.random(depth.shape),
    ]  # fmt: skip
    for images in made:
        assert [no_value_mark(image[~np.isnan(image)], True) for image in images] == [None] * 16
    shifted = [depth - 1.5, -1 / depth, np.maximum(depth - 1.5, 0)]
    for images in shifted:
        assert [no_value_mark(image[~np.isnan(image)], False) for image in images] == [None] * 16


def answered(scores, rows=None):
    """A submission with these scores (Q, 3)."""
    rows = np.arange(len(scores)) if rows is None else rows
    arrays = {} if scores is None else {"scores": scores}
    content = Inspection("iqtt", arrays=arrays, ids=rows, answers=0 * rows)
    return QuestionPredictions(Path(__file__), content, None)


def test_scores_that_are_distances():
    rng = np.random.default_rng(7)
    right = rng.integers(0, 3, 300)
    scores = rng.random((300, 3))
    assert answer_hints(answered(scores), right) == []
    scores[np.arange(300), right] += 0.5
    assert answer_hints(answered(scores), right) == []
    (hint,) = answer_hints(answered(-scores), right)
    assert hint.is_hint
    assert "distances" in hint.found
    assert answer_hints(answered(-scores[:3]), right) == [], "too few to tell"
    assert answer_hints(answered(None, np.arange(3)), right) == []


def test_answers_that_are_counted_from_one():
    rng = np.random.default_rng(8)
    right = rng.integers(0, 3, 300)
    rows = np.arange(300)

    def hints(answers):
        content = Inspection("iqtt", arrays={}, ids=rows, answers=answers)
        return answer_hints(QuestionPredictions(Path(__file__), content, None), right)

    assert hints(right) == []
    assert hints(rng.integers(0, 3, 300)) == []
    assert hints(np.full(300, 1)) == []
    (hint,) = hints(right + 1)
    assert (hint.is_hint, hint.dataset) == (True, "answer")
    (hint,) = hints(rng.integers(1, 4, 300))
    assert hint.dataset == "answer"

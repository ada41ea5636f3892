"""Hints come for known mistakes, noise or not, and stay away from everything else.

The models here are imitated: the truth, blurred, bent and noisy. What the truth alone shows with
each mistake is in the corpus (`broken.HINTS`, by `test_validation`).
"""

import h5py
import numpy as np
import pytest
from scipy import ndimage

from metrics.hint_samples import mirrored_grid
from metrics.hints import answer_hints, room_hints
from metrics.prediction_file import QuestionPredictions, open_predictions
from scenegen.camera import pixel_directions
from scenegen.scene_file import RoomsFile

COUNT = 16


@pytest.fixture(scope="module")
def truth_path(make_rooms, tmp_path_factory):
    """Higher than wide, and more pixels than are looked at."""
    path = tmp_path_factory.mktemp("hints") / "rooms.h5"
    return make_rooms(path, COUNT, height=80, width=68, seed=11, min_visible_pixels=20)


@pytest.fixture(scope="module")
def square_path(make_rooms, tmp_path_factory):
    path = tmp_path_factory.mktemp("hints") / "square.h5"
    return make_rooms(path, 12, height=48, width=48, seed=12, min_visible_pixels=6)


@pytest.fixture(scope="module")
def arrays(truth_path):
    """Depth (N, H, W), normals (N, H, W, 3), rotations (N, 3, 3), lengths of rays (H, W)."""
    with h5py.File(truth_path) as file:
        depth, normal = file["depth"][()].astype("f8"), file["normal"][()].astype("f8")
        rotation = file["camera/world_from_camera"][:, :3, :3]
        fov = file["camera/fov_y_degrees"][0]
    return depth, normal, rotation, np.linalg.norm(pixel_directions(80, 68, fov), axis=-1)


@pytest.fixture
def hints(truth_path, tmp_path):
    """What hints say to predictions, written without any check."""

    def told(depth, normal=None, rows=None, alignment="none", truth=truth_path):
        path = tmp_path / "predictions.h5"
        with RoomsFile(truth) as rooms:
            with h5py.File(path, "w") as file:
                file.attrs.update(
                    format="pix2shape-bench/predictions", format_version="1.0", task="rooms",
                    method="m", truth_fingerprint=rooms.fingerprint, alignment=alignment,
                )  # fmt: skip
                file["row"] = np.arange(len(depth)) if rows is None else rows
                file["depth"] = depth
                if normal is not None:
                    file["normal"] = normal
            with open_predictions(path) as found:
                return [f"{one.dataset}: {one.got}" for one in room_hints(found, rooms)]

    return told


def smooth(seed, shape, width, size):
    """Noise that varies over `width` pixels, of standard deviation `size`."""
    values = np.random.default_rng(seed).normal(size=shape)
    widths = (0, width, width, 0)[: len(shape)]
    values = ndimage.gaussian_filter(values, widths)
    return size * values / values.std()


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
        "a little noise": depth + 0.003 * rng.normal(size=depth.shape),
        "noise": depth + 0.05 * rng.normal(size=depth.shape),
        "much noise": depth + 0.3 * rng.normal(size=depth.shape),
        "wavy": depth + smooth(1, depth.shape, 8, 0.03),
        "wavier": depth + smooth(2, depth.shape, 15, 0.1),
        "very wavy": depth + smooth(3, depth.shape, 25, 0.3),
        "blurred": ndimage.gaussian_filter(depth, (0, 6, 6)),
        "very blurred": ndimage.gaussian_filter(depth, (0, 20, 20)),
        "too far": depth + 0.1,
        "too far by a tenth": 1.1 * depth,
        "too flat": 1.6 + 0.5 * (depth - 1.6),
        "half the mean image": 0.5 * (mean + depth),
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
        "normal": rng.normal(size=depth.shape),
        "about right": 1.6 + 0.3 * rng.normal(size=depth.shape),
        "smooth": 1.6 + smooth(4, depth.shape, 15, 0.2),
        "smooth from 0 to 1": np.clip(0.5 + smooth(5, depth.shape, 15, 0.3), 0, 1),
        "constant along the ray": 1.6 / np.broadcast_to(stretch, depth.shape),
        "long rays": 1.6 * np.broadcast_to(stretch, depth.shape),
    }
    return made | {name: np.broadcast_to(one, depth.shape) for name, one in ramps(depth).items()}


def test_innocent_depth_gets_no_hint(hints, arrays):
    """A claim of alignment only ever takes hints away."""
    depth, _, _, stretch = arrays
    made = innocent(depth, stretch)
    assert {name: found for name, values in made.items() if (found := hints(values))} == {}


def test_rooms_of_another_file_get_no_hint(hints, make_rooms, tmp_path):
    """Rooms, and good ones, but others: among many there is always one that is like them."""
    truth, path = (make_rooms(tmp_path / f"{seed}.h5", 300, seed=seed) for seed in (98, 99))
    with h5py.File(path) as file:
        assert hints(file["depth"][()], file["normal"][()], truth=truth) == []


@pytest.mark.parametrize("count", [1, 4])
def test_few_rows(hints, arrays, count):
    depth, normal, _, stretch = arrays
    for values in innocent(depth, stretch).values():
        assert hints(values[:count], normal[:count]) == []
    assert len(hints(1000 * depth[:count], -normal[:count])) == 2


MISTAKES = {
    "ray": (lambda d, s: d * s, "distance along the ray"),
    "ray, noisy": (lambda d, s: d * s + 0.005 * np.random.default_rng(1).normal(size=d.shape),
                   "distance along the ray"),
    "ray, scaled": (lambda d, s: 1.2 * d * s, "distance along the ray"),
    "upside down": (lambda d, s: d[:, ::-1], "upside down"),
    "upside down, wavy": (lambda d, s: d[:, ::-1] + smooth(6, d.shape, 8, 0.03), "upside down"),
    "mirrored": (lambda d, s: d[:, :, ::-1], "mirrored"),
    "turned": (lambda d, s: d[:, ::-1, ::-1], "turned by 180"),
    "disparity": (lambda d, s: 1 / d, "disparity"),
    "disparity, wavy": (lambda d, s: 1 / (d + smooth(7, d.shape, 8, 0.05)), "disparity"),
    "disparity from 0 to 1": (lambda d, s: (1 / d - 0.4) / 0.7, "disparity"),
    "far minus depth": (lambda d, s: 3 - d, "disparity"),
    "z": (lambda d, s: -d, "negative"),
    "z, blurred": (lambda d, s: -ndimage.gaussian_filter(d, (0, 6, 6)), "negative"),
}  # fmt: skip
SCALES = {
    "millimetres": (lambda d: 1000 * d, "1,000 times the truth, as if millimetres"),
    "millimetres, noisy": (
        lambda d: 1000 * (d + smooth(8, d.shape, 8, 0.1)), "as if millimetres"),
    "centimetres": (lambda d: 100 * d, "100 times the truth, as if centimetres"),
    "kilometres": (lambda d: d / 1000, "0.001 times the truth, as if another unit"),
    "a room of edge 2": (lambda d: 2 * d, "2 times the truth"),
    "a constant in millimetres": (lambda d: np.full_like(d, 1600.0), "as if millimetres"),
    "from 0 to 1, each": (
        lambda d: (d - d.min((1, 2), keepdims=True)) / np.ptp(d, axis=(1, 2), keepdims=True),
        "normalised to 0..1"),
    "from 0 to 1, all": (lambda d: (d - d.min()) / np.ptp(d), "normalised to 0..1"),
    "at most 1": (lambda d: d / d.max(), "normalised to 0..1"),
}  # fmt: skip


@pytest.mark.parametrize("alignment", ["none", "scale_shift"])
@pytest.mark.parametrize("kind", MISTAKES)
def test_mistakes_whatever_may_be_aligned(hints, arrays, kind, alignment):
    depth, _, _, stretch = arrays
    mistake, words = MISTAKES[kind]
    (line,) = hints(mistake(depth, stretch), alignment=alignment)
    assert line.startswith("depth: looks ")
    assert words in line


@pytest.mark.parametrize("kind", SCALES)
def test_scales(hints, arrays, kind):
    mistake, words = SCALES[kind]
    values = mistake(arrays[0])
    (line,) = hints(values)
    assert words in line
    assert hints(values, alignment="scale_shift") == [], "a claim of alignment takes it out"


def test_a_claimed_scale_excuses_scale_but_not_shift(hints, arrays):
    for alignment in ("scale", "median_scale"):
        for kind in ("millimetres", "a room of edge 2", "at most 1"):
            assert hints(SCALES[kind][0](arrays[0]), alignment=alignment) == []
        (line,) = hints(SCALES["from 0 to 1, each"][0](arrays[0]), alignment=alignment)
        assert "normalised" in line


def test_two_mistakes_at_once(hints, arrays):
    depth, _, _, stretch = arrays
    told = hints(1000 * depth * stretch)
    assert len(told) == 2
    assert "along the ray" in told[0]
    assert "millimetres" in told[1]


def test_transposed_images(hints, square_path):
    with h5py.File(square_path) as file:
        depth = file["depth"][()]
    (line,) = hints(depth.swapaxes(1, 2), truth=square_path)
    assert "transposed" in line


# ---- order ----


ORDERS = {
    "reversed": np.arange(COUNT)[::-1],
    "one late": np.roll(np.arange(COUNT), 1),
    "sorted as texts": np.array(sorted(range(COUNT), key=str)),
    "at random": np.random.default_rng(3).permutation(COUNT),
}


@pytest.mark.parametrize("kind", ORDERS)
@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_shuffled_rows(hints, arrays, kind, scale):
    depth = scale * (arrays[0] + smooth(9, arrays[0].shape, 8, 0.03))
    alignment = "none" if scale == 1.0 else "scale"
    (line,) = hints(depth[ORDERS[kind]], alignment=alignment)
    assert line.startswith("row: rows look shuffled")


def test_rows_in_another_order_but_rightly_named(hints, arrays):
    order = ORDERS["at random"]
    assert hints(arrays[0][order], arrays[1][order], rows=order) == []


def test_a_few_rows_swapped_are_no_pattern(hints, arrays):
    order = np.r_[1, 0, 3, 2, 4:COUNT]
    assert hints(arrays[0][order]) == []


def test_shuffled_rows_that_are_not_all_there(hints, arrays):
    rows = np.arange(2, 15)
    (line,) = hints(arrays[0][rows], rows=rows[::-1])
    assert "that of row 14 fits row 2" in line


# ---- normals ----


def tilted(normal, degrees, seed=0):
    axis = np.random.default_rng(seed).normal(size=normal.shape)
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    a = np.radians(degrees)
    along = (axis * normal).sum(-1, keepdims=True)
    return normal * np.cos(a) + np.cross(axis, normal) * np.sin(a) + axis * along * (1 - np.cos(a))


def test_innocent_normals_get_no_hint(hints, arrays):
    depth, normal, _, _ = arrays
    rng = np.random.default_rng(6)
    made = {
        "the truth": normal,
        "long": 7 * normal,
        "tilted by 10": tilted(normal, 10),
        "tilted by 30": tilted(normal, 30),
        "tilted by 60": tilted(normal, 60),
        "tilted by 90": tilted(normal, 90),
        "wavy": normal + smooth(1, normal.shape, 8, 0.3),
        "very wavy": normal + smooth(2, normal.shape, 15, 2.0),
        "blurred": ndimage.gaussian_filter(normal, (0, 6, 6, 0)),
        "the mean image": np.broadcast_to(normal.mean(axis=0), normal.shape),
        "towards the viewer": np.broadcast_to([0.0, 0.0, 1.0], normal.shape),
        "to the side": np.broadcast_to([1.0, 0.0, 0.0], normal.shape),
        "a corner": np.broadcast_to([1.0, 1.0, 1.0], normal.shape),
        "of other rooms": normal[ORDERS["at random"]],
        "random": rng.normal(size=normal.shape),
        "random from 0 to 1": rng.random(normal.shape),
        "without signs": np.abs(normal) + 1e-3,
        "cut off at 0": np.maximum(normal, 0) + 1e-3,
        "zero": np.zeros_like(normal),
        "almost no x": normal * [-0.1, 1.0, 1.0],
        "away, and poor": -tilted(normal, 60),
    }
    told = {name: found for name, values in made.items() if (found := hints(depth, values))}
    assert told == {}


NORMALS = {
    "away": (lambda n, r: -n, "facing away"),
    "world": (lambda n, r: np.einsum("nij,nhwj->nhwi", r, n), "world frame"),
    "OpenCV": (lambda n, r: n * [1, -1, -1], "OpenCV"),
    "y": (lambda n, r: n * [1, -1, 1], "y axis flipped"),
    "z": (lambda n, r: n * [1, 1, -1], "z axis flipped"),
    "x": (lambda n, r: n * [-1, 1, 1], "x axis flipped"),
    "xy": (lambda n, r: n * [-1, -1, 1], "x and y flipped"),
    "xz": (lambda n, r: n * [-1, 1, -1], "x and z flipped"),
    "BGR": (lambda n, r: n[..., ::-1], "BGR"),
    "from 0 to 1": (lambda n, r: (n + 1) / 2, "0..1 for -1..1"),
    "from 0 to 255": (lambda n, r: np.rint(127.5 * (n + 1)), "0..255 for -1..1"),
    "from 0 to 1, bent": (lambda n, r: 0.55 * n + 0.5, "0..1 for -1..1"),
}


@pytest.mark.parametrize("kind", NORMALS)
@pytest.mark.parametrize("noisy", [0.0, 0.2])
def test_mistakes_in_normals(hints, arrays, kind, noisy):
    depth, normal, rotation, _ = arrays
    mistake, words = NORMALS[kind]
    guess = normal + smooth(3, normal.shape, 8, noisy) if noisy else normal
    guess = guess / np.linalg.norm(guess, axis=-1, keepdims=True)
    (line,) = hints(depth, mistake(guess, rotation))
    assert line.startswith("normal: looks ")
    assert words in line


# ---- robustness ----


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300])
@pytest.mark.parametrize("share", [0.01, 1.0])
def test_odd_values_are_passed_over(hints, arrays, odd, share):
    depth, normal, _, _ = arrays
    spoiled = np.random.default_rng(4).random(depth.shape) < share
    bent = np.where(spoiled, odd, depth[:, ::-1])
    normals = np.where(spoiled[..., None], odd, -normal)
    told = hints(bent, normals)
    assert len(told) <= 3
    if share == 0.01:
        assert any("upside down" in line for line in told)
        assert any("facing away" in line for line in told)


def test_a_truth_with_holes(hints, truth_path, arrays, tmp_path):
    depth, normal, _, stretch = arrays
    path = tmp_path / "holes.h5"
    path.write_bytes(truth_path.read_bytes())
    with h5py.File(path, "r+") as file:
        file["depth"][:, 10:30, 20:40] = np.nan
        file["normal"][:, 10:30, 20:40] = 0.0
    assert hints(depth, normal, truth=path) == []
    told = hints(depth * stretch, -normal, truth=path)
    assert ["along the ray" in told[0], "away" in told[1]] == [True, True]


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 127, 128, 129, 1000, 4096])
def test_the_grid_is_its_own_mirror_image(count):
    grid = mirrored_grid(count, 32)
    assert np.array_equal(np.sort(count - 1 - grid), grid)
    assert len(grid) <= 64
    assert len(grid) >= min(count, 32)
    assert (grid[0], grid[-1]) == (0, count - 1)


# ---- answers ----


def answered(scores, rows=None):
    """A submission with these scores (Q, 3)."""
    found = QuestionPredictions.__new__(QuestionPredictions)
    found.rows = np.arange(len(scores)) if rows is None else rows
    found.__dict__["scores"] = scores
    return found


def test_scores_that_are_distances():
    rng = np.random.default_rng(7)
    right = rng.integers(0, 3, 300)
    scores = rng.random((300, 3))
    assert answer_hints(answered(scores), right) == []
    scores[np.arange(300), right] += 0.5
    assert answer_hints(answered(scores), right) == []
    (hint,) = answer_hints(answered(-scores), right)
    assert hint.is_hint
    assert "distances" in hint.got
    assert answer_hints(answered(-scores[:3]), right) == [], "too few to tell"
    assert answer_hints(answered(None, np.arange(3)), right) == []

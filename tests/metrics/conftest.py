"""Rooms for the metric tests: exact depth images without a renderer, and what hints say of some."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import settings
from numpy.typing import ArrayLike, NDArray

from metrics.submissions.hints.rooms import room_hints
from metrics.submissions.reader import open_predictions
from scenegen.camera import pixel_directions
from scenegen.rooms.reader import RoomsFile

FOV_Y_DEGREES = 20.0
Depth = NDArray[np.float64]

# The first example pays for imports and the machine may be busy.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")


def _rays(size: int) -> tuple[Depth, Depth, Depth]:
    """Origin (3,), world directions (size, size, 3) with unit planar depth, camera axes (3, 3)."""
    origin = 0.25 + 2.5 * np.array([0.6, 0.45, 0.66])
    back = np.array([0.6, 0.45, 0.66]) / np.linalg.norm([0.6, 0.45, 0.66])
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    step = 2.0 * np.tan(np.radians(FOV_Y_DEGREES) / 2.0) / size
    x = (np.arange(size) + 0.5 - size / 2.0) * step
    directions = x[None, :, None] * right - x[:, None, None] * up - back
    return origin, directions, np.stack([right, up, back])


def _walls(origin: Depth, directions: Depth) -> Depth:
    """Nearest of the three faces x=0, y=0, z=0 of the unit box, NaN beyond them."""
    best = np.full(directions.shape[:2], np.inf)
    for axis in range(3):
        t = -origin[axis] / directions[..., axis]
        hit = origin + t[..., None] * directions
        others = np.delete(hit, axis, axis=-1)
        inside = (t > 0.0) & ((others >= 0.0) & (others <= 1.0)).all(axis=-1)
        best = np.where(inside & (t < best), t, best)
    return np.where(np.isfinite(best), best, np.nan)


def _sphere(origin: Depth, directions: Depth, center: Depth, radius: float) -> Depth:
    a = (directions**2).sum(axis=-1)
    b = directions @ (origin - center)
    c = ((origin - center) ** 2).sum() - radius**2
    root = b * b - a * c
    return np.where(root > 0.0, (-b - np.sqrt(np.maximum(root, 0.0))) / a, np.nan)


def _box(origin: Depth, directions: Depth, low: Depth, high: Depth) -> Depth:
    first, second = (low - origin) / directions, (high - origin) / directions
    near = np.minimum(first, second).max(axis=-1)
    far = np.maximum(first, second).min(axis=-1)
    return np.where((near < far) & (near > 0.0), near, np.nan)


def make_room_depth(seed: int, size: int) -> Depth:
    """Planar depth (size, size) of a box corner with two spheres and two boxes, from 2.5 away."""
    rng = np.random.default_rng(seed)
    origin, directions, _ = _rays(size)
    layers = [_walls(origin, directions)]
    for _ in range(2):
        radius = rng.uniform(0.06, 0.14)
        center = np.append(rng.uniform(0.1, 0.5, 1), [radius, rng.uniform(0.1, 0.5)])
        layers.append(_sphere(origin, directions, center, radius))
        low = np.array([rng.uniform(0.0, 0.4), 0.0, rng.uniform(0.0, 0.4)])
        layers.append(_box(origin, directions, low, low + rng.uniform(0.08, 0.25, 3)))
    return np.fmin.reduce(layers)


@pytest.fixture(scope="session")
def room_depth() -> Callable[[int, int], Depth]:
    """Depth of a room, by seed and image size."""
    return make_room_depth


@pytest.fixture(scope="session")
def hint_truth(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """16 rooms, higher than wide, with more pixels than hints look at."""
    path = tmp_path_factory.mktemp("hints") / "rooms.h5"
    return make_rooms(path, 16, height=80, width=68, seed=11, min_visible_pixels=20)


@pytest.fixture(scope="session")
def room_arrays(hint_truth: Path) -> tuple[Depth, ...]:
    """Depth (N, H, W), normals (N, H, W, 3), rotations (N, 3, 3), lengths of rays (H, W)."""
    with h5py.File(hint_truth) as file:
        depth, normal = file["depth"][()].astype("f8"), file["normal"][()].astype("f8")
        rotation = file["camera/world_from_camera"][:, :3, :3]
        fov = file["camera/fov_y_degrees"][0]
    made = depth, normal, rotation, np.linalg.norm(pixel_directions(80, 68, fov), axis=-1)
    for array in made:
        array.flags.writeable = False
    return made


@pytest.fixture
def hints(hint_truth: Path, tmp_path: Path) -> Callable[..., list[str]]:
    """What hints say to predictions, written without any check."""

    def told(
        depth: Depth,
        normal: Depth | None = None,
        rows: ArrayLike | None = None,
        alignment: str = "none",
        truth: Path = hint_truth,
    ) -> list[str]:
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
                return [f"{one.dataset}: {one.found}" for one in room_hints(found, rooms)]

    return told


@pytest.fixture(scope="session")
def answers_db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file with answers of 12 people who finished and one who did not."""
    from quizzes import made_answers

    return made_answers(tmp_path_factory.mktemp("people") / "answers.db", 12)


@pytest.fixture(scope="session")
def quiz_split(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with 24 test questions of 32x32 pixels, their answers, and 3 to calibrate."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec

    folder = tmp_path_factory.mktemp("quiz") / "split"
    spec = SplitSpec(
        seed=2, train=0, labeled=0, val=3, test=24, height=32, width=32, min_cube_pixels=0
    )
    make_split(folder, spec, command="tests")
    return folder

"""Rooms for the metric tests, what hints say of some, and questions that people answered."""

from functools import cache

import h5py
import numpy as np
import pytest
from hypothesis import settings

from metrics.submissions.hints.tasks import room_hints
from metrics.submissions.reader import open_predictions
from scenegen.camera import pixel_directions
from scenegen.rooms.reader import RoomsFile

# The first example pays for imports and the machine may be busy.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")


@pytest.fixture(scope="session")
def room_depth(make_rooms, tmp_path_factory):
    """Planar depth (size, size) of a room, by seed and image size."""

    @cache
    def depth(seed, size):
        path = tmp_path_factory.mktemp("depth") / "room.h5"
        with RoomsFile(make_rooms(path, 1, height=size, width=size, seed=seed)) as rooms:
            return rooms.read("depth", 0).astype(np.float64)

    return depth


@pytest.fixture(scope="session")
def hint_truth(make_rooms, tmp_path_factory):
    """16 rooms, higher than wide, with more pixels than hints look at."""
    path = tmp_path_factory.mktemp("hints") / "rooms.h5"
    return make_rooms(path, 16, height=80, width=68, seed=11, min_visible_pixels=20)


@pytest.fixture(scope="session")
def room_arrays(hint_truth):
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
def hints(hint_truth, tmp_path):
    """What hints say to predictions, written without any check."""

    def told(depth, normal=None, rows=None, alignment="none", truth=hint_truth):
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
def quiz_split(tmp_path_factory):
    """Return a folder with 24 test questions of 32x32 pixels, their answers, and 3 to practise."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec

    folder = tmp_path_factory.mktemp("quiz") / "split"
    spec = SplitSpec(
        seed=2, train=0, labeled=0, val=3, test=24, height=32, width=32, min_cube_pixels=0
    )
    make_split(folder, spec, command="tests")
    return folder

"""The weights that come with the package see objects in rooms they were not trained on."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from baselines.relief import depth_supervised, view_pairs
from baselines.relief.predict import FILES
from metrics.measures.empty_room import empty_room
from scenegen.rooms.reader import RoomsFile


@pytest.fixture(scope="module")
def unseen_path(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("unseen") / "unseen.h5"
    size = {"height": 64, "width": 64, "min_visible_pixels": 12}
    return make_rooms(path, 6, **size, seed=77, views=(0.0, 80.0), lights=(1, 3))


def relief_iou(rooms_path: Path, submission: Path) -> np.ndarray:
    """Return the IoU of {relief > 0.05} with the true one, of each row, (N,)."""
    found = []
    with RoomsFile(rooms_path) as rooms, h5py.File(submission) as file:
        size = rooms.spec.height, rooms.spec.width
        for row in range(len(rooms)):
            pose = rooms.read("camera/world_from_camera", row)
            walls = empty_room(pose, float(rooms.read("camera/fov_y_degrees", row)), *size)[0]
            one, other = (
                walls - depth > 0.05 for depth in (rooms.read("depth", row), file["depth"][row])
            )
            found.append((one & other).sum() / (one | other).sum())
    return np.array(found)


def test_objects_are_seen_from_one_image(unseen_path, tmp_path):
    view_pairs.write_submission(unseen_path, tmp_path / "pairs.h5")
    assert relief_iou(unseen_path, tmp_path / "pairs.h5").mean() > 0.6
    depth_supervised.write_submission(unseen_path, tmp_path / "true.h5")
    assert relief_iou(unseen_path, tmp_path / "true.h5").mean() > 0.7


def test_objects_are_seen_through_the_code_from_80_degrees_away(unseen_path, tmp_path):
    weights = FILES / "depth-supervised-code.safetensors"
    depth_supervised.write_submission(unseen_path, tmp_path / "code.h5", weights)
    found = relief_iou(unseen_path, tmp_path / "code.h5").reshape(-1, 2)  # scenes, views
    assert found[:, 0].mean() > 0.25
    assert found[:, 1].mean() > 0.15

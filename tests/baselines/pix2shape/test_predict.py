"""Submissions of a model: from input images alone, nothing of the truth, and no half a file."""

from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch
from pix2shape_models import made, room_source, tiny, written
from torch.utils.data import default_collate

from baselines.pix2shape import predict
from baselines.pix2shape.network.empty_rooms import empty_rooms
from baselines.pix2shape.predict import enlarged, predict_file, views_of
from baselines.training.baseline import submit
from metrics.submissions.reader import open_predictions
from scenegen.camera import pixel_directions
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile

Fields = dict[str, np.ndarray]


@pytest.fixture(autouse=True)
def few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rooms take several batches, and 9 rows do not fill the last one."""
    monkeypatch.setattr(predict, "BATCH", 4)


def decoded(model: Any, path: Path, source: int, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Return depth and normals of one row's image, seen from another row's camera."""
    rooms = room_source(path, model.config)
    pair = rooms.as_batch(default_collate([rooms[source], rooms[row]]))
    with torch.no_grad():
        code = model.encode(pair.image, pair.views)[:1]
        depth, normal = enlarged(
            model.surfels(code, pair.views.condition[1:]).depth, rooms.spec.fov_y_degrees, 64
        )
    return depth[0].numpy(), normal[0].permute(1, 2, 0).numpy()


def written_by(model: Any, path: Path, out: Path) -> None:
    predict = partial(views_of, model, False, "")
    submit(path, out, "", 0, predict, overwrite=True)


def test_a_model_of_rays_is_another_method_and_says_what_it_is_told(several_path, tmp_path):
    model = made(tiny(64, rays=True))
    with torch.no_grad():
        model.decoder.last.bias.fill_(0.1)  # something stands out
    written_by(model, several_path, tmp_path / "p.h5")
    with open_predictions(tmp_path / "p.h5") as predictions:
        assert predictions.method == "pix2shape-rays"
    with h5py.File(tmp_path / "p.h5") as file, RoomsFile(several_path) as rooms:
        assert "ground and walls" in file.attrs["notes"]
        poses = torch.from_numpy(rooms.read("camera/world_from_camera", slice(None))).float()
        walls, _, _ = empty_rooms(poses, rooms.spec.fov_y_degrees, 64)
        depth = torch.from_numpy(file["depth"][()])
        assert (depth <= walls + 2e-3).all()
        assert (depth < walls - 0.02).any()


def predicted(model: Any, path: Path, out: Path) -> Fields:
    written_by(model, path, out)
    with h5py.File(out) as file:
        return {name: file[name][()] for name in ("row", "depth", "normal")}


def test_each_row_is_the_input_views_code_seen_from_the_rows_camera(model, several_path, tmp_path):
    found = predicted(model, several_path, tmp_path / "p.h5")
    with RoomsFile(several_path) as rooms:
        assert rooms.read("view_index", slice(None)).tolist() == [0, 1, 2] * 3
    for row in range(9):
        depth, normal = decoded(model, several_path, row - row % 3, row)
        np.testing.assert_allclose(found["depth"][row], depth, rtol=1e-4)
        np.testing.assert_allclose(found["normal"][row], normal, atol=1e-3)
    assert len({found["depth"][row].tobytes() for row in range(9)}) == 9


def plane(size: int, fov: float = 50.0) -> tuple[Any, np.ndarray]:
    """Return the depth of a slanted plane and its normal."""
    normal = np.array([0.3, 0.5, 0.81]) / np.linalg.norm([0.3, 0.5, 0.81])
    depth = -1.3 / (pixel_directions(size, size, fov) @ normal)
    assert depth.min() > 0
    return torch.tensor(depth, dtype=torch.float32)[None], normal


@pytest.mark.parametrize("size", [32, 64, 96, 256])
def test_planes_stay_planes_when_enlarged(size):
    depth, normal = enlarged(plane(32)[0], 50.0, size)
    expected, slant = plane(size)
    np.testing.assert_allclose(depth, expected, rtol=2e-6)
    np.testing.assert_allclose(normal[0].permute(1, 2, 0).numpy() - slant, 0, atol=1e-5)


@pytest.mark.parametrize(
    ("data", "settings", "words"),
    [
        ("rooms", {"classes": 2}, "a model that takes categories"),
        ("rooms", {"camera": False}, "a model that does not take it"),
        ("rooms", {"size": 64}, "images of 32x32"),
        ("iqtt", {}, "a model that takes the camera as input"),
        ("iqtt", {"size": 64, "camera": False}, "images of 32x32"),
    ],
)
def test_models_that_do_not_suit_are_refused(data, settings, words, truths, tmp_path):
    weights, data = written(tmp_path / "w.safetensors", tiny(**settings)), getattr(truths, data)
    with pytest.raises(SpecError) as error:
        predict_file(weights, data, tmp_path / "p.h5")
    assert error.value.found.startswith(words)
    assert not (tmp_path / "p.h5").exists()

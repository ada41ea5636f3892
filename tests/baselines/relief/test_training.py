"""Networks learn the relief they are shown: true depth where there is any, or matched views."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import torch
from h5_edits import put, values
from pix2shape_models import edited, in_memory
from refusals import refused
from safetensors.torch import load_file

from baselines.relief import depth_supervised, view_pairs
from baselines.relief.depth_completed import views_of_scenes
from baselines.relief.network import Settings
from baselines.relief.training import SLOPE, shape_loss
from baselines.training.baseline import train
from baselines.training.data import TrainingFiles
from scenegen.common.errors import FileFormatError, SpecError

SMALL = Settings(size=32, width=0.25, iterations=2, batch=4)
UNSEEN = (
    "depth", "normal", "object_id", "object/shape", "object/world_from_object", "object/scale",
    "object/visible_pixels", "object/count", "light/position", "light/color", "light/ambient",
    "light/attenuation", "material/reflectance",
)  # fmt: skip


def same(one, other):
    found, expected = load_file(one), load_file(other)
    return all(torch.equal(found[name], expected[name]) for name in expected)


def test_pixels_without_a_surface_teach_nothing(turned_path, tmp_path):
    def blank(file: h5py.File) -> None:
        depth = file["depth"][()]
        depth[:, :16] = np.nan
        file["depth"][...] = depth

    def trained(path, folder, settings):
        with TrainingFiles(path) as data:
            return train(depth_supervised.BASELINE, data, folder, settings)

    holes = edited(turned_path, tmp_path / "holes.h5", blank)
    found = trained(holes, tmp_path / "holes", SMALL)
    assert all(torch.isfinite(value).all() for value in load_file(found).values())
    assert not same(found, trained(turned_path, tmp_path / "whole", SMALL))
    empty = edited(turned_path, tmp_path / "empty.h5", values("depth", lambda d: d + np.nan))
    with refused(FileFormatError, "depth, row 0", "no surface"):
        trained(empty, tmp_path / "empty", SMALL)
    with refused(SpecError, "turned.h5", "images of 32x32"):
        trained(turned_path, tmp_path / "large", replace(SMALL, size=64))


def test_view_pairs_reads_nothing_but_images_and_cameras(near_path, tmp_path):
    edits = [values(name, np.zeros_like) for name in UNSEEN]
    edits.append(values("scene", lambda old: np.full_like(old, b"{}")))
    blank = edited(near_path, tmp_path / "blank.h5", *edits)
    expected = train(view_pairs.BASELINE, TrainingFiles(near_path), tmp_path / "one", SMALL)
    assert same(train(view_pairs.BASELINE, TrainingFiles(blank), tmp_path / "two", SMALL), expected)
    other = edited(near_path, tmp_path / "other.h5", put("image", 1, np.float16(0.5)))
    assert not same(
        train(view_pairs.BASELINE, TrainingFiles(other), tmp_path / "three", SMALL), expected
    )


def test_each_row_is_seen_from_the_cameras_of_its_own_scene(turned_path):
    rooms = in_memory(turned_path, 32)
    assert rooms.depth is None
    assert rooms.rounded
    found = [rows.tolist() for rows in views_of_scenes(rooms)]
    assert found == [[row - row % 3 + k for k in range(3)] for row in range(9)]
    mixed = replace(rooms, scene=torch.tensor([2, 0, 1, 0, 2, 2, 1, 0, 1]))
    assert views_of_scenes(mixed)[3].tolist() == [1, 3, 7]


INSIDE = torch.tensor([[[1, 1, 0, 2], [1, 1, 0, 2]], [[1, 1, 0, 0], [0, 0, 0, 0]]])


def test_a_shift_of_each_object_costs_nothing():
    """Object 1 of the second image is another one than that of the first."""
    errors = torch.tensor([[[3.0, 3, 9, 5], [3, 3, 7, 5]], [[-1, -1, 8, 2], [6, 4, 0, 0]]])
    assert float(shape_loss(errors, INSIDE)) == 0
    assert float(shape_loss(errors, torch.zeros_like(INSIDE))) == 0


def test_the_rest_and_the_slopes_are_counted():
    errors = torch.zeros(2, 2, 4)
    errors[0, 0, 0] = 4  # mean 1; two of the six pairs of neighbours differ by 4
    expected = (3 + 3 * 1) / 8 + SLOPE * 2 * 4 / 6
    assert float(shape_loss(errors, INSIDE)) == pytest.approx(expected)

"""A network learns what it is shown, goes on as if never stopped, refuses what does not suit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from pix2shape_models import edited

from scenegen.common.errors import FileFormatError, SceneGenError, SpecError

torch = pytest.importorskip("torch")
from baselines.checkpoints import CHECKPOINT, load_checkpoint, load_weights  # noqa: E402
from baselines.depth_supervised import training  # noqa: E402
from baselines.depth_supervised.card import Card, recipe  # noqa: E402
from baselines.depth_supervised.network import predicted_depth  # noqa: E402
from baselines.depth_supervised.training import (  # noqa: E402
    METHOD,
    learning_rate,
    train,
    views_of_scenes,
)
from baselines.pix2shape.data.in_memory import read_rooms  # noqa: E402
from baselines.pix2shape.network.empty_rooms import empty_rooms  # noqa: E402
from baselines.tensor_files import load_tensors  # noqa: E402

UNET = {"network": "unet", "size": 32, "width": 0.25}
CODE = {"network": "code", "size": 32, "width": 0.05}


def weights_of(path: Path) -> dict[str, Any]:
    return load_tensors(path)[0]


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(torch.equal(one[name], other[name]) for name in one)


def test_a_unet_learns_nine_images_by_heart(turned_path, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "WARM_UP", 10)
    losses = []
    told = {**UNET, "iterations": 80, "batch": 9, "learning_rate": 0.01}
    path = train(
        turned_path, tmp_path, **told, progress=lambda i, n, now: losses.append((i, n, now["loss"]))
    )
    assert losses[-1][:2] == (80, 80)
    state = load_weights(path, recipe(METHOD))
    network, card = state.network, state.card
    rooms = read_rooms(turned_path, 32, depth=True)
    cameras = rooms.cameras(torch.arange(len(rooms)))
    with torch.no_grad():
        depth = predicted_depth(network, rooms.image.float(), cameras, cameras)
    walls = empty_rooms(cameras.world_from_camera, cameras.fov_y_degrees, 32)[0]
    error, before = ((one - rooms.depth).abs().mean() for one in (depth, walls))
    assert error < before / 2, "the empty room is left far behind"
    assert (card.iteration, card.fingerprint) == (80, rooms.fingerprint)
    assert card.seconds > 0


@pytest.mark.parametrize("network", [UNET, CODE], ids=["unet", "code"])
def test_a_run_goes_on_as_if_it_had_never_stopped(network, turned_path, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "EVERY", 2)
    told = {**network, "iterations": 5, "batch": 4, "seed": 7}
    whole = train(turned_path, tmp_path / "whole", **told)

    def stop(done: int, total: int, losses: Any) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(turned_path, tmp_path / "cut", **told, progress=stop)
    assert load_checkpoint(tmp_path / "cut", recipe(METHOD)).card.iteration == 2
    steps: list[int] = []
    again = train(
        turned_path, tmp_path / "cut", resume=True, progress=lambda i, n, now: steps.append(i)
    )
    assert steps == [3, 4, 5]
    assert same(weights_of(again), weights_of(whole))
    other = train(turned_path, tmp_path / "other", **{**told, "seed": 8})
    assert not same(weights_of(other), weights_of(whole))


def test_a_new_run_leaves_an_old_one_alone(turned_path, tmp_path):
    told = {**UNET, "iterations": 1, "batch": 2}
    train(turned_path, tmp_path, **told)
    before = (tmp_path / CHECKPOINT).read_bytes()
    with pytest.raises(FileExistsError, match="--resume"):
        train(turned_path, tmp_path, **told)
    assert (tmp_path / CHECKPOINT).read_bytes() == before


def test_a_run_goes_on_with_its_own_rooms_only(turned_path, rooms_path, tmp_path):
    train(turned_path, tmp_path, **UNET, iterations=1, batch=2)
    with pytest.raises(SpecError, match="on which the run was trained"):
        train(rooms_path, tmp_path, resume=True)
    with pytest.raises(FileNotFoundError, match="no checkpoint"):
        train(turned_path, tmp_path / "none", resume=True)


def test_pixels_without_a_surface_teach_nothing(turned_path, tmp_path):
    def blank(file: h5py.File, value: float) -> None:
        depth = file["depth"][()]
        depth[:, :16] = value
        file["depth"][...] = depth

    told = {**UNET, "iterations": 2, "batch": 4}
    holes = edited(turned_path, tmp_path / "holes.h5", lambda file: blank(file, np.nan))
    found = weights_of(train(holes, tmp_path / "holes", **told))
    assert all(torch.isfinite(value).all() for value in found.values())
    assert not same(found, weights_of(train(turned_path, tmp_path / "whole", **told)))
    empty = edited(turned_path, tmp_path / "empty.h5", lambda file: file["depth"].write_direct(
        np.full(file["depth"].shape, np.nan, "f4")
    ))  # fmt: skip
    with pytest.raises(FileFormatError, match="no surface"):
        train(empty, tmp_path / "empty", **told)


def test_a_loss_that_is_not_finite_ends_the_run_and_keeps_the_checkpoint(turned_path, tmp_path):
    def spoil(file: h5py.File) -> None:
        file["depth"][...] = file["depth"][()] * np.float32(1e38)

    path = edited(turned_path, tmp_path / "huge.h5", spoil)
    with pytest.raises(SceneGenError, match="not finite"):
        train(path, tmp_path / "run", **UNET, iterations=3, batch=4)
    assert not (tmp_path / "run" / CHECKPOINT).exists()


def test_images_of_another_size_are_reduced_or_refused(turned_path, tmp_path):
    with pytest.raises(SpecError, match="images of 32x32"):
        train(turned_path, tmp_path, size=64)


def test_each_row_is_seen_from_the_cameras_of_its_own_scene(turned_path):
    rooms = read_rooms(turned_path, 32)
    assert rooms.depth is None
    assert rooms.rounded
    found = [rows.tolist() for rows in views_of_scenes(rooms)]
    assert found == [[row - row % 3 + k for k in range(3)] for row in range(9)]
    mixed = replace(rooms, scene=torch.tensor([2, 0, 1, 0, 2, 2, 1, 0, 1]))
    assert views_of_scenes(mixed)[3].tolist() == [1, 3, 7]


def test_the_learning_rate_rises_and_falls_to_nothing():
    card = Card(METHOD, iterations=1000, learning_rate=0.1)
    rates = [learning_rate(card, i) for i in range(1000)]
    assert 0 < rates[0] < 0.001
    assert 0.085 < max(rates) == rates[199] < 0.1
    assert rates[199:] == sorted(rates[199:], reverse=True)
    assert rates[-1] < 1e-5


@pytest.mark.parametrize(
    "wrong", [{"iterations": 0}, {"batch": 1}, {"learning_rate": -1.0}, {"seed": -1}]
)
def test_impossible_settings_are_refused(wrong, turned_path, tmp_path):
    with pytest.raises(SpecError, match=next(iter(wrong)).replace("_", " ")):
        train(turned_path, tmp_path / "run", **UNET, **wrong)
    assert not (tmp_path / "run").exists()

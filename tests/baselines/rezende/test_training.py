"""Training: a box is learned, nothing is differentiated through the renderer, runs go on."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from refusals import refused
from safetensors.torch import load_file

from baselines.checkpoints import CHECKPOINT, load_weights, new_state
from baselines.rezende import train, training
from baselines.rezende.card import RECIPE, Card
from baselines.rezende.reconstruct import errors, reconstruct, untrained
from baselines.rezende.training import near_vertices, pixel_errors, train_pictures, windows
from scenegen.common.errors import SpecError

TINY = Card(size=16, code=4, iterations=80, batch=8, pairs=4, learning_rate=0.003)
QUICK = {"size": 16, "code": 4, "iterations": 4, "batch": 4, "pairs": 1}


def test_one_view_of_a_box_is_learned(one_box, tmp_path):
    misfits = []
    state = train_pictures(
        one_box, tmp_path, TINY, progress=lambda done, total, told: misfits.append(told["misfit"])
    )
    assert np.mean(misfits[-5:]) < 0.4 * np.mean(misfits[:5])
    before = errors(untrained(one_box), one_box)
    after = errors(reconstruct(state.network, one_box), one_box)
    assert after["silhouette_iou"] > max(0.8, before["silhouette_iou"] + 0.1)
    assert after["radiance"] < 0.6 * before["radiance"]


def test_the_renderer_has_no_gradient_and_yet_the_networks_get_one(one_box, monkeypatch):
    state = new_state(RECIPE, replace(TINY, spread=1e6))
    offsets = torch.zeros(2, 8, 162, 3, requires_grad=True)
    squared = pixel_errors(state.network, offsets, one_box, np.arange(8))
    assert isinstance(squared, np.ndarray)  # no tensor, so nothing to differentiate
    around = windows(state.network, offsets[0], one_box)
    assert not torch.from_numpy(near_vertices(squared, around)).requires_grad
    given = {}

    def fixed(loss, mean, width, pairs, generator):
        loss(mean.detach().expand(2, *mean.shape))  # the pictures of a mesh have no say
        given["mean"] = mean
        return torch.ones_like(mean), torch.zeros(len(mean))

    monkeypatch.setattr(training, "sampled_gradient", fixed)
    training._step(state, one_box, 0)
    bias = state.network.decoder[-1].bias
    np.testing.assert_allclose(bias.grad, torch.ones_like(bias), rtol=1e-5)


def test_errors_are_summed_in_the_windows_of_vertices(one_box):
    model = new_state(RECIPE, TINY).network
    offsets = torch.zeros(8, 162, 3)
    around = windows(model, offsets, one_box)
    squared = np.random.default_rng(0).random((2, 8, 16, 16), np.float32)
    found = near_vertices(squared, around)
    for item, vertex in ((0, 0), (3, 100), (7, 161)):
        top, bottom, left, right = (edge[item, vertex] for edge in around)
        wanted = squared[:, item, top:bottom, left:right].sum(axis=(1, 2))
        np.testing.assert_allclose(found[:, item, vertex], wanted, rtol=1e-4)
        assert bottom - top in (0, 5, 6) or min(top, 16 - bottom) == 0


def test_the_far_side_is_charged_with_nothing_and_the_middle_keeps_its_depth(one_box):
    model = new_state(RECIPE, TINY).network
    offsets = torch.zeros(8, 162, 3)
    sums = near_vertices(np.ones((1, 8, 16, 16), np.float32), windows(model, offsets, one_box))
    height = model.sphere[:, 2].numpy()
    assert (sums[0][:, height < -0.4] == 0).all()
    assert (sums[0][:, height > 0.4] > 8).all()
    offsets[:, :, 2] = torch.randn(8, 162) + 3
    moved = model.vertices(offsets)
    torch.testing.assert_close(moved[:, :, 2].mean(dim=1), torch.zeros(8), rtol=0, atol=1e-5)
    torch.testing.assert_close(moved[:, :, :2], model.sphere[:, :2].expand(8, -1, -1))


def test_what_moves_one_vertex_changes_errors_in_its_window_alone(one_box):
    state = new_state(RECIPE, TINY)
    state.network.smooth = torch.eye(162)
    offsets = torch.zeros(2, 8, 162, 3)
    vertex = int(state.network.sphere[:, 2].argmax())  # it faces the camera
    offsets[1, :, vertex] = torch.tensor([0.08, -0.1, 0.0])
    squared = pixel_errors(state.network, offsets, one_box, np.arange(8))
    changed = squared[0] != squared[1]
    around = windows(state.network, offsets[0], one_box)
    top, bottom, left, right = (edge[:, vertex] for edge in around)
    assert (top + bottom == 16).all()  # the vertex lies on the camera's axis
    assert (left + right == 16).all()
    near = near_vertices(changed[None].astype(np.float32), around)
    assert (changed.sum(axis=(1, 2)) > 3).all()
    np.testing.assert_allclose(near[0, :, vertex], changed.sum(axis=(1, 2)), rtol=0.4)


def test_a_run_that_was_stopped_ends_with_the_same_bits(one_box, tmp_path, monkeypatch):
    card = replace(TINY, iterations=5)
    whole = train_pictures(one_box, tmp_path / "whole", card)
    monkeypatch.setattr(training, "EVERY", 2)

    def stop(done, total, numbers):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_pictures(one_box, tmp_path / "parts", card, progress=stop)
    with pytest.raises(FileExistsError):
        train_pictures(one_box, tmp_path / "parts", card)
    parts = train_pictures(one_box, tmp_path / "parts", card, resume=True)
    assert parts.card.iteration == 5
    for name, value in whole.network.state_dict().items():
        assert torch.equal(value, parts.network.state_dict()[name]), name
    ends = [load_file(tmp_path / run / CHECKPOINT) for run in ("whole", "parts")]
    assert all(torch.equal(value, ends[1][name]) for name, value in ends[0].items())
    with refused(SpecError, "data", "other"):
        train_pictures(replace(one_box, fingerprint="other"), tmp_path / "parts", card, resume=True)


def test_questions_are_trained_on_and_labels_change_the_head_alone(split, tmp_path):
    data, told = split / "iqtt-train.h5", []
    first = train(
        data, tmp_path / "a", **QUICK, progress=lambda done, total, n: told.append((done, total))
    )
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    second = train(data, tmp_path / "b", labels=4, start=first)
    (model, card), (other, labelled) = (
        (state.network, state.card)
        for state in (load_weights(first, RECIPE), load_weights(second, RECIPE))
    )
    assert (card.labels, labelled.labels) == (0, 4)
    assert (card.iteration, labelled.iteration) == (4, 4)
    for name, value in model.state_dict().items():
        if not name.startswith("head."):
            assert torch.equal(value, other.state_dict()[name]), name
    assert not torch.equal(model.head.shift, other.head.shift)
    direct = train(data, tmp_path / "c", labels=4, **QUICK)
    assert direct.read_bytes() != first.read_bytes()
    again = train(data, tmp_path / "c", resume=True)
    assert load_weights(again, RECIPE).card.labels == 4
    with pytest.raises(FileExistsError):
        train(data, tmp_path / "c", start=first)


@pytest.mark.parametrize(
    ("settings", "where"),
    [
        ({"labels": 5}, "labels"),
        ({"size": 20}, "size"),
        ({"pairs": 0}, "pairs"),
        ({"width": float("inf")}, "width"),
        ({"batch": "many"}, "batch"),
        ({"start": 5}, "start"),
        ({"start": "x.safetensors", "resume": True}, "start"),
    ],
    ids=["labels", "size", "pairs", "width", "batch", "start", "start-and-resume"],
)
def test_settings_that_do_not_fit_are_refused_before_anything_is_written(
    split, tmp_path, settings, where
):
    with pytest.raises(SpecError) as caught:
        train(split / "iqtt-train.h5", tmp_path / "run", **{**QUICK, **settings})
    assert where in caught.value.where
    assert not (tmp_path / "run").exists()

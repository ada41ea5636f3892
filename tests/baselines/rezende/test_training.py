"""Training: a box is learned, nothing is differentiated through the renderer, runs go on."""

from dataclasses import replace

import numpy as np
import torch

from baselines.rezende import training
from baselines.rezende.answers import meshes_of
from baselines.rezende.network import METHOD, Card, Settings
from baselines.rezende.rasteriser import rasterise
from baselines.rezende.training import (
    LARGEST_SLOPE,
    bound,
    loss_of,
    near_vertices,
    pixel_errors,
    windows,
)
from baselines.training.checkpoint import new_state
from baselines.training.fit import falling_late, fit
from baselines.training.machine import Machine

TINY = Settings(size=16, code=4, iterations=80, batch=8, pairs=4, learning_rate=0.003)


def state_of(settings=TINY):
    return new_state(METHOD, Card("rezende", settings))


def silhouette_iou(state, pictures, shown):
    vertices = pictures.radius * meshes_of(state.network, pictures.image)
    depth = rasterise(vertices, state.network.faces, pictures.views)[1][0]
    seen = np.isfinite(depth)
    return (seen & shown).sum() / (seen | shown).sum()


def test_one_view_of_a_box_is_learned(one_box, tmp_path):
    pictures, shown = one_box
    misfits, state = [], state_of()
    before = silhouette_iou(state, pictures, shown)

    def losses(number):
        yield loss_of(state, pictures, number)

    fit(
        tmp_path, METHOD, state, losses, falling_late, Machine(), clip=LARGEST_SLOPE,
        progress=lambda *now: misfits.append(now[2]["misfit"]),
    )  # fmt: skip
    assert np.mean(misfits[-5:]) < 0.4 * np.mean(misfits[:5])
    assert silhouette_iou(state, pictures, shown) > max(0.8, before + 0.1)


def test_the_renderer_has_no_gradient_and_yet_the_networks_get_one(one_box, monkeypatch):
    pictures, _ = one_box
    settings = replace(TINY, spread=1e6)
    state = state_of(settings)
    offsets = torch.zeros(2, 8, 162, 3, requires_grad=True)
    squared = pixel_errors(state.network, offsets, pictures, np.arange(8))
    assert isinstance(squared, np.ndarray)  # no tensor, so nothing to differentiate
    around = windows(state.network, offsets[0], pictures)
    assert not torch.from_numpy(near_vertices(squared, around)).requires_grad
    given = {}

    def fixed(loss, mean, width, pairs, generator):
        loss(mean.detach().expand(2, *mean.shape))  # the pictures of a mesh have no say
        given["mean"] = mean
        return torch.ones_like(mean)

    monkeypatch.setattr(training, "sampled_gradient", fixed)
    torch.autograd.backward(bound(state.network, pictures, settings, 0).total)
    bias = state.network.decoder[-1].bias
    np.testing.assert_allclose(bias.grad, torch.ones_like(bias), rtol=1e-5)


def test_errors_are_summed_in_the_windows_of_vertices(one_box):
    pictures, _ = one_box
    model = state_of().network
    offsets = torch.zeros(8, 162, 3)
    around = windows(model, offsets, pictures)
    squared = np.random.default_rng(0).random((2, 8, 16, 16), np.float32)
    found = near_vertices(squared, around)
    for item, vertex in ((0, 0), (3, 100), (7, 161)):
        top, bottom, left, right = (edge[item, vertex] for edge in around)
        wanted = squared[:, item, top:bottom, left:right].sum(axis=(1, 2))
        np.testing.assert_allclose(found[:, item, vertex], wanted, rtol=1e-4)
        assert bottom - top in (0, 5, 6) or min(top, 16 - bottom) == 0

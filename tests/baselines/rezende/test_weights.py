"""Files of weights and checkpoints, also damaged and hostile ones."""

import json
from dataclasses import replace

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from baselines.rezende.weights import (
    CHECKPOINT,
    Card,
    load_state,
    load_weights,
    new_state,
    save_state,
    save_weights,
)
from scenegen.common.errors import FileFormatError

CARD = Card(size=16, code=4, seed=3)


@pytest.fixture
def weights(tmp_path):
    path = tmp_path / "weights.safetensors"
    save_weights(path, new_state(CARD).model, replace(CARD, labels=7))
    return path


def changed(path, edit=lambda tensors: None, **card):
    """Write the file again, with other tensors or another card."""
    tensors = load_file(path)
    edit(tensors)
    with safe_open(path, "pt") as file:
        notes = file.metadata()
    notes["card"] = json.dumps({**json.loads(notes["card"]), **card})
    save_file(tensors, path, notes)


def test_weights_come_back_in_half_precision(weights):
    model, card = load_weights(weights)
    assert card == replace(CARD, labels=7)
    assert not model.training
    for name, value in new_state(CARD).model.state_dict().items():
        torch.testing.assert_close(model.state_dict()[name], value, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize(
    ("edit", "card"),
    [
        (lambda t: t.pop("decoder.0.weight"), {}),
        (lambda t: t.update(extra=torch.zeros(1)), {}),
        (lambda t: t["encoder.0.bias"].fill_(torch.nan), {}),
        (lambda t: None, {"code": 5}),
        (lambda t: None, {"code": 10**9}),
        (lambda t: None, {"size": 10**6}),
        (lambda t: None, {"format_version": 2}),
        (lambda t: None, {"colour": "red"}),
        (lambda t: None, {"iteration": 10**7}),
        (lambda t: None, {"seed": -1}),
    ],
    ids=[
        "missing", "extra", "nan", "other-code", "huge-code", "huge-size", "version", "unknown",
        "beyond-its-end", "negative-seed",
    ],
)  # fmt: skip
def test_hostile_weights_are_refused(weights, edit, card):
    changed(weights, edit, **card)
    with pytest.raises(FileFormatError):
        load_weights(weights)


@pytest.mark.parametrize("content", [b"", b"no tensors", b"\xff" * 64], ids=["empty", "text", "ff"])
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "x.safetensors"
    path.write_bytes(content)
    with pytest.raises(FileFormatError):
        load_weights(path)


@pytest.mark.parametrize(
    "edit",
    [
        lambda t: t.update(strange=torch.zeros(1)),
        lambda t: t.update({"moments.0.exp_avg": torch.zeros(2)}),
        lambda t: t.update({"moments.999.exp_avg": torch.zeros(2)}),
        lambda t: t.update({"moments.first.exp_avg": torch.zeros(2)}),
    ],
    ids=["strange", "shape", "number", "name"],
)
def test_checkpoints_come_back_and_damaged_ones_are_refused(tmp_path, edit):
    state = new_state(CARD)
    for parameter in state.optimiser.param_groups[0]["params"]:
        parameter.grad = torch.ones_like(parameter)
    state.optimiser.step()
    save_state(tmp_path, state)
    again = load_state(tmp_path)
    assert again.card == CARD
    moment = again.optimiser.state_dict()["state"][0]["exp_avg"]
    torch.testing.assert_close(moment, torch.full_like(moment, 0.1))
    with pytest.raises(FileFormatError):
        load_weights(tmp_path / CHECKPOINT)
    changed(tmp_path / CHECKPOINT, edit)
    with pytest.raises(FileFormatError):
        load_state(tmp_path)


def test_a_folder_without_a_checkpoint_is_told(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_state(tmp_path)

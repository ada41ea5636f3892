"""Files of weights and checkpoints: what is read back, and what damaged ones are told."""

import json
import shutil
from dataclasses import replace

import pytest

from scenegen.common.errors import FileFormatError, SpecError

torch = pytest.importorskip("torch")
from baselines.cnn.network import METHOD  # noqa: E402
from baselines.resnet.methods import (  # noqa: E402
    CHECKPOINT,
    WEIGHTS,
    Card,
    load_state,
    load_weights,
    new_state,
    save_state,
)
from baselines.tensor_files import load_tensors, save_tensors  # noqa: E402

CARD = Card("cnn", 3, 1, width=4, size=16)


def test_a_checkpoint_holds_all_of_a_state(run_folders, tmp_path):
    state = load_state(run_folders["cnn"], METHOD)
    save_state(tmp_path, state)
    again = load_state(tmp_path, METHOD)
    assert again.card == state.card
    one, two = (load_tensors(folder / CHECKPOINT)[0] for folder in (run_folders["cnn"], tmp_path))
    assert one.keys() == two.keys()
    assert all(torch.equal(one[name], two[name]) for name in one)
    moments = again.optimiser.state_dict()["state"]
    assert all(float(own["step"]) == 3 for own in moments.values())


def test_the_seed_decides_the_weights():
    one, two, three = (new_state(METHOD, replace(CARD, seed=seed)) for seed in (0, 0, 1))
    first, same, other = (s.network.state_dict()["head.0.weight"] for s in (one, two, three))
    assert torch.equal(first, same)
    assert not torch.equal(first, other)


def changed_card(**what):
    def change(tensors, notes):
        notes["card"] = json.dumps({**json.loads(notes["card"]), **what})

    return change


def without(name):
    return lambda tensors, notes: tensors.pop(name)


def renamed(old, new):
    def change(tensors, notes):
        tensors[new] = tensors.pop(old)

    return change


def not_finite(name):
    return lambda tensors, notes: tensors[name].fill_(torch.nan)


DAMAGED = {
    "no card": lambda tensors, notes: notes.pop("card"),
    "another width": changed_card(width=8),
    "a hostile width": changed_card(width=10**9),
    "two answers": changed_card(answers=2),
    "unknown setting": changed_card(colour=1),
    "another method": changed_card(method="siamese"),
    "no weight": without("network.head.0.weight"),
    "no moment": without("moments.3.exp_avg"),
    "no moments of one": renamed("moments.3.exp_avg", "moments.999.exp_avg"),
    "a moment before the first": renamed("moments.3.exp_avg", "moments.-1.exp_avg"),
    "strange": renamed("moments.3.exp_avg", "colour.3"),
    "NaN in weights": not_finite("network.head.0.weight"),
    "NaN in moments": not_finite("moments.3.exp_avg_sq"),
    "no count": lambda tensors, notes: notes.update(moments="many"),
}


@pytest.mark.parametrize("damage", DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_checkpoint_is_told(damage, run_folders, tmp_path):
    tensors, notes = load_tensors(run_folders["cnn"] / CHECKPOINT)
    damage(tensors, notes)
    save_tensors(tmp_path / CHECKPOINT, tensors, notes)
    with pytest.raises(FileFormatError) as error:
        load_state(tmp_path, METHOD)
    assert CHECKPOINT in error.value.where


def test_a_cut_file_and_no_file_are_told(run_folders, tmp_path):
    with pytest.raises(FileNotFoundError):
        load_state(tmp_path, METHOD)
    shutil.copy(run_folders["cnn"] / WEIGHTS, tmp_path / WEIGHTS)
    data = (tmp_path / WEIGHTS).read_bytes()
    (tmp_path / WEIGHTS).write_bytes(data[: len(data) // 2])
    with pytest.raises(FileFormatError):
        load_weights(tmp_path / WEIGHTS, METHOD)


@pytest.mark.parametrize(
    ("name", "value"),
    [("depth", 34), ("width", 2), ("answers", 1), ("iteration", 801), ("learning_rate", 0.0)],
)
def test_settings_out_of_range(name, value):
    with pytest.raises(SpecError) as error:
        replace(CARD, **{name: value})
    assert error.value.where.replace(" ", "_") == name

"""Settings are within limits, and weights of another method or size are refused."""

import json
from dataclasses import replace

import pytest
from refusals import refused

from scenegen.common.errors import FileFormatError, SpecError

pytest.importorskip("torch")
from baselines.checkpoints import WEIGHTS, load_weights
from baselines.cnn.network import METHOD
from baselines.resnet.methods import Card
from baselines.tensor_files import load_tensors, save_tensors


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"width": 8}, ""),
        ({"width": 10**9}, "width"),
        ({"answers": 2}, ""),
        ({"method": "siamese"}, "method"),
    ],
    ids=str,
)
def test_cards_of_other_networks_are_refused(changed, where, run_folders, tmp_path):
    tensors, notes = load_tensors(run_folders["cnn"] / WEIGHTS)
    card = {**json.loads(notes["card"]), **changed}
    save_tensors(tmp_path / WEIGHTS, tensors, {"card": json.dumps(card)})
    with refused(FileFormatError, where):
        load_weights(tmp_path / WEIGHTS, METHOD.recipe)


@pytest.mark.parametrize(
    ("name", "value"),
    [("depth", 34), ("width", 2), ("answers", 1), ("iteration", 401), ("learning_rate", 0.0)],
)
def test_settings_out_of_range(name, value):
    with pytest.raises(SpecError) as error:
        replace(Card("cnn", 3, 1, width=4, size=16), **{name: value})
    assert error.value.where.replace(" ", "_") == name

"""Cards are within limits, and tell the methods apart whose networks are the same."""

import json

import pytest
from refusals import refused

from scenegen.common.errors import FileFormatError

pytest.importorskip("torch")
from baselines.checkpoints import WEIGHTS, load_weights, new_state, save_weights
from baselines.depth_supervised.card import METHODS, Card, recipe
from baselines.depth_supervised.network import ReliefSpec
from baselines.tensor_files import load_tensors, save_tensors

OURS, OTHERS = METHODS
CARD = Card(OURS, ReliefSpec("unet", 32, 0.1), iterations=3)


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"method": "mine"}, "method"),
        ({"method": OTHERS}, "method"),
        ({"format_version": 9}, "format version"),
        ({"iteration": 4}, "iteration"),
        ({"network": {"kind": "unet", "size": 10**9, "width": 0.1}}, "size"),
        ({"network": {"kind": "unet", "size": 32, "width": 4.0}}, ""),
        ({"network": {"kind": "code", "size": 32, "width": 0.1}}, ""),
    ],
    ids=str,
)
def test_cards_of_others_and_hostile_ones_are_refused(changed, where, tmp_path):
    path = tmp_path / WEIGHTS
    save_weights(path, new_state(recipe(OURS), CARD))
    assert load_weights(path, recipe(OURS)).card == CARD
    tensors, notes = load_tensors(path)
    save_tensors(path, tensors, {"card": json.dumps({**json.loads(notes["card"]), **changed})})
    with refused(FileFormatError, where):
        load_weights(path, recipe(OURS))

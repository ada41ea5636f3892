"""Cards are within limits, weights of other sizes than the card's are refused."""

import json

import pytest
import torch

from baselines.checkpoints import WEIGHTS, load_weights, new_state, save_weights
from baselines.rezende.answers import WEIGHTS as BUNDLED
from baselines.rezende.card import RECIPE, Card
from baselines.tensor_files import load_tensors, save_tensors
from scenegen.common.errors import FileFormatError


@pytest.mark.parametrize(
    "changed",
    [
        {"code": 5}, {"code": 10**9}, {"size": 10**6}, {"format_version": 2}, {"colour": "red"},
        {"iteration": 10**7}, {"seed": -1},
    ],
    ids=str,
)  # fmt: skip
def test_hostile_cards_are_refused(changed, tmp_path):
    path = tmp_path / WEIGHTS
    save_weights(path, new_state(RECIPE, Card(size=16, code=4)))
    tensors, notes = load_tensors(path)
    save_tensors(path, tensors, {"card": json.dumps({**json.loads(notes["card"]), **changed})})
    with pytest.raises(FileFormatError):
        load_weights(path, RECIPE)


def test_the_head_has_an_optimiser_of_its_own():
    state = new_state(RECIPE, Card(size=16, code=4))
    learned = {id(weights) for weights in state.optimiser.param_groups[0]["params"]}
    named = state.network.named_parameters()
    left = {name.partition(".")[0] for name, weights in named if id(weights) not in learned}
    assert left == {"head"}


def test_bundled_weights_were_trained_without_labels():
    state = load_weights(BUNDLED, RECIPE)
    assert (state.card.labels, state.card.iteration) == (0, state.card.iterations)
    image = torch.rand(2, 3, state.card.size, state.card.size)
    mean, _ = state.network.encode(image)
    assert (mean[0] != mean[1]).any()

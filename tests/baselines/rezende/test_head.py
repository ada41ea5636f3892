"""The head learns from labels which code belongs to the reference's."""

import numpy as np
import torch

from baselines.checkpoints import new_state
from baselines.rezende.card import RECIPE, Card
from baselines.rezende.head import codes_of, train_head


def asked(count, seed):
    """Return questions whose right answer is the reference's image with other noise."""
    rng = np.random.default_rng(seed)
    coarse = rng.random((count, 4, 4, 4, 3))
    right = rng.integers(3, size=count)
    coarse[np.arange(count), 1 + right] = coarse[:, 0]
    images = coarse.repeat(4, axis=2).repeat(4, axis=3) + 0.02 * rng.random((count, 4, 16, 16, 3))
    return images.astype(np.float32).clip(0, 1), right


def test_questions_that_codes_can_answer_are_learned_and_the_encoder_stays():
    model = new_state(RECIPE, Card(size=16, code=16)).network
    before = {k: v.clone() for k, v in model.state_dict().items() if not k.startswith("head")}
    questions = asked(100, 0)
    losses = train_head(model, *questions, 16, 0)
    codes = (codes_of(model, questions[0], 16).flatten(0, 1) - model.head.shift) / model.head.scale
    torch.testing.assert_close(codes.std(dim=0, correction=0), torch.ones(16), rtol=1e-3, atol=0)
    torch.testing.assert_close(codes.mean(dim=0), torch.zeros(16), rtol=0, atol=1e-3)
    assert losses[-1] < 0.5 * losses[0]
    images, right = asked(200, 1)
    with torch.no_grad():
        found = model.head(codes_of(model, images, 16)).argmax(dim=1).numpy()
    assert (found == right).mean() > 0.6
    assert all(torch.equal(model.state_dict()[k], v) for k, v in before.items())


def test_the_seed_decides_the_head():
    questions = asked(20, 2)
    models = [new_state(RECIPE, Card(size=16, code=4)).network for _ in range(3)]
    for model, seed in zip(models, (0, 0, 1)):
        train_head(model, *questions, 16, seed)
    heads = [model.head.layers[0].weight for model in models]
    assert torch.equal(heads[0], heads[1])
    assert not torch.equal(heads[0], heads[2])


def test_answers_are_scored_alike_wherever_they_stand():
    model = new_state(RECIPE, Card(size=16, code=4)).network
    images, _ = asked(5, 3)
    order = [0, 3, 1, 2]
    with torch.no_grad():
        scores = model.head(codes_of(model, images, 16))
        moved = model.head(codes_of(model, images[:, order], 16))
    torch.testing.assert_close(scores[:, [2, 0, 1]], moved)
    two = model.head(codes_of(model, images[:, :3], 16))
    torch.testing.assert_close(two, scores[:, :2])

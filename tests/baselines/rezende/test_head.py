"""The head learns from labels which code belongs to the reference's."""

import numpy as np
import torch

from baselines.rezende.network import METHOD, Card, Settings, codes_of
from baselines.rezende.training import train_head
from baselines.training.checkpoint import new_state


def model_of(code):
    return new_state(METHOD, Card("rezende", Settings(size=16, code=code))).network


def codes(model, images):
    """Return the codes of questions, (Q, 1 + A, code)."""
    return torch.cat([codes_of(model, question[None]) for question in images])


def asked(count, seed):
    """Return questions whose right answer is the reference's image with other noise.

    Images are (Q, 1 + A, 3, S, S).
    """
    rng = np.random.default_rng(seed)
    coarse = rng.random((count, 4, 3, 4, 4))
    right = rng.integers(3, size=count)
    coarse[np.arange(count), 1 + right] = coarse[:, 0]
    images = coarse.repeat(4, axis=3).repeat(4, axis=4) + 0.02 * rng.random((count, 4, 3, 16, 16))
    return torch.from_numpy(images.astype(np.float32).clip(0, 1)), torch.from_numpy(right)


def test_questions_that_codes_can_answer_are_learned_and_the_encoder_stays():
    model = model_of(16)
    before = {k: v.clone() for k, v in model.state_dict().items() if not k.startswith("head")}
    images, right = asked(100, 0)
    losses = train_head(model, codes(model, images), right, 0)
    flat = (codes(model, images).flatten(0, 1) - model.head.shift) / model.head.scale
    torch.testing.assert_close(flat.std(dim=0, correction=0), torch.ones(16), rtol=1e-3, atol=0)
    torch.testing.assert_close(flat.mean(dim=0), torch.zeros(16), rtol=0, atol=1e-3)
    assert losses[-1] < 0.5 * losses[0]
    images, right = asked(200, 1)
    with torch.no_grad():
        found = model.head(codes(model, images)).argmax(dim=1)
    assert (found == right).float().mean() > 0.6
    assert all(torch.equal(model.state_dict()[k], v) for k, v in before.items())

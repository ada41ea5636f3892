"""The head that answers questions by codes: trained on labels, the encoder stays as it is."""

import torch
from torch import Tensor
from torch.nn import functional
from torch.optim import AdamW

from baselines.rezende.network import Head, Model
from scenegen.common.random.seeding import Purpose, item_seed

STEPS, LEARNING_RATE, WEIGHT_DECAY = 300, 0.002, 0.3


@torch.no_grad()
def codes_of(model: Model, images: Tensor) -> Tensor:
    """Return the codes' means, (1, 1 + A, code), of the images of one question."""
    return model.encode(images.flatten(0, 1))[0][None]


def train_head(model: Model, codes: Tensor, right: Tensor, seed: int) -> list[float]:
    """Train the model's head on labelled questions, all in each step; return the losses.

    Args:
        codes: of the questions, (Q, 1 + A, code).
        right: which answer is right, (Q,).
    """
    flat = codes.flatten(0, 1)
    losses = []
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(seed, 1, Purpose.WEIGHTS))
        model.head = head = Head(codes.shape[2])
    head.shift.copy_(flat.mean(dim=0))
    head.scale.copy_(flat.std(dim=0, correction=0).clamp(min=1e-4))
    optimiser = AdamW(head.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    for _ in range(STEPS):
        loss = functional.cross_entropy(head(codes), right)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        losses.append(float(loss.detach()))
    return losses

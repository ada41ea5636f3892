"""The head that answers questions by codes: trained on labels, the encoder stays as it is."""

from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional
from torch.optim import AdamW

from baselines.rezende.images import question_images
from baselines.rezende.network import Head, Model
from scenegen.common.random.seeding import Purpose, item_seed

STEPS, LEARNING_RATE, WEIGHT_DECAY = 300, 0.002, 0.3


@torch.no_grad()
def codes_of(model: Model, images: NDArray[Any], size: int) -> Tensor:
    """Return the codes' means, (Q, 1 + A, code), of questions as stored, (Q, 1 + A, H, W, 3)."""
    found = []
    for stored in images:
        four = torch.stack([torch.from_numpy(one) for one in question_images(stored, size)])
        found.append(model.encode(four)[0])
    return torch.stack(found)


def train_head(
    model: Model, images: NDArray[Any], right: NDArray[Any], size: int, seed: int
) -> list[float]:
    """Train the model's head on labelled questions, all in each step; return the losses.

    Args:
        images: as stored, (Q, 1 + A, H, W, 3).
        right: which answer is right, (Q,).
    """
    codes = codes_of(model, images, size)
    target = torch.from_numpy(right.astype("int64"))
    flat = codes.flatten(0, 1)
    losses = []
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(seed, 1, Purpose.WEIGHTS))
        model.head = head = Head(codes.shape[2])
    head.shift.copy_(flat.mean(dim=0))
    head.scale.copy_(flat.std(dim=0, correction=0).clamp(min=1e-4))
    optimiser = AdamW(head.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    for _ in range(STEPS):
        loss = functional.cross_entropy(head(codes), target)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        losses.append(float(loss.detach()))
    return losses

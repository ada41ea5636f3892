"""The training loop of every baseline.

Everything random in an iteration derives from the seed and the iteration's number, so that training
goes on after a kill as if it had never stopped. Where several processes train, each computes the
losses of its share of every batch, and all learn what one process would, up to rounding.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.optim import Adam

from baselines.training.checkpoint import (
    WEIGHTS,
    CardT,
    Method,
    NetworkT,
    State,
    save_checkpoint,
    save_weights,
)
from baselines.training.processes import average, is_first
from scenegen.common.errors import SceneGenError

Progress = Callable[[int, int, Mapping[str, float]], Any]  # iterations done, in all, losses
DIVERGED = "begin again with a smaller learning rate or other weights of the losses"


class TrainingError(SceneGenError):
    """Training cannot go on, as a loss, a gradient or a weight is not finite."""


@dataclass(frozen=True, eq=False)
class Loss:
    """What one step of an optimiser minimises, and the numbers to report, by name."""

    total: Tensor
    numbers: Mapping[str, Tensor]
    optimiser: str = "adam"


def fit(
    folder: Path,
    method: Method[CardT, NetworkT],
    state: State[CardT, NetworkT],
    losses: Callable[[int], Iterator[Loss]],
    rate: Callable[[Any, int], float],
    *,
    every: int,
    clip: float | None = None,
    prepare: Callable[[], Any] = lambda: None,
    progress: Progress = lambda done, total, losses: None,
) -> None:
    """Train from the state's iteration to its last one; this changes the state.

    Args:
        folder: gets checkpoint and weights, from the first of several processes.
        losses: yields the losses of an iteration, by its number. After each a step is taken, so
            that what is computed next sees the new weights.
        rate: the learning rate of a card's settings in an iteration.
        every: iterations between checkpoints.
        clip: largest norm of the gradients of a step; None for any.
        prepare: called before a checkpoint is written.
        progress: called after each iteration, by the first process alone.

    Raises:
        TrainingError: a loss, a gradient or a weight is not finite. The files are those of the last
            checkpoint.
        LostProcessError: another process that trains with this one ended.
        OSError.
    """
    settings, last = state.card.settings, state.card.settings.iterations
    before, started = state.card.seconds, time.monotonic()

    def save() -> None:
        _require_finite(state)
        prepare()
        _require_finite(state)
        save_checkpoint(folder, state)
        save_weights(folder / WEIGHTS, method, state.network, state.card)

    if state.card.iteration == last and is_first():
        save()  # the run may have ended between its last checkpoint and its weights
    state.network.train()
    for number in range(state.card.iteration, last):
        numbers: dict[str, float] = {}
        for optimiser in state.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = rate(settings, number)
        for loss in losses(number):
            _step(state.optimisers[loss.optimiser], loss, clip, f"iteration {number}", numbers)
        done, seconds = number + 1, round(before + time.monotonic() - started, 1)
        state.card = replace(state.card, iteration=done, seconds=seconds)
        if is_first():
            if done % every == 0 or done == last:
                save()
            progress(done, last, numbers)


def falling_late(settings: Any, iteration: int) -> float:
    """Return a learning rate that falls linearly to 0 over the second half of training."""
    left = 1 - iteration / settings.iterations
    return float(settings.learning_rate * min(1.0, 2 * left))


def _step(
    optimiser: Adam, loss: Loss, clip: float | None, where: str, numbers: dict[str, float]
) -> None:
    """Take one step, unless the loss or a gradient is not finite; add to the reported numbers."""
    optimiser.zero_grad()
    values = torch.stack([loss.total.detach(), *(n.detach() for n in loss.numbers.values())])
    average([values])
    numbers |= dict(zip(loss.numbers, values[1:].tolist(), strict=True))
    shown = ", ".join(f"{name} {value:.3g}" for name, value in numbers.items())
    problem = f"a loss or gradient that is not finite ({shown})"
    if not values[0].isfinite():  # torch's slopes of such a loss can crash
        raise TrainingError(where, problem, hint=DIVERGED)
    torch.autograd.backward(loss.total)
    parameters = optimiser.param_groups[0]["params"]
    gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
    average(gradients)  # DDP allows neither several backward passes nor second gradients
    norm = torch.nn.utils.get_total_norm(gradients)
    if not norm.isfinite():
        raise TrainingError(where, problem, hint=DIVERGED)
    if clip is not None:
        torch.nn.utils.clip_grads_with_norm_(parameters, clip, norm)
    optimiser.step()


def _require_finite(state: State[Any, Any]) -> None:
    """Raise TrainingError where a weight, a statistic or a moment is not finite.

    The losses of an iteration are those before its step, which may have been the one too far.
    """
    tensors = list(state.network.state_dict().values())
    for optimiser in state.optimisers.values():
        tensors += [value for moments in optimiser.state.values() for value in moments.values()]
    if not all(bool(value.isfinite().all()) for value in tensors):
        problem = "weights that are not finite after the last step"
        raise TrainingError(f"iteration {state.card.iteration}", problem, hint=DIVERGED)

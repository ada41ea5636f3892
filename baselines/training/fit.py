"""The training loop of every baseline.

Everything random in an iteration derives from the seed and the iteration's number, so that training
goes on after a kill as if it had never stopped.

A GPU works on while the next steps are prepared. Asking for a number would wait for it, so losses
are fetched once in a while, and looked at then.
"""

import math
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
    Card,
    CardT,
    Method,
    NetworkT,
    State,
    save_checkpoint,
    save_weights,
)
from baselines.training.machine import Machine
from scenegen.common.errors import SceneGenError
from scenegen.common.records import check

Progress = Callable[[int, int, Mapping[str, float]], Any]  # iterations done, in all, losses
DIVERGED = "begin again with a smaller learning rate or other weights of the losses"
FETCHED = 20  # iterations after which losses come from a GPU
PLANS = 50  # how often a run with a limit of time plans the rest of its schedule
UNPLANNED = 10**7  # iterations of its schedule before it knows its pace


class TrainingError(SceneGenError):
    """Training cannot go on: a loss is not finite, memory is short, or a reader was killed."""


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
    machine: Machine,
    *,
    clip: float | None = None,
    prepare: Callable[[], Any] = lambda: None,
    progress: Progress = lambda done, total, losses: None,
) -> None:
    """Train from the state's iteration to its last one; this changes the state.

    With a limit of time, the iterations of the state's settings become as many as fit into it.

    Args:
        folder: gets checkpoint and weights.
        losses: yields the losses of an iteration, by its number. After each a step is taken, so
            that what is computed next sees the new weights.
        rate: the learning rate of a card's settings in an iteration.
        machine: says how often checkpoints are written, and how long training may take.
        clip: largest norm of the gradients of a step; None for any.
        prepare: called before a checkpoint is written.
        progress: called after each iteration.

    Raises:
        TrainingError: a loss, a gradient or a weight is not finite, or the GPU has too little
            memory. The files are those of the last checkpoint.
        SpecError: a limit of time is over, or cannot be kept.
        OSError.
    """
    before, started = state.card.seconds, time.monotonic()
    plan = _Plan(machine, state.card) if machine.minutes is not None else None
    if plan is not None:
        state.card = plan.planned(state.card)

    def save() -> None:
        _require_finite(state)
        prepare()
        _require_finite(state)
        save_checkpoint(folder, state)
        save_weights(folder / WEIGHTS, method, state.network, state.card)

    if state.card.iteration == state.card.settings.iterations:
        save()  # the run may have ended between its last checkpoint and its weights
    state.network.train()
    interval = fetch_interval(next(state.network.parameters()).device)
    waiting, reported = list[Tensor](), dict[str, float]()
    while state.card.iteration < state.card.settings.iterations:
        number = state.card.iteration
        for each in state.optimisers.values():
            for group in each.param_groups:
                group["lr"] = rate(state.card.settings, number)
        numbers: dict[str, Tensor] = {}
        try:
            for loss in losses(number):
                optimiser = state.optimisers[loss.optimiser]
                waiting += _step(optimiser, loss, clip, number if interval == 1 else None)
                numbers |= {name: value.detach() for name, value in loss.numbers.items()}
        except torch.OutOfMemoryError as error:
            message = f"no memory left on the GPU for a batch of {state.card.settings.batch}"
            raise TrainingError("training", message, hint="--set batch=N needs less") from error
        done, seconds = number + 1, round(before + time.monotonic() - started, 1)
        state.card = replace(state.card, iteration=done, seconds=seconds)
        if plan is not None:
            state.card = plan.planned(state.card)
        last = state.card.settings.iterations
        saves = done % machine.every == 0 or done == last
        if saves or done % interval == 0:
            reported, waiting = _fetched(waiting, numbers, number), []
        if saves:
            save()
        progress(done, last, reported)


def fetch_interval(device: torch.device) -> int:
    """Return after how many iterations losses are fetched from a device: 1 for every step's."""
    return 1 if device.type == "cpu" else FETCHED


class _Plan:
    """How many iterations fit into a limit of time, by the pace of the last ones."""

    def __init__(self, machine: Machine, card: Card) -> None:
        """Begin. Raises SpecError where the time is over already."""
        limit, left = f"{machine.minutes:g}", machine.seconds_left()
        check(left > 0, "minutes", limit, "more: they passed while the data were read")
        self._machine, self._done, self._left = machine, card.iteration, left
        begun = 0 < card.iteration < card.settings.iterations
        self._iterations = card.settings.iterations if begun else UNPLANNED
        self._share = left / PLANS

    def planned(self, card: CardT) -> CardT:
        """Return the card with as many iterations as there will be."""
        done, left = card.iteration, self._machine.seconds_left()
        if done > self._done and (self._left - left >= self._share or left <= 0):
            pace = (self._left - left) / (done - self._done)
            self._iterations = done + (int(left / pace) if left > 0 else 0)
            self._done, self._left = done, left
        if card.settings.iterations == self._iterations:
            return card
        return replace(card, settings=replace(card.settings, iterations=self._iterations))


def _fetched(
    checked: list[Tensor], numbers: Mapping[str, Tensor], iteration: int
) -> dict[str, float]:
    """Return numbers from their device. Raises TrainingError where a checked one is not finite."""
    values = torch.stack([v.detach() for v in (*checked, *numbers.values())]).tolist()
    shown = dict(zip(numbers, values[len(checked) :], strict=True))
    if not all(map(math.isfinite, values[: len(checked)])):
        text = ", ".join(f"{name} {value:.3g}" for name, value in shown.items())
        problem = f"a loss or gradient that is not finite ({text})"
        raise TrainingError(f"iteration {iteration}", problem, hint=DIVERGED)
    return shown


def falling_late(settings: Any, iteration: int) -> float:
    """Return a learning rate that falls linearly to 0 over the second half of training."""
    left = 1 - iteration / settings.iterations
    return float(settings.learning_rate * min(1.0, 2 * left))


def _step(optimiser: Adam, loss: Loss, clip: float | None, number: int | None) -> list[Tensor]:
    """Take one step; return the loss and the norm of its gradients, which have to be finite.

    Given the number of the iteration, they are checked at once. Raises as `_fetched`.
    """
    optimiser.zero_grad()
    if number is not None:  # before torch's slopes, which may crash on a CPU
        _fetched([loss.total], loss.numbers, number)
    torch.autograd.backward(loss.total)
    parameters = optimiser.param_groups[0]["params"]
    gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
    norm = torch.nn.utils.get_total_norm(gradients)
    if number is not None:
        _fetched([norm], loss.numbers, number)
    if clip is not None:
        torch.nn.utils.clip_grads_with_norm_(parameters, clip, norm)
    optimiser.step()
    return [loss.total.detach(), norm]


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

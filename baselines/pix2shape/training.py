"""The training loop: Pix2Shape (IJCV 2020), Algorithm 1, on any of Lightning Fabric's devices.

Everything random in iteration i derives from (seed, i), so that training goes on after a kill as if
it had never stopped: weights, optimisers and the number of the iteration are all there is to keep.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import torch
from lightning_fabric import Fabric
from torch import Tensor, nn
from torch.optim import Adam
from torch.utils.data import DataLoader, Dataset, default_collate

from baselines.pix2shape.config import ModelConfig
from baselines.pix2shape.data import Batch, Draws, RoomImages
from baselines.pix2shape.question_data import QuestionImages
from baselines.pix2shape.state import State
from baselines.pix2shape.steps import Noise, critic_step, draw, generator_step
from scenegen.errors import SceneGenError, SpecError
from scenegen.records import check
from scenegen.seeding import Purpose, item_seed

Source = RoomImages | QuestionImages
LABELS_PER_PLACE = 100  # labels for each labelled question among the contrasted ones


class TrainingError(SceneGenError):
    """Training cannot go on."""


def train(
    state: State,
    source: Source,
    fabric: Fabric,
    *,
    labelled: QuestionImages | None = None,
    labels: int = 0,
    workers: int = 0,
) -> Iterator[tuple[dict[str, float], Batch]]:
    """Train from the state's iteration to the configuration's last, changing the state.

    Yields the losses by name and the last batch, after each iteration.

    Args:
        source: of the images.
        fabric: launched; where several processes train, each takes its share of every batch.
        labelled: questions whose first `labels` answers may be used.
        workers: processes that read; as many again for contrasted questions.

    Raises:
        TrainingError: a loss or a gradient is not finite. The weights are those of before the step,
            but not the batch statistics: go on from a checkpoint.
        SpecError: no loss is switched on, there are not so many labels, or the processes cannot
            share a batch evenly.
    """
    config, model = state.model.config, state.model
    _check_request(config, source, labelled, labels, fabric.world_size)
    fabric.to_device(model)
    for optimiser in (state.generator, state.critic):  # moves the moments to the weights' device
        optimiser.load_state_dict(optimiser.state_dict())
    batches = _batches(source, fabric, state, workers)
    asked = _questions(source, labelled, labels, fabric, state, workers)
    model.train()
    began = time.monotonic() - state.seconds
    while state.iteration < config.iterations:
        losses: dict[str, float] = {}
        _set_rate(state)
        for turn in range(config.batches_per_iteration):
            batch = next(batches)
            noise = _noise(state, batch, turn, fabric)
            if config.has_critic:
                with fabric.autocast():
                    loss, numbers = critic_step(model, batch, noise)
                _update(fabric, state, state.critic, loss, numbers, losses)
        with fabric.autocast(), _frozen(model.critic, model.statistics):
            loss, numbers = generator_step(model, batch, noise, next(asked, None))
        _update(fabric, state, state.generator, loss, numbers, losses)
        state.iteration += 1
        state.seconds = time.monotonic() - began
        yield losses, batch


def _check_request(
    config: ModelConfig,
    source: Source,
    labelled: QuestionImages | None,
    labels: int,
    processes: int,
) -> None:
    questions = isinstance(source, QuestionImages)
    if questions and config.consistency:
        raise SpecError("consistency: expected 0 for questions, whose cameras are not told")
    sizes = _asked_sizes(config, source, labels)
    for size in (_batch_size(config, source), *(size for size in sizes if size)):
        even = size % processes == 0 and size >= 2 * processes
        what = f"a number that shares {size} items, 2 or more each"
        check(processes == 1 or even, "devices", processes, what)
    if labels:
        count = len(labelled) if labelled is not None and labelled.has_answers else 0
        check(labels <= count, "labels", labels, f"at most {count}, the answers that are told")
    weights = (config.adversarial, config.reconstruction, config.code_reconstruction)
    if not any((*weights, config.consistency, config.depth, *sizes)):
        raise SpecError("losses: found every weight at 0, expected one above")


def _batch_size(config: ModelConfig, source: Source) -> int:
    """Items of a batch: images of rooms, or questions."""
    return config.reconstructed_questions if isinstance(source, QuestionImages) else config.batch


def _asked_sizes(config: ModelConfig, source: Source, labels: int) -> tuple[int, int]:
    """How many questions with a label, and without, have their codes compared each iteration."""
    if not isinstance(source, QuestionImages) or not (config.contrast or config.questions):
        return 0, 0
    if not config.contrast:
        return (config.question_batch if labels else 0), 0
    few = -(-labels // LABELS_PER_PLACE)  # or few labels would be seen again and again
    labelled = min(few, config.question_batch // 4)
    return labelled, config.question_batch - labelled


class _Told(Dataset[Any]):
    """A source whose errors are items: else a worker's would come as its whole traceback."""

    def __init__(self, source: Source) -> None:
        self._source = source

    def __len__(self) -> int:
        return len(self._source)

    def __getitem__(self, row: int) -> Any:
        try:
            return self._source[row]
        except (SceneGenError, OSError) as error:
            return error


def _collated(items: list[Any]) -> Any:
    errors = [item for item in items if isinstance(item, Exception)]
    return errors[0] if errors else default_collate(items)


def _loaded(
    source: Source,
    rows: int,
    size: int,
    first: int,
    seed: int,
    fabric: Fabric,
    workers: int,
) -> Iterator[dict[str, Tensor]]:
    """Read batch after batch from a number on, for ever; of each, this process's share."""
    share = slice(fabric.global_rank, None, fabric.world_size)
    loader = DataLoader(
        _Told(source),
        batch_sampler=Draws(rows, size, seed, first, share),
        num_workers=workers,
        collate_fn=_collated,
        pin_memory=fabric.device.type == "cuda",
    )
    for items in loader:
        if isinstance(items, Exception):
            raise items
        yield items


def _batches(source: Source, fabric: Fabric, state: State, workers: int) -> Iterator[Batch]:
    config = state.model.config
    size = _batch_size(config, source)
    first = state.iteration * config.batches_per_iteration
    for items in _loaded(source, len(source), size, first, config.seed, fabric, workers):
        yield source.as_batch(items).to(fabric.device)


def _questions(
    source: Source,
    labelled: QuestionImages | None,
    labels: int,
    fabric: Fabric,
    state: State,
    workers: int,
) -> Iterator[tuple[Batch, Tensor]]:
    """Yield questions whose codes are compared: the labelled ones first, -1 where no answer is."""
    config = state.model.config
    with_label, without = _asked_sizes(config, source, labels)
    where = state.iteration, config.seed, fabric
    streams = []
    if labelled is not None and with_label:
        streams.append(_loaded(labelled, labels, with_label, *where, 0))
    if without:
        unknown = _loaded(source, len(source), without, *where, workers)
        streams.append(
            {**items, "answer": torch.full((len(items["image"]),), -1)} for items in unknown
        )
    for parts in zip(*streams, strict=False):
        items = {name: torch.cat([part[name] for part in parts]) for name in parts[0]}
        yield source.as_batch(items).to(fabric.device), items["answer"].to(fabric.device)


@contextmanager
def _frozen(*modules: nn.Module) -> Iterator[None]:
    """Leave out the gradients of weights that are not to change."""
    for module in modules:
        module.requires_grad_(False)
    try:
        yield
    finally:
        for module in modules:
            module.requires_grad_(True)


def _update(
    fabric: Fabric,
    state: State,
    optimiser: Adam,
    loss: Tensor,
    numbers: dict[str, Tensor],
    losses: dict[str, float],
) -> None:
    """Take one step; nothing is changed where the loss or a gradient is not finite."""
    optimiser.zero_grad()
    fabric.backward(loss)
    gradients = [
        p.grad for group in optimiser.param_groups for p in group["params"] if p.grad is not None
    ]
    if fabric.world_size > 1:  # DDP forbids several and double backward passes
        for gradient in gradients:
            gradient.copy_(cast(Tensor, fabric.all_reduce(gradient, reduce_op="mean")))
    losses |= {name: float(value.detach()) for name, value in numbers.items()}
    sound = torch.isfinite(loss.detach()) & torch.isfinite(torch.nn.utils.get_total_norm(gradients))
    if cast(Tensor, fabric.all_reduce(sound.float(), reduce_op="mean")) != 1:
        told = ", ".join(f"{name} {value:.3g}" for name, value in losses.items())
        raise TrainingError(
            f"iteration {state.iteration}: loss or gradients are not finite ({told}); go on from"
            " the checkpoint, with a smaller learning rate or other weights of the losses"
        )
    optimiser.step()


def _set_rate(state: State) -> None:
    config = state.model.config
    left = 1 - state.iteration / config.iterations
    for optimiser in (state.generator, state.critic):
        for group in optimiser.param_groups:
            group["lr"] = config.learning_rate * (min(1.0, 2 * left) if config.decay else 1.0)


def _noise(state: State, batch: Batch, turn: int, fabric: Fabric) -> Noise:
    config = state.model.config
    number = state.iteration * config.batches_per_iteration + turn
    seed = item_seed(config.seed, number, Purpose.TRAINING, fabric.global_rank)
    return draw(len(batch.image), config.networks.z, seed).to(fabric.device)

"""The training loop, on any of Lightning Fabric's devices.

For questions it follows Pix2Shape (IJCV 2020), Algorithm 1, with the losses that the configuration
switches on; docs/pix2shape.md lists the differences. Everything random in iteration i derives from
(seed, i), so training goes on after a kill as if it had never stopped. Where several processes
train, they share each batch and learn what one process would, up to rounding.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from lightning_fabric import Fabric
from torch import Tensor, nn
from torch.optim import Adam

from baselines.pix2shape.data.questions import QuestionImages
from baselines.pix2shape.data.rooms import Batch
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.shared_batch import average, processes
from baselines.pix2shape.training import batches
from baselines.pix2shape.training.batches import Source
from baselines.pix2shape.training.state import State
from baselines.pix2shape.training.steps import Asked, critic_step, draw, generator_step
from baselines.pix2shape.training.turning import turned
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.common.random.seeding import Purpose, item_seed
from scenegen.common.records import check

DIVERGED = "begin again with a smaller learning rate or other weights of the losses"


class TrainingError(SceneGenError):
    """Training cannot go on, as a loss, a gradient or a weight is not finite."""


def train(
    state: State,
    source: Source,
    fabric: Fabric,
    *,
    labelled: QuestionImages | None = None,
    labels: int = 0,
    workers: int = 0,
) -> Iterator[tuple[dict[str, float], Batch]]:
    """Train from the state's iteration to the configuration's last one; this changes the state.

    Yields the losses by name and the last batch, after each iteration.

    Args:
        fabric: launched; where several processes train, each takes its share of every batch.
        labelled: questions whose first `labels` answers may be used.
        workers: processes that read images; as many again read the questions that are compared.

    Raises:
        TrainingError: a loss or a gradient is not finite. The weights are as before the step, but
            the batch statistics are not: go on from a checkpoint.
        SpecError: no loss is switched on, or none that teaches what the model shall learn; there
            are fewer labels; or the processes cannot share a batch evenly.
        LostProcessError: another process that trains with this one ended.
    """
    config, model = state.model.config, state.model
    check_request(config, source, labelled, labels, processes())
    fabric.to_device(model)
    for optimiser in (state.generator, state.critic):  # moves their moments to the model's device
        optimiser.load_state_dict(optimiser.state_dict())
    images = batches.image_batches(source, fabric, state, workers)
    asked = batches.question_batches(source, labelled, labels, fabric, state, workers)
    model.train()
    began = time.monotonic() - state.seconds
    while state.iteration < config.iterations:
        losses: dict[str, float] = {}
        _set_rate(state)
        for turn in range(config.batches_per_iteration):
            batch = next(images)
            number = state.iteration * config.batches_per_iteration + turn
            seed = item_seed(config.seed, number, Purpose.TRAINING)
            if not turn:
                questions = next(asked, None)
            count, each = _sizes(questions)
            whole = len(batch.image) * (processes() if config.uses_images else 1)
            noise = draw(whole, config.networks.z, seed, count, each).to(fabric.device)
            seen = questions
            if config.turned and questions is not None:
                seen = turned(questions[0], noise.turn, noise.mirror), questions[1]
            if config.has_critic:
                with fabric.autocast():
                    loss, numbers = critic_step(model, batch, noise, seen)
                _update(fabric, state, state.critic, loss, numbers, losses)
        with fabric.autocast(), _frozen(model.critic, model.statistics):
            loss, numbers = generator_step(model, batch, noise, seen)
        _update(fabric, state, state.generator, loss, numbers, losses)
        state.iteration += 1
        state.seconds = time.monotonic() - began
        yield losses, batch


def _sizes(questions: Asked | None) -> tuple[int, int]:
    """Return how many questions all processes compare, and images in each."""
    if questions is None:
        return 0, 0
    images, answers = len(questions[0].image), len(questions[1])
    return answers * processes(), images // answers


def check_request(
    config: ModelConfig,
    source: Source,
    labelled: QuestionImages | None,
    labels: int,
    count: int,
) -> None:
    """Raise SpecError where `train` cannot train so with a `count` of processes."""
    questions = isinstance(source, QuestionImages)
    if questions and config.consistency:
        expected = "0 for questions, whose cameras are not told"
        raise SpecError("consistency", config.consistency, expected)
    compared = sum(batches.question_sizes(config, source, labels))
    images = batches.batch_size(config, source) if config.uses_images else 0
    for size in (images, compared):
        items = "questions" if questions else "images"
        expected = f"a number of processes that divides a batch of {size} {items}"
        check(size % count == 0, "devices", count, expected)
    if config.disentangles and config.compared_information and not compared:
        expected = "questions that are compared, as contrast or labels ask for"
        raise SpecError("compared information", "nothing that is compared", expected)
    if labels:
        count = len(labelled) if labelled is not None and labelled.has_answers else 0
        check(labels <= count, "labels", labels, f"at most {count}, as many answers are told")
    weights = (config.adversarial, config.reconstruction, config.code_reconstruction)
    if not any((*weights, config.consistency, config.depth, config.matching, compared)):
        raise SpecError("losses", "every weight at 0", "one above 0")
    for name in ("material", "lights"):
        if getattr(config, name) and not any(weights):
            expected = "a loss of images, such as reconstruction, which alone teaches it"
            raise SpecError(name, "every weight of such losses at 0", expected)


@contextmanager
def _frozen(*modules: nn.Module) -> Iterator[None]:
    """Compute no gradients of the weights of some networks."""
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
    """Take one step, unless the loss or a gradient is not finite; tell `losses`."""
    optimiser.zero_grad()
    found = torch.stack([loss.detach(), *(value.detach() for value in numbers.values())])
    average([found])
    losses |= dict(zip(numbers, found[1:].tolist(), strict=True))
    wrong = f"a loss or gradient that is not finite ({_told(losses)})"
    if not found[0].isfinite():  # known before torch computes slopes, which can crash on such
        raise TrainingError(f"iteration {state.iteration}", wrong, hint=DIVERGED)
    fabric.backward(loss)
    parameters = optimiser.param_groups[0]["params"]
    gradients = [one.grad for one in parameters if one.grad is not None]
    average(gradients)  # DDP allows neither several backward passes nor second gradients
    if not torch.nn.utils.get_total_norm(gradients).isfinite():
        raise TrainingError(f"iteration {state.iteration}", wrong, hint=DIVERGED)
    optimiser.step()


def _told(losses: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in losses.items())


def require_finite(state: State) -> None:
    """Raise TrainingError where a weight, a statistic or a moment is not finite.

    The losses of an iteration are those before its step, which may have been the one too far.
    """
    tensors = list(state.model.state_dict().values())
    for optimiser in (state.generator, state.critic):
        tensors += [one for moments in optimiser.state.values() for one in moments.values()]
    if not all(bool(one.isfinite().all()) for one in tensors):
        found = "weights that are not finite after the last step"
        raise TrainingError(f"iteration {state.iteration}", found, hint=DIVERGED)


def _set_rate(state: State) -> None:
    config = state.model.config
    left = 1 - state.iteration / config.iterations
    for optimiser in (state.generator, state.critic):
        for group in optimiser.param_groups:
            group["lr"] = config.learning_rate * (min(1.0, 2 * left) if config.decay else 1.0)

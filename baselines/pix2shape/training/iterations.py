"""The losses of one iteration after another.

For questions they follow Pix2Shape (IJCV 2020), Algorithm 1, with the losses that the configuration
switches on; docs/pix2shape.md lists the differences.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from torch import nn

from baselines.pix2shape.batch import Batch, turned
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.questions import QuestionImages
from baselines.pix2shape.training.batches import Sources, image_batches, question_batches
from baselines.pix2shape.training.steps import critic_step, draw, generator_step
from baselines.training.fit import Loss
from baselines.training.processes import processes
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_seed
from scenegen.common.records import check


class Iterations:
    """The losses of each iteration, in its order, as `fit` asks for them.

    Attributes:
        batch: the last batch of images.
    """

    batch: Batch

    def __init__(
        self,
        model: Pix2Shape,
        sources: Sources,
        first: int,
        workers: int,
        autocast: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        """Begin with iteration `first`.

        Args:
            workers: processes that read images; as many again read questions that are compared.
            autocast: sets the networks' precision.
        """
        self._model, self._autocast = model, autocast
        self._images = image_batches(sources, model.config, first, workers)
        self._questions = question_batches(sources, model.config, first, workers)

    def __call__(self, number: int) -> Iterator[Loss]:
        """Yield the loss of each step of the critic, if there is one, and of the generator."""
        model, config = self._model, self._model.config
        device = next(model.parameters()).device
        questions = next(self._questions, None)
        count, each = 0, 0  # questions that all processes compare, and images in each
        if questions is not None:
            images, answers = questions[0].to(device), questions[1].to(device)
            questions = images, answers
            count, each = len(answers) * processes(), len(images.image) // len(answers)
        for turn in range(config.batches_per_iteration):
            batch = self.batch = next(self._images).to(device)
            seed = item_seed(
                config.seed, number * config.batches_per_iteration + turn, Purpose.TRAINING
            )
            whole = len(batch.image) * (processes() if config.uses_images else 1)
            noise = draw(whole, config.networks.z, seed, count, each).to(device)
            compared = questions
            if config.turned and questions is not None:
                compared = turned(questions[0], noise.turn, noise.mirror), questions[1]
            if config.has_critic:
                with self._autocast():
                    total, numbers = critic_step(model, batch, noise)
                yield Loss(total, numbers, "critic")
        with self._autocast(), _frozen(model.critic, model.statistics):
            total, numbers = generator_step(model, batch, noise, compared)
        yield Loss(total, numbers, "generator")


def check_request(model: Pix2Shape, sources: Sources, count: int) -> None:
    """Raise SpecError where a `count` of processes cannot train so.

    No loss is switched on, or none that teaches what the model shall learn; or the processes cannot
    share a batch evenly.
    """
    config, questions = model.config, isinstance(sources.images, QuestionImages)
    compared = sum(sources.question_sizes(config))
    images = sources.batch_size(config) if config.uses_images else 0
    for size in (images, compared):
        items = "questions" if questions else "images"
        expected = f"a number of processes that divides a batch of {size} {items}"
        check(size % count == 0, "devices", count, expected)
    weights = (config.adversarial, config.reconstruction, config.code_reconstruction)
    if not any((*weights, config.depth, config.matching, compared)):
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

"""What one step minimises on a batch: the weighted sum of the losses that are switched on.

"Generator" means encoder and decoder together; they are trained against the critic. The losses
follow Pix2Shape (IJCV 2020), Algorithm 1 and equations "rec_loss" and "app-loss". A loss whose
weight is 0 is neither computed nor reported.

`Iterations` has the steps of each iteration, for questions those of Algorithm 1; docs/pix2shape.md
lists the differences.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from baselines.pix2shape.images import Batch, turned
from baselines.pix2shape.network.architecture import CAMERA
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.model import Pix2Shape, shaded
from baselines.pix2shape.training import losses
from baselines.pix2shape.training.batches import Sources, image_batches, question_batches
from baselines.training.fit import Loss
from baselines.training.images import mapped
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_seed

Numbers = dict[str, Tensor]
Questions = tuple[Batch, Tensor]  # images, and which answers are right


@dataclass(frozen=True, eq=False)
class Noise:
    """The random numbers of one step on B images.

    Attributes:
        code: standard normal, (B, z).
        share: uniform in 0..1, (B,); where the gradient penalty is taken.
        order: a permutation of the batch, (B,).
        turn: of the compared questions' images, of which there are C, the angles by which they are
            turned, radians, (C,).
        mirror: which of them are mirrored first, (C,), all of a question or none.
    """

    code: Tensor
    share: Tensor
    order: Tensor
    turn: Tensor
    mirror: Tensor

    def to(self, device: torch.device) -> "Noise":
        """Return the noise on another device."""
        return mapped(self, lambda values: values.to(device))


def draw(images: int, z: int, seed: int, questions: int = 0, each: int = 0) -> Noise:
    """Return the noise of a seed, the same for every device.

    Args:
        images: how many images the batch has.
        z: length of a code.
        seed: of all numbers.
        questions, each: how many questions are compared, and images in each.
    """
    source = torch.Generator().manual_seed(seed)
    return Noise(
        torch.randn(images, z, generator=source),
        torch.rand(images, generator=source),
        torch.randperm(images, generator=source),
        2 * torch.pi * torch.rand(questions * each, generator=source),
        (torch.rand(questions, generator=source) < 0.5).repeat_interleave(each),
    )


def critic_step(model: Pix2Shape, batch: Batch, noise: Noise) -> tuple[Tensor, Numbers]:
    """Return what critic and statistics network minimise, and the parts to report by name."""
    config, views = model.config, batch.views
    numbers: Numbers = {}
    total = batch.image.new_zeros(())
    with torch.no_grad():
        code = model.encode(batch.image, views)
    if config.adversarial:
        with torch.no_grad():
            made = model.image(noise.code, views)

        def critic(image: Tensor, code: Tensor) -> Tensor:
            return model.critic(image, code, views.condition)

        loss = losses.critic_loss(critic(batch.image, code), critic(made, noise.code))
        pairs = (batch.image, code), (made, noise.code)
        penalty = losses.gradient_penalty(critic, *pairs, noise.share)
        numbers["distance"], numbers["penalty"] = -loss, penalty
        total = total + loss + penalty
    if config.disentangles:
        total = total - _information(model, code, noise.order)
    return total, numbers


def generator_step(
    model: Pix2Shape, batch: Batch, noise: Noise, questions: Questions | None = None
) -> tuple[Tensor, Numbers]:
    """Return what encoder and decoder minimise, and the losses by name.

    Args:
        questions: the images of Q questions, one after the other, and their right answers, (Q,);
            -1 for a question without a label.
    """
    config, views = model.config, batch.views
    numbers: Numbers = {}
    if config.uses_images:
        code = model.encode(batch.image, views)
    if config.reconstruction or config.depth:
        surfels = model.surfels(code, views.condition, views.cameras)
        depth = surfels.depth
        if config.reconstruction:
            # A material explains an image on flat surfaces, too: where matching finds the surfaces,
            # images teach the material on them and no more.
            taught = config.material and config.matching
            seen = replace(surfels, depth=depth.detach()) if taught else surfels
            again = shaded(seen, model.lit(code, views))
            numbers["reconstruction"] = _compared(config, batch.image, again)
        if config.depth and batch.depth is not None:
            surface = torch.isfinite(batch.depth)
            wrong = torch.where(surface, depth - torch.where(surface, batch.depth, 0), 0)
            numbers["depth"] = (wrong**2).sum() / surface.sum().clamp(min=1)
    if config.adversarial or config.code_reconstruction:
        made = model.image(noise.code, views)
        if config.adversarial:
            real = model.critic(batch.image, code, views.condition)
            fake = model.critic(made, noise.code, views.condition)
            numbers["adversarial"] = -losses.critic_loss(real, fake)
        if config.code_reconstruction:
            again = model.encode(made, views)
            numbers["code_reconstruction"] = losses.reconstruction_loss(noise.code, again)
    if config.matching:
        assert batch.relief is not None, "run.py had it found"
        numbers["matching"] = _matching(model, batch, code, noise)
    if config.disentangles:
        numbers["mutual_information"] = _information(model, code, noise.order)
    if questions is not None:
        numbers |= _question_losses(model, *questions)
    weighted = (getattr(config, name) * loss for name, loss in numbers.items())
    return sum(weighted, batch.image.new_zeros(())), numbers


def _matching(model: Pix2Shape, batch: Batch, code: Tensor, noise: Noise) -> Tensor:
    """Return the mean absolute difference of relief in one view of each scene, drawn by the noise.

    Absolute differences let a pixel be either floor or object, rather than something between.
    """
    relief = batch.relief
    assert relief is not None
    views = len(relief.values[0])
    drawn = (noise.share * views).long().clamp(max=views - 1)
    each = torch.arange(len(drawn), device=drawn.device)
    positions = relief.world_from_camera[each, drawn, :3, 3]
    classes = batch.views.condition[:, CAMERA:]
    decoded = model.relief(code, torch.cat([positions, classes], dim=1))
    return (decoded - relief.values[each, drawn].float()).abs().mean()


def _question_losses(model: Pix2Shape, images: Batch, answers: Tensor) -> Numbers:
    """Return the losses that compare the images of questions, by name."""
    config, numbers = model.config, Numbers()
    code = model.encode(images.image, images.views)
    scene = code[:, : config.networks.z_scene]
    codes, labelled = scene.view(len(answers), -1, scene.shape[1]), answers >= 0
    if config.questions and labelled.any():
        numbers["questions"] = losses.question_loss(codes[labelled], answers[labelled])
    if config.contrast:
        numbers["contrast"] = losses.contrast_loss(
            codes, answers, config.temperature, config.hard_negatives, config.easy_negatives
        )
    return numbers


def _compared(config: ModelConfig, image: Tensor, again: Tensor) -> Tensor:
    """Return how much images, (B, 3, S, S), differ."""
    absolute = config.absolute_differences
    return (losses.absolute_loss if absolute else losses.reconstruction_loss)(image, again)


def _information(model: Pix2Shape, code: Tensor, order: Tensor) -> Tensor:
    """Return the mutual information of z_scene and z_view in codes."""
    end = model.config.networks.z_scene
    return losses.mutual_information(model.statistics, code[:, :end], code[:, end:], order)


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
        count, each = 0, 0  # questions that are compared, and images in each
        if questions is not None:
            images, answers = questions[0].to(device), questions[1].to(device)
            questions = images, answers
            count, each = len(answers), len(images.image) // len(answers)
        for turn in range(config.batches_per_iteration):
            batch = self.batch = next(self._images).to(device)
            seed = item_seed(
                config.seed, number * config.batches_per_iteration + turn, Purpose.TRAINING
            )
            noise = draw(len(batch.image), config.networks.z, seed, count, each).to(device)
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


def check_request(model: Pix2Shape, sources: Sources) -> None:
    """Raise SpecError where no loss is switched on that teaches what the model shall learn."""
    config = model.config
    compared = sum(sources.question_sizes(config))
    weights = (config.adversarial, config.reconstruction, config.code_reconstruction)
    if not any((*weights, config.depth, config.matching, compared)):
        raise SpecError("losses", "every weight at 0", "one above 0")
    for name in ("material", "lights"):
        if getattr(config, name) and not any(weights):
            expected = "an image loss, such as reconstruction, which is needed to learn it"
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

"""What one step minimises on a batch: the weighted sum of the losses that are switched on.

"Generator" means encoder and decoder together; they are trained against the critic. The losses
follow Pix2Shape (IJCV 2020), Algorithm 1 and equations "rec_loss" and "app-loss". A loss whose
weight is 0 is neither computed nor reported.

Where several processes share a batch, each calls a step with its own images, and the average of
what they return, and of its gradients, is that of one process with all images.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from baselines.pix2shape.data.rooms import Batch
from baselines.pix2shape.network.architecture import CAMERA
from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.pix2shape.network.model import Pix2Shape, mapped, shaded
from baselines.pix2shape.network.shared_batch import gathered, processes, share, summed
from baselines.pix2shape.training import losses

Numbers = dict[str, Tensor]


@dataclass(frozen=True, eq=False)
class Noise:
    """The random numbers of one step on B images, of which this process has B / N.

    Attributes:
        code: standard normal, (B / N, z).
        share: uniform in 0..1, (B / N,); where the gradient penalty is taken.
        order: a permutation of the whole batch, (B,).
    """

    code: Tensor
    share: Tensor
    order: Tensor

    def to(self, device: torch.device) -> "Noise":
        """Return the noise on another device."""
        return mapped(self, lambda values: values.to(device))


def draw(images: int, z: int, seed: int) -> Noise:
    """Return the noise of a seed, the same for every device and however many processes share it.

    Args:
        images: how many images of the batch this process has.
    """
    source, batch = torch.Generator().manual_seed(seed), images * processes()
    own = share(batch)
    return Noise(
        torch.randn(batch, z, generator=source)[own],
        torch.rand(batch, generator=source)[own],
        torch.randperm(batch, generator=source),
    )


def critic_step(model: Pix2Shape, batch: Batch, noise: Noise) -> tuple[Tensor, Numbers]:
    """Return what critic and statistics network minimise, and the parts to report by name."""
    config, views = model.config, batch.views
    numbers: Numbers = {}
    with torch.no_grad():
        code = model.encode(batch.image, views)
    total = code.new_zeros(())
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
        total = total - _information(model, code, noise)
    return total, numbers


def generator_step(
    model: Pix2Shape, batch: Batch, noise: Noise, asked: tuple[Batch, Tensor] | None = None
) -> tuple[Tensor, Numbers]:
    """Return what encoder and decoder minimise, and the losses by name.

    Args:
        asked: the images of Q questions, one after the other, and which answers are right, (Q,);
            -1 for a question without a label.
    """
    config, views = model.config, batch.views
    code = model.encode(batch.image, views)
    numbers: Numbers = {}
    if config.reconstruction or config.depth or config.consistency:
        depth, opacity = model.surfels(code, views.condition, views.cameras)
        if config.reconstruction:
            again = shaded(depth, opacity, views)
            absolute = config.absolute_differences
            compared = losses.absolute_loss if absolute else losses.reconstruction_loss
            numbers["reconstruction"] = compared(batch.image, again)
        if config.depth and batch.depth is not None:
            known = torch.isfinite(batch.depth)
            wrong = torch.where(known, depth - torch.where(known, batch.depth, 0), 0)
            numbers["depth"] = summed((wrong**2).sum()) / summed(known.sum()).clamp(min=1)
    if config.adversarial or config.code_reconstruction:
        made = model.image(noise.code, views)
        if config.adversarial:
            real = model.critic(batch.image, code, views.condition)
            fake = model.critic(made, noise.code, views.condition)
            numbers["adversarial"] = -losses.critic_loss(real, fake)
        if config.code_reconstruction:
            again = model.encode(made, views)
            numbers["code_reconstruction"] = losses.reconstruction_loss(noise.code, again)
    if config.consistency:
        pose, fov = views.world_from_camera, views.scene.fov_y_degrees
        assert pose is not None, "for_questions switches consistency off"
        theirs = noise.order[share(len(noise.order))]
        others, camera = gathered(pose)[theirs], gathered(views.condition)[theirs, :CAMERA]
        classes = views.condition[:, CAMERA:]
        elsewhere, _ = model.surfels(
            code, torch.cat([camera, classes], dim=1), Cameras(others, fov)
        )
        numbers["consistency"] = (
            losses.disagreement(depth, elsewhere, torch.linalg.solve(others, pose), fov)
            + losses.disagreement(elsewhere, depth, torch.linalg.solve(pose, others), fov)
        ) / 2
    if config.matching:
        assert batch.relief is not None, "runs.py had it found"
        numbers["matching"] = _matching(model, batch, code, noise)
    if config.disentangles:
        numbers["mutual_information"] = _information(model, code, noise)
    if asked is not None:
        images, answers = asked
        scene = model.encode(images.image, images.views)[:, : config.networks.z_scene]
        scene, answers = gathered(scene), gathered(answers)
        codes, known = scene.view(len(answers), -1, scene.shape[1]), answers >= 0
        if config.questions and known.any():
            numbers["questions"] = losses.question_loss(codes[known], answers[known])
        if config.contrast:
            numbers["contrast"] = losses.contrast_loss(codes, answers)
    weighted = (getattr(config, name) * loss for name, loss in numbers.items())
    return sum(weighted, code.new_zeros(())), numbers


def _matching(model: Pix2Shape, batch: Batch, code: Tensor, noise: Noise) -> Tensor:
    """Return the mean absolute difference of relief in one view of each scene, drawn by the noise.

    Absolute differences let a pixel be either floor or object, rather than something between.
    """
    relief = batch.relief
    assert relief is not None
    views = len(relief.found[0])
    drawn = (noise.share * views).long().clamp(max=views - 1)
    each = torch.arange(len(drawn), device=drawn.device)
    positions = relief.world_from_camera[each, drawn, :3, 3]
    classes = batch.views.condition[:, CAMERA:]
    asked = model.relief(code, torch.cat([positions, classes], dim=1))
    return (asked - relief.found[each, drawn].float()).abs().mean()


def _information(model: Pix2Shape, code: Tensor, noise: Noise) -> Tensor:
    """Return the mutual information of z_scene and z_view in codes."""
    code, end = gathered(code), model.config.networks.z_scene
    return losses.mutual_information(model.statistics, code[:, :end], code[:, end:], noise.order)

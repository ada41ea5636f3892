"""The whole model: image -> code -> depth map and opacity -> image."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from baselines.pix2shape.network.architecture import Critic, Decoder, Encoder, Statistics
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.empty_rooms import FLAT, Cameras, empty_rooms, planes_of
from baselines.pix2shape.network.polar import PolarEncoder
from baselines.pix2shape.network.surfels import Scene, render

MATERIAL = 5  # numbers of a surfel's material: albedo, k_s, exponent
SHINIEST = 128.0


@dataclass(frozen=True, eq=False)
class Views:
    """What the model is told about a batch of views.

    Attributes:
        condition: camera position, world frame, then the one-hot class: (B, spec.condition).
        scene: lights and reflectance, camera frame.
        background: radiance where there is no surface, (B, 3); None for closed rooms.
        world_from_camera: (B, 4, 4); None for questions, whose cameras are not told.
    """

    condition: Tensor
    scene: Scene
    background: Tensor | None = None
    world_from_camera: Tensor | None = None

    @property
    def cameras(self) -> Cameras | None:
        """The cameras; None for questions."""
        if self.world_from_camera is None:
            return None
        return Cameras(self.world_from_camera, self.scene.fov_y_degrees)


@dataclass(frozen=True, eq=False)
class Material:
    """What surfels are made of, as a decoder gives it.

    Attributes:
        albedo: reflectance rho, 0 to 1, (B, 3, S, S).
        specular, shininess: Phong's k_s, 0 to 1, and exponent, 1 to SHINIEST, (B, S, S).
    """

    albedo: Tensor
    specular: Tensor
    shininess: Tensor


@dataclass(frozen=True, eq=False)
class Surfels:
    """One surfel for each pixel of B images, as a decoder gives them.

    Attributes:
        depth: planar, scene units, (B, S, S).
        opacity: 0 to 1, (B, S, S); None for closed rooms, where every ray meets a surface.
        material: None where the views tell it.
    """

    depth: Tensor
    opacity: Tensor | None = None
    material: Material | None = None


class Prior(nn.Module):
    """The normal distribution that codes are drawn from; standard normal until it is fitted.

    Each class has a mean of its own; the covariance is one for all.
    """

    mean: Tensor
    factor: Tensor

    def __init__(self, z: int, classes: int = 0) -> None:
        super().__init__()
        self.classes = classes
        self.register_buffer("mean", torch.zeros(classes, z) if classes else torch.zeros(z))
        self.register_buffer("factor", torch.eye(z))

    def forward(self, noise: Tensor, condition: Tensor) -> Tensor:
        """Turn standard normal numbers into codes: (B, z), and conditions (B, D) -> (B, z)."""
        return self._means(condition) + noise @ self.factor.T

    def fit(self, codes: Tensor, condition: Tensor) -> None:
        """Take over means and covariance of codes, (N, z), made under conditions (N, D).

        Models without an adversarial loss need this, as nothing else ties their codes to the prior
        (Ghosh et al. 2020, "From Variational to Deterministic Autoencoders").
        """
        if self.classes:
            classes = condition[:, -self.classes :]
            sums, counts = classes.T @ codes, classes.sum(dim=0)[:, None]
            self.mean.copy_(torch.where(counts > 0, sums / counts.clamp(min=1), codes.mean(dim=0)))
        else:
            self.mean.copy_(codes.mean(dim=0))
        centred = (codes - self._means(condition)).double()
        variance, axes = torch.linalg.eigh(centred.T @ centred / max(len(codes) - 1, 1))
        self.factor.copy_(axes * variance.clamp(min=0).sqrt())

    def _means(self, condition: Tensor) -> Tensor:
        """Return the mean for each condition's class; the condition ends with it, one-hot."""
        return condition[:, -self.classes :] @ self.mean if self.classes else self.mean


class Pix2Shape(nn.Module):
    """Encoder, decoder, critic, statistics network and prior of one configuration.

    S is `config.networks.size` and z the length of a code, `config.networks.z`.
    """

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        spec = config.networks
        self.encoder = (PolarEncoder if spec.encoder == "polar" else Encoder)(spec)
        outputs = 1 + config.opacity + MATERIAL * config.material
        self.decoder = Decoder(spec, outputs, config.lights)
        self.critic = Critic(spec)
        self.statistics = Statistics(spec)
        self.prior = Prior(spec.z, spec.classes)

    def encode(self, image: Tensor, views: Views) -> Tensor:
        """Return the codes of images of linear radiance: (B, 3, S, S) -> (B, z)."""
        return self.codes(image, views.condition, views.cameras)

    def codes(self, image: Tensor, condition: Tensor, cameras: Cameras | None = None) -> Tensor:
        """Return the codes of images whose lights need not be known: (B, 3, S, S) -> (B, z).

        Args:
            condition: (B, D).
            cameras: those of the images; only used, and then needed, by a network of `rays`.
        """
        if not self.config.networks.rays:
            return self.encoder(image, condition)
        assert cameras is not None, "networks of rays take the camera as input"
        return self.encoder(image, condition, planes_of(cameras, image.shape[-1]))

    def relief(self, code: Tensor, condition: Tensor) -> Tensor:
        """Return how far surfaces lie before the empty room, scene units: (B, z) -> (B, S, S).

        For networks of `rays`. What is below FLAT means floor or wall.
        """
        return self.decoder(code, condition)[:, 0].float()

    def surfels(self, code: Tensor, condition: Tensor, cameras: Cameras | None = None) -> Surfels:
        """Return the surfels that a camera sees: (B, z) -> (B, S, S) of each number.

        Args:
            condition: (B, D).
            cameras: those that are asked for; only used, and then needed, by networks of `rays`.
        """
        raw = self.decoder(code, condition).float()
        if self.config.networks.rays:
            assert cameras is not None, "networks of rays take the camera as input"
            relief = torch.where(raw[:, 0] > FLAT, raw[:, 0], 0)
            pose, fov = cameras.world_from_camera, cameras.fov_y_degrees
            walls, entry, _ = empty_rooms(pose, fov, relief.shape[-1])
            depth = torch.maximum(walls - relief, entry)
        else:
            depth = self.config.depth_middle * (1 + self.config.depth_reach * torch.tanh(raw[:, 0]))
        opacity = torch.sigmoid(raw[:, 1]) if self.config.opacity else None
        material = None
        if self.config.material:
            made_of = torch.sigmoid(raw[:, -MATERIAL:])
            shininess = 1 + (SHINIEST - 1) * made_of[:, 4]
            material = Material(made_of[:, :3], made_of[:, 3], shininess)
        return Surfels(depth, opacity, material)

    def lit(self, code: Tensor, views: Views) -> Views:
        """Return the views with the lights where the code says; as they are where they are told."""
        if not self.config.lights:
            return views
        pose = views.world_from_camera
        assert pose is not None, "lights of questions are an input"
        with torch.autocast(code.device.type, enabled=False):  # bfloat16 is too coarse for places
            world = self.decoder.light_positions(code.float())
            positions = (world - pose[:, None, :3, 3]) @ pose[:, :3, :3]
        return replace(views, scene=replace(views.scene, light_position=positions))

    def image(self, code: Tensor, views: Views) -> Tensor:
        """Return the rendered images of codes: (B, z) -> (B, 3, S, S)."""
        surfels = self.surfels(code, views.condition, views.cameras)
        return shaded(surfels, self.lit(code, views))


def shaded(surfels: Surfels, views: Views) -> Tensor:
    """Return the images of surfels in front of the views' background: (B, 3, S, S)."""
    scene, made_of, opacity = views.scene, surfels.material, surfels.opacity
    if made_of is not None:
        scene = replace(
            scene,
            reflectance=made_of.albedo,
            specular=made_of.specular,
            shininess=made_of.shininess,
        )
    with torch.autocast(surfels.depth.device.type, enabled=False):  # differences of near numbers
        image = render(surfels.depth, scene)
    if opacity is None or views.background is None:
        return image
    behind = views.background[..., None, None]
    return behind + opacity[:, None] * (image - behind)

"""The model: networks and surfel renderer together."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from baselines.pix2shape.config import ModelConfig
from baselines.pix2shape.networks import Critic, Decoder, Encoder, Statistics
from baselines.pix2shape.surfels import Scene, render


@dataclass(frozen=True, eq=False)
class Views:
    """A batch of views as the networks see them.

    Attributes:
        condition: the camera's position, world, and the one-hot class: (B, spec.condition).
        scene: what their images are shaded with.
    """

    condition: Tensor
    scene: Scene


class Pix2Shape(nn.Module):
    """Encoder, decoder, critic and statistics network of one configuration."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        spec = config.networks
        self.encoder = Encoder(spec)
        self.decoder = Decoder(spec)
        self.critic = Critic(spec)
        self.statistics = Statistics(spec)

    def encode(self, image: Tensor, views: Views) -> Tensor:
        """Return the codes of images of linear radiance: (B, 3, S, S) -> (B, z)."""
        return self.encoder(image, views.condition)

    def decode(self, code: Tensor, views: Views) -> Tensor:
        """Return the depth maps of codes seen from views: (B, z) -> (B, S, S), scene units."""
        raw = self.decoder(code, views.condition)[:, 0]
        return self.config.depth_middle * (1 + self.config.depth_reach * torch.tanh(raw))

    def image(self, code: Tensor, views: Views) -> Tensor:
        """Return the rendered images of codes: (B, z) -> (B, 3, S, S)."""
        return render(self.decode(code, views), views.scene)

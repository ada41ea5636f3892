"""The network that gives the relief of a room from one image and its camera.

Relief is how far a surface lies before the empty room, along the viewing axis: depth = depth of the
empty room - relief. So networks are told where floor and walls are, as the baseline empty-room is.
They give relief in edges of the room, of which the paper's is a scene unit, and that of a closed
room is its longest one.
"""

import itertools
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from baselines.pix2shape.network.architecture import RAY_PLANES, contrast
from baselines.pix2shape.network.empty_rooms import FLAT, Cameras, empty_rooms, planes_of
from baselines.training import checkpoint
from baselines.training.checkpoint import Ranges
from scenegen.common.records import LARGEST, check

SIZES = (32, 64, 128, 256)  # pixels a side
LEVELS = (32, 64, 96, 128)  # channels at 1/2, 1/4, 1/8 and 1/16 of the image size
FINE = 16  # channels at full size


@dataclass(frozen=True)
class Settings(checkpoint.Settings):
    """How large a network is, and how it is trained.

    Attributes:
        width: multiplies the channels.
        learning_rate: it rises over WARM_UP iterations and falls to 0 along a cosine.
    """

    RANGES: ClassVar[Ranges] = {"width": (0.05, 4), "batch": (2, LARGEST)}
    width: float = 1.0
    iterations: int = 1200
    learning_rate: float = 0.003

    def __post_init__(self) -> None:
        check(self.size in SIZES, "size", self.size, f"one of {', '.join(map(str, SIZES))}")
        super().__post_init__()


@dataclass(frozen=True)
class Card(checkpoint.Card):
    """The card of a relief network."""

    settings: Settings


def relief_network(card: Card) -> "UNet":
    """Return an untrained network that sees with the input's own camera."""
    return UNet(card.settings)


def predicted_depth(
    network: nn.Module, image: Tensor, cameras: Cameras, targets: Cameras
) -> Tensor:
    """Return planar depth, (B, S, S), scene units: what the network gives, before the walls."""
    relief = network(image, cameras, targets) * targets.edge
    walls, entry, _ = empty_rooms(
        targets.world_from_camera, targets.fov_y_degrees, image.shape[-1], targets.room_size
    )
    return torch.maximum(walls - torch.where(relief > FLAT, relief, 0), entry)


class Residual(nn.Module):
    """Two convolutions with batch normalisation, and a way around them (He et al. 2016)."""

    def __init__(self, before: int, after: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(before, after, 3, padding=1, bias=False)
        self.second = nn.Conv2d(after, after, 3, padding=1, bias=False)
        self.norms = nn.ModuleList(nn.BatchNorm2d(after) for _ in range(2))
        self.around = nn.Conv2d(before, after, 1) if before != after else nn.Identity()

    def forward(self, values: Tensor) -> Tensor:
        """(B, before, H, W) -> (B, after, H, W)."""
        inner = functional.relu(self.norms[0](self.first(values)))
        return functional.relu(self.norms[1](self.second(inner)) + self.around(values))


class Relief(nn.Module):
    """(image (B, 3, S, S), its `Cameras`, `Cameras` asked for) -> what the latter see, (B, S, S).

    Relief may be below 0. It is made of channels that each pixel is told, so that training can show
    windows of them.

    Attributes:
        from_first_view: whether a scene is predicted from one image, or each view from its own.
    """

    from_first_view = False

    def forward(self, image: Tensor, cameras: Cameras, targets: Cameras) -> Tensor:
        """As the class says."""
        return self.relief(self.channels(image, cameras, targets))

    def channels(self, image: Tensor, cameras: Cameras, targets: Cameras) -> Tensor:
        """Return what the pixels of the cameras asked for are told, (B, C, S, S)."""
        raise NotImplementedError

    def relief(self, channels: Tensor) -> Tensor:
        """(B, C, H, W), H and W multiples of 16 -> (B, H, W)."""
        raise NotImplementedError


class UNet(Relief):
    """An encoder and a decoder joined at every size (Ronneberger et al. 2015)."""

    def __init__(self, settings: Settings, inputs: int = 3 + 3 + RAY_PLANES) -> None:
        super().__init__()
        fine, *levels = (max(4, round(settings.width * n)) for n in (FINE, *LEVELS))
        self.full = nn.Conv2d(inputs, fine, 3, padding=1)
        self.halve = nn.Conv2d(fine, levels[0], 4, 2, 1)
        before = [levels[0], *levels[:-1]]
        self.down = nn.ModuleList(Residual(a, b) for a, b in zip(before, levels, strict=True))
        rising = levels[::-1]
        joined = itertools.pairwise(rising)
        self.up = nn.ModuleList(Residual(a + b, b) for a, b in joined)
        self.enlarge = nn.Conv2d(levels[0], 4 * fine, 1)
        self.join = nn.Conv2d(2 * fine, fine, 3, padding=1)
        self.last = nn.Conv2d(fine, 1, 3, padding=1)

    def channels(self, image: Tensor, cameras: Cameras, targets: Cameras) -> Tensor:
        """As `Relief` says; only the image's own camera can be asked for."""
        if targets is not cameras:
            raise ValueError("a unet predicts at the camera of the input image only")
        planes = planes_of(cameras, image.shape[-1])
        return torch.cat([image, contrast(image), planes], dim=1)

    def relief(self, channels: Tensor) -> Tensor:
        """As `Relief` says."""
        channels = channels.contiguous(memory_format=torch.channels_last)
        full = functional.relu(self.full(channels))
        values, kept = functional.relu(self.halve(full)), []
        for level, block in enumerate(self.down):
            values = block(functional.max_pool2d(values, 2) if level else values)
            kept.append(values)
        for block, beside in zip(self.up, kept[-2::-1], strict=True):
            larger = functional.interpolate(values, scale_factor=2.0, mode="nearest")
            values = block(torch.cat([larger, beside], dim=1))
        values = functional.relu(functional.pixel_shuffle(self.enlarge(values), 2))
        values = functional.relu(self.join(torch.cat([values, full], dim=1)))
        last: Tensor = self.last(values)
        return last[:, 0]

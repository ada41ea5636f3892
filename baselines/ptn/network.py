"""The networks: an image becomes a code, and the code a volume of 32^3 occupancies.

Layers as Yan et al. list them on the page of their code: convolutions of 5x5 with 64, 128 and 256
channels, fully connected layers of 1024, 1024 and 512, then one of 3^3 x 512 and transposed 3D
convolutions to 6^3 x 256, 15^3 x 96 and 32^3. All numbers of channels are multiples of `width`, 64
in the paper.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.optim import Adam

from baselines.training import checkpoint
from baselines.training.checkpoint import Method, Ranges
from scenegen.common.records import check

VOXELS = 32  # along each side of the volume; the decoder's layers give no other number
FIRST_BIAS = -2.0  # of the occupancies' logits: most of a volume is empty
Corner = tuple[float, float, float]


@dataclass(frozen=True)
class Settings(checkpoint.Settings):
    """Settings of networks and training; defaults suit one core, `width` 64 is the paper's.

    Attributes:
        silhouettes: where those of rooms come from, "image" or "ids".
        size: a multiple of 8.
        views: silhouettes that each image's volume is compared with.
        rays: pixels of each silhouette that an iteration looks at.
        samples: places along each ray.
        learning_rate: it falls to zero over the second half of the iterations.
    """

    RANGES: ClassVar[Ranges] = {
        "size": (8, 512), "width": (2, 256), "views": (1, 10**7), "rays": (1, 10**7),
        "samples": (2, 1024), "weight_decay": (0, 1),
    }  # fmt: skip
    silhouettes: str = "image"
    width: int = 16
    iterations: int = 1700
    batch: int = 12
    views: int = 3
    rays: int = 160
    samples: int = 32
    weight_decay: float = 0.0

    def __post_init__(self) -> None:
        check(self.silhouettes in ("image", "ids"), "silhouettes", self.silhouettes, "image or ids")
        super().__post_init__()
        check(self.size % 8 == 0, "size", self.size, "a multiple of 8")
        check(self.width % 2 == 0, "width", self.width, "an even number")


@dataclass(frozen=True)
class Card(checkpoint.Card):
    """The card of a model.

    Attributes:
        task: "rooms", whose networks are told the image's camera, or "questions".
        low, high: corners of the volume's box, in the frame of the volume, scene units.
        head: how the features of an answer are weighted, for questions (`matching.features`).
    """

    settings: Settings
    task: str = "rooms"
    low: Corner = (0.0, 0.0, 0.0)
    high: Corner = (1.0, 1.0, 1.0)
    head: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self.task in ("rooms", "questions"), "task", self.task, "rooms or questions")
        rising = all(a < b for a, b in zip(self.low, self.high, strict=True))
        check(rising, "low", self.low, f"below {self.high}")


class Ptn(nn.Module):
    """Encoder and volume decoder."""

    def __init__(self, card: Card) -> None:
        super().__init__()
        self.settings, self._box = card.settings, (card.low, card.high)
        width, camera = card.settings.width, 3 * (card.task == "rooms")
        channels = (3, width, 2 * width, 4 * width)
        layers: list[nn.Module] = []
        for a, b in pairwise(channels):
            layers += [nn.Conv2d(a, b, 5, stride=2, padding=2), nn.ReLU()]
        self.pixels = nn.Sequential(*layers, nn.Flatten())
        last, wide = 4 * width * (card.settings.size // 8) ** 2, 16 * width
        self.code = nn.Sequential(
            *(nn.Linear(last + camera, wide), nn.ReLU()),
            *(nn.Linear(wide, wide), nn.ReLU()),
            *(nn.Linear(wide, 8 * width), nn.ReLU()),
        )
        first, middle, thin = 8 * width, 4 * width, 3 * width // 2
        self.volume = nn.Sequential(
            nn.Linear(8 * width + camera, 27 * first),
            nn.ReLU(),
            nn.Unflatten(1, (first, 3, 3, 3)),
            nn.ConvTranspose3d(first, middle, 4),  # 3 -> 6
            nn.ReLU(),
            nn.ConvTranspose3d(middle, thin, 5, stride=2),  # 6 -> 15
            nn.ReLU(),
            nn.ConvTranspose3d(thin, 1, 6, stride=2, padding=1),  # 15 -> 32
        )
        output = self.volume[-1]
        assert isinstance(output, nn.ConvTranspose3d)
        assert output.bias is not None
        nn.init.constant_(output.bias, FIRST_BIAS)

    @property
    def box(self) -> Tensor:
        """Corners of the volume, (2, 3)."""
        return next(self.parameters()).new_tensor(self._box)

    def encode(self, image: Tensor, camera: Tensor) -> Tensor:
        """Return codes, (B, 8 width), of images, (B, 3, S, S), and cameras, (B, 3 or 0)."""
        return self.code(torch.cat([self.pixels(image - 0.5), camera], dim=1))

    def decode(self, code: Tensor, camera: Tensor) -> Tensor:
        """Return occupancies from 0 to 1, (B, 32, 32, 32) by z, y and x."""
        return torch.sigmoid(self.volume(torch.cat([code, camera], dim=1))[:, 0])

    def forward(self, image: Tensor, camera: Tensor) -> Tensor:
        """Return the volumes of images: `decode` of `encode`."""
        return self.decode(self.encode(image, camera), camera)


def _optimisers(card: Card, model: Ptn) -> dict[str, Adam]:
    return {"adam": Adam(model.parameters(), weight_decay=card.settings.weight_decay)}


METHOD = Method("ptn", Card, Ptn, _optimisers)

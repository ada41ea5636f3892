"""An encoder of questions that does not mind how a picture is turned about its centre.

The camera of a question looks at the centre of the shape's bounding box, so turning the picture is
turning the shape about the viewing axis. In polar coordinates about the image's centre that is a
shift along the angle. Convolutions that close round the circle follow the shift, and a mean over
all angles does not see it: one of a rotation's three angles need not be learned.
"""

import itertools
import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from baselines.pix2shape.network.architecture import NetworkSpec, finished

CHANNELS = (256, 512, 1024)  # at an angle in 2, 4 and 8; multiplied by the width
BRIGHT = 0.99  # a pixel of at least this radiance in all channels counts as background
FAINT = 1e-3  # added to a channel's variance over the shape, so that noise is not blown up


def polar(image: Tensor) -> Tensor:
    """Return images (B, C, S, S) in polar coordinates, (B, C, S, 3 S / 8): angle, then radius.

    The radius reaches from the image's centre to the middle of its sides, beyond which no shape of
    a question shows.
    """
    size = image.shape[2]
    angle = (torch.arange(size, device=image.device) + 0.5) * (2 * math.pi / size)
    radius = (torch.arange(3 * size // 8, device=image.device) + 0.5) / (3 * size // 8)
    place = torch.stack([torch.cos(angle)[:, None] * radius, torch.sin(angle)[:, None] * radius], 2)
    return functional.grid_sample(
        image, place.expand(len(image), -1, -1, -1), padding_mode="border", align_corners=False
    )


def standardised(image: Tensor) -> Tensor:
    """Return polar images whose shape has mean 0 and variance 1 in each channel, and its mask.

    So much the less depends on the lights' colours. The background is 0: (B, 3, A, R) -> (B, 4, A,
    R). Pixels count by their radius, as they do in area.
    """
    shape = (image < BRIGHT).any(dim=1, keepdim=True).to(image.dtype)
    weight = shape * (torch.arange(image.shape[3], device=image.device) + 0.5)
    total = weight.sum(dim=(2, 3), keepdim=True).clamp(min=1)
    centred = (image - (image * weight).sum(dim=(2, 3), keepdim=True) / total) * shape
    variance = (centred**2 * weight).sum(dim=(2, 3), keepdim=True) / total
    return torch.cat([centred / torch.sqrt(variance + FAINT), shape], dim=1)


class RoundConv(nn.Module):
    """A convolution over angle and radius, (B, C, A, R), that closes round the circle."""

    def __init__(self, before: int, after: int, stride: int) -> None:
        super().__init__()
        self.layer = nn.Conv2d(before, after, 4 if stride == 2 else 3, stride, (0, 1), bias=False)
        self.norm = nn.BatchNorm2d(after)

    def forward(self, values: Tensor) -> Tensor:
        """(B, before, A, R) -> (B, after, A / stride, R / stride), normalised."""
        return self.norm(self.layer(functional.pad(values, (0, 0, 1, 1), mode="circular")))


class Block(nn.Module):
    """Two convolutions and a way around them."""

    def __init__(self, before: int, after: int, stride: int) -> None:
        super().__init__()
        self.first, self.second = RoundConv(before, after, stride), RoundConv(after, after, 1)
        other = before != after
        self.around = nn.Conv2d(before, after, 1, bias=False) if other else nn.Identity()
        self.shrink = nn.AvgPool2d(2) if stride == 2 else nn.Identity()

    def forward(self, values: Tensor) -> Tensor:
        """(B, before, A, R) -> (B, after, A / stride, R / stride)."""
        new = self.second(functional.relu(self.first(values)))
        return functional.relu(new + self.around(self.shrink(values)))


class PolarEncoder(nn.Module):
    """Image -> latent code, whose scene part depends on no angle about the image's centre.

    The view part is read from all angles, as they tell the view.
    """

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.spec = spec
        widths = [max(4, round(spec.width * channels)) for channels in CHANNELS]
        self.first = RoundConv(4, widths[0], 2)
        self.blocks = nn.Sequential(
            *(
                Block(a, b, stride)
                for before, after in itertools.pairwise(widths)
                for a, b, stride in ((before, after, 2), (after, after, 1))
            )
        )
        rings = widths[-1] * (3 * spec.size // 64)
        hidden = 2 * widths[-1]
        self.hidden, self.norm = nn.Linear(rings, hidden), nn.BatchNorm1d(hidden)
        self.last = nn.Linear(hidden, spec.z_scene)
        self.view = nn.Linear(rings * spec.size // 8, spec.z_view) if spec.z_view else None
        self.standard = nn.BatchNorm1d(spec.z, affine=False) if spec.standardised else nn.Identity()

    def forward(self, image: Tensor, _condition: Tensor) -> Tensor:
        """(B, 3, S, S), (B, 0) -> (B, z)."""
        with torch.autocast(image.device.type, enabled=False):  # differences of near numbers
            values = standardised(polar(image)).contiguous(memory_format=torch.channels_last)
        values = self.blocks(functional.relu(self.first(values)))
        hidden = functional.relu(self.norm(self.hidden(values.mean(dim=2).flatten(1))))
        parts = [self.last(hidden)]
        if self.view is not None:
            parts.append(self.view(values.flatten(1)))
        return finished(torch.cat(parts, dim=1), self.standard, self.spec)

"""Depth of a shape from one picture: the network of `baselines.relief` on nothing but the picture.

Lengths are in camera distances, as a picture does not tell how far away a shape is. The network
gives height, 1 - planar depth: how far a surface lies before the plane through the shape's centre.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from baselines.pix2shape.network.architecture import contrast
from baselines.relief import network as relief
from baselines.relief.network import UNet
from baselines.training import checkpoint
from baselines.training.checkpoint import Method

INPUTS = 3 + 3  # colours, and their contrast
BACKGROUND = 0.02  # largest difference from the corner's colour, of square roots of radiance


@dataclass(frozen=True)
class Settings(relief.Settings):
    """As of networks of relief, with other defaults."""

    iterations: int = 5000
    batch: int = 32


@dataclass(frozen=True)
class Card(checkpoint.Card):
    """The card of a network of depth."""

    settings: Settings


METHOD = Method("depth-match", Card, lambda card: UNet(card.settings, INPUTS))


def channels(image: Tensor) -> Tensor:
    """Return what the network sees of images, (B, 3, S, S) -> (B, 6, S, S).

    Images are square roots of radiance, as differences between dark faces matter as much.
    """
    return torch.cat([image, contrast(image)], dim=1)


def seen_depth(network: UNet, radiance: Tensor) -> Tensor:
    """Return planar depth in camera distances, (B, S, S), infinite on the background.

    It is the mean over the 8 turned and mirrored forms of each image. The background has the
    colour of the first pixel.

    Args:
        radiance: linear, (B, 3, S, S).
    """
    image = radiance.clamp(min=0).sqrt()
    heights = [symmetric(network.relief(channels(symmetric(image, k))), -k) for k in range(8)]
    shown = (image - image[:, :, :1, :1]).abs().amax(dim=1) > BACKGROUND
    return torch.where(shown, 1 - torch.stack(heights).mean(dim=0), torch.inf)


def symmetric(maps: Tensor, k: int) -> Tensor:
    """Return square maps (..., S, S) in one of 8 turned and mirrored forms; -k undoes k."""
    if k < 0:
        maps = maps.flip(-1) if k <= -4 else maps
        return torch.rot90(maps, k % 4, (-2, -1))
    maps = torch.rot90(maps, k % 4, (-2, -1))
    return maps.flip(-1) if k >= 4 else maps

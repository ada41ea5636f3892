"""Depth of a shape from one picture, and answers by it.

The network is that of `baselines.relief`, on nothing but the picture.

Lengths are in camera distances, as a picture does not tell how far away a shape is. The network
gives height, 1 - planar depth: how far a surface lies before the plane through the shape's centre.

Answers come from pictures and field of view alone: surfaces are turned until neither picture denies
the other. Two pictures of one shape show surfaces that differ by a rotation about its centre. A
picture denies a turned surface where it sees past it: where a point lies before the surface that
the picture shows at the point's pixel, or beside the outline. What lies behind is hidden, and may
be there.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from baselines.pix2shape.network.architecture import contrast
from baselines.relief import network as relief
from baselines.relief.network import UNet
from baselines.training import checkpoint
from baselines.training.baseline import Answers
from baselines.training.checkpoint import Method
from baselines.training.rotations import finer, rotation_grid
from iqtt import QuestionsFile, SplitSpec

INPUTS = 3 + 3  # colours, and their contrast
BACKGROUND = 0.02  # largest difference from the corner's colour, of square roots of radiance
NOTES = (
    "given in training: ground-truth depth and camera distances; given as input: the field of view,"
    " and that images of a question have one camera distance and the centre of the shape on their"
    " axis"
)
POINTS = 300  # of each surface
GRID = 4608  # rotations that are tried first
KEPT, TURNS = 12, 24  # how many of the best are turned further, and in how many ways each
FINER = (0.12, 0.07, 0.04, 0.02)  # radians of these turns, in each round
MOST = 0.2  # camera distances; a point is denied by no more


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


def answers_of(network: UNet, _card: Card, questions: QuestionsFile) -> Answers:
    """Return how a network of depth answers questions."""
    fov = (questions.cube_spec or SplitSpec()).fov_y_degrees

    def scores(images: Tensor) -> Tensor:
        depth = [seen_depth(network, pictures) for pictures in images]
        return -torch.stack([least_denials(maps, fov) for maps in depth])

    return Answers(scores, notes=NOTES)


@torch.inference_mode()
def least_denials(depth: Tensor, fov_y_degrees: float) -> Tensor:
    """Return how much the reference and each answer deny each other, (K,), under the best turn.

    Args:
        depth: planar, (1 + K, S, S), camera distances, infinite where nothing is; the reference
            first.
    """
    half = math.tan(math.radians(fov_y_degrees) / 2)
    points = [surface_points(maps, half) for maps in depth]
    start, least = torch.from_numpy(rotation_grid(GRID)), []
    for answer, shown in zip(points[1:], depth[1:], strict=True):

        def denied(turns: Tensor, answer: Tensor = answer, shown: Tensor = shown) -> Tensor:
            forth = denials(points[0], turns, shown, half)
            return forth + denials(answer, turns.transpose(1, 2), depth[0], half)

        turns, costs = start, denied(start)
        for angle in FINER:
            turns = finer(turns, -costs, KEPT, TURNS, angle)
            costs = denied(turns)
        least.append(costs.amin())
    return torch.stack(least)


def surface_points(depth: Tensor, half: float) -> Tensor:
    """Return points of what is seen, (POINTS, 3), about the shape's centre, the camera on +z.

    They are spread evenly over the pixels that show the shape, and repeat where there are fewer.
    Where nothing is shown, they are the centre.

    Args:
        half: tangent of half the field of view.
    """
    rows, columns = depth.isfinite().nonzero(as_tuple=True)
    if not len(rows):
        return depth.new_zeros(POINTS, 3)
    chosen = torch.linspace(0, len(rows) - 1, POINTS).round().long()
    rows, columns = rows[chosen], columns[chosen]
    along = depth[rows, columns]
    x, y = ((2 * place + 1) / len(depth) - 1 for place in (columns, rows))
    return torch.stack([half * x * along, -half * y * along, 1 - along], dim=1)


def denials(points: Tensor, turns: Tensor, shown: Tensor, half: float) -> Tensor:
    """Return by how much a picture denies turned points, (R,), the mean over the points.

    Args:
        points: (P, 3); turns: (R, 3, 3).
        shown: planar depth of the picture, (S, S), infinite where nothing is.
    """
    size = len(shown)
    turned = points @ turns.transpose(1, 2)
    away = (1 - turned[..., 2]).clamp(min=0.1)  # nothing comes so near to the camera
    column = ((turned[..., 0] / (away * half) + 1) * size / 2).long().clamp(0, size - 1)
    row = ((1 - turned[..., 1] / (away * half)) * size / 2).long().clamp(0, size - 1)
    before = shown.flatten()[row * size + column] - away
    return before.clamp(0, MOST).mean(dim=1)

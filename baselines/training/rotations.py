"""Rotations spread evenly, to be searched for the one that brings two shapes together."""

import math

import numpy as np
import torch
from torch import Tensor

from baselines.training.images import Array
from scenegen.common.rotations import rotation_matrix

PSI = 1.533751168755204288118041  # positive root of psi^4 = psi + 4


def rotation_grid(count: int) -> Array:
    """Return rotations spread evenly over SO(3), (count, 3, 3) float32.

    Super-Fibonacci spirals, two irrational winding rates on two circles: Alexa, "Super-Fibonacci
    Spirals: Fast, Low-Discrepancy Sampling of SO(3)" (CVPR 2022).
    """
    s = np.arange(count) + 0.5
    near, far = np.sqrt(s / count), np.sqrt(1 - s / count)
    a, b = 2 * math.pi * s / math.sqrt(2), 2 * math.pi * s / PSI
    quaternions = np.stack([near * np.sin(a), near * np.cos(a), far * np.sin(b), far * np.cos(b)])
    return rotation_matrix(quaternions).astype(np.float32)


def finer(turns: Tensor, merit: Tensor, kept: int, count: int, angle: float) -> Tensor:
    """Return the rotations of most merit, (kept, 3, 3), and each turned further in `count` ways.

    Args:
        turns: (R, 3, 3); merit: of each, (R,).
        angle: by which they are turned, radians.
    """
    top = turns[merit.topk(kept).indices]
    return torch.cat([top, (small_turns(count, angle)[None] @ top[:, None]).flatten(0, 1)])


def small_turns(count: int, angle: float) -> Tensor:
    """Return turns by an angle about axes spread evenly over the sphere, (count, 3, 3)."""
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, i * math.pi * (3 - math.sqrt(5))
    flat = np.sqrt(1 - z * z)
    axis = np.stack([flat * np.cos(turn), flat * np.sin(turn), z])
    quaternion = np.concatenate(
        [np.full((1, count), math.cos(angle / 2)), math.sin(angle / 2) * axis]
    )
    return torch.from_numpy(rotation_matrix(quaternion)).float()

"""Rotations spread evenly, to be searched for the one that brings two shapes together."""

import math

import numpy as np

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

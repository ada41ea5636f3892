"""Tiny Perspective Transformer Nets, and volumes of what a file says is there."""

from typing import Any

import numpy as np
import torch

from baselines.ptn.network import METHOD, VOXELS, Card, Ptn, Settings
from baselines.training.checkpoint import new_state

torch.set_num_threads(1)
TINY: dict[str, Any] = {"width": 2, "size": 16, "batch": 2, "rays": 40, "samples": 12}


def card_of(task: str = "rooms", **settings: Any) -> Card:
    """Return a card of the unit box, or of a cube around 0."""
    low, high = ((0, 0, 0), (1, 0.5, 1)) if task == "rooms" else ((-1,) * 3, (1,) * 3)
    return Card("ptn", Settings(**{**TINY, **settings}), task=task, low=low, high=high)


def tiny(task: str = "rooms", **settings: Any) -> Ptn:
    """Return an untrained model of such a card."""
    return new_state(METHOD, card_of(task, **settings)).network.eval()


def voxel_centres(model: Ptn) -> Any:
    """Return the places of a volume's values, (D, D, D, 3) by z, y and x."""
    unit = (np.arange(VOXELS) + 0.5) / VOXELS
    z, y, x = np.meshgrid(unit, unit, unit, indexing="ij")
    low, high = model.box.double().numpy()
    return low + np.stack([x, y, z], axis=-1) * (high - low)


def volume_of(distance: Any, edge: float) -> torch.Tensor:
    """Return occupancy, (1, D, D, D), that falls from 1 to 0 around a surface, over `edge`."""
    return torch.from_numpy(np.clip(0.5 - distance / edge, 0, 1).astype(np.float32))[None]


def cubes_volume(model: Ptn, cubes: Any, rotation: Any, radius: float = 3.0) -> torch.Tensor:
    """Return the volume of a polycube, turned about its box's centre; a unit is `radius` edges."""
    places = radius * voxel_centres(model) @ rotation  # in the shape's frame
    middle = (cubes.min(axis=0) + cubes.max(axis=0) + 1) / 2
    inside = [np.abs(places - (c + 0.5 - middle)).max(axis=-1) - 0.5 for c in cubes]
    return volume_of(np.min(inside, axis=0), 0.2)

"""Batches for the networks: images, and what the model is told about them."""

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from baselines.pix2shape.network.model import Views, mapped
from baselines.pix2shape.network.surfels import Scene


@dataclass(frozen=True, eq=False)
class Relief:
    """What matching found in V views of each image's scene.

    Attributes:
        values: how far surfaces lie before the empty room, scene units, (B, V, S, S).
        world_from_camera: of these views, (B, V, 4, 4).
    """

    values: Tensor
    world_from_camera: Tensor


@dataclass(frozen=True, eq=False)
class Batch:
    """Images and what the model is told about them.

    Attributes:
        image: linear radiance, (B, 3, S, S).
        depth: planar, scene units, (B, S, S), NaN where there is no surface; None unless depth
            supervision is on.
        relief: None unless training learns from matching.
    """

    image: Tensor
    views: Views
    depth: Tensor | None = None
    relief: Relief | None = None

    def to(self, device: torch.device) -> "Batch":
        """Return the batch on another device."""
        return mapped(self, lambda values: values.to(device, non_blocking=True))


def as_batch(items: dict[str, Tensor], fov_y_degrees: float) -> Batch:
    """Return the batch of the collated fields of items."""
    relief = Relief(items["relief"], items["relief_cameras"]) if "relief" in items else None
    return Batch(items["image"], as_views(items, fov_y_degrees), items.get("depth"), relief)


def as_views(items: dict[str, Tensor], fov_y_degrees: float) -> Views:
    """Return the views of the collated fields of items."""
    values = {f.name: items[f.name] for f in fields(Scene) if f.name in items}
    scene = Scene(fov_y_degrees, **values)
    return Views(items["condition"], scene, items.get("background"), items.get("world_from_camera"))

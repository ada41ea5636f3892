"""Batches for the networks: images, and what the model is told about them.

Images of questions may be turned about the viewing axis, and mirrored. The camera looks at the
centre of the shape's bounding box, so a turned picture shows the same shape turned about the
viewing axis, under lights that turned with it. A question whose pictures are all mirrored asks of
the mirror images what it asked before, and has the same answer.
"""

from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.network.model import Views
from baselines.pix2shape.network.surfels import Scene
from baselines.training.images import mapped


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


def turned(batch: Batch, angle: Tensor, mirror: Tensor) -> Batch:
    """Return a batch whose images are mirrored, left to right, and then turned, with their lights.

    Args:
        angle: counter-clockwise, radians, (B,).
        mirror: which images are mirrored, (B,) booleans.
    """
    sign = torch.where(mirror, -1.0, 1.0)
    cosine, sine = torch.cos(angle), torch.sin(angle)
    # From places in the new image, x to the right and y down, to those in the old one.
    back = torch.stack([sign * cosine, -sign * sine, sine, cosine], dim=1).view(-1, 2, 2)
    place = functional.affine_grid(
        torch.cat([back, torch.zeros_like(back[..., :1])], dim=2),
        list(batch.image.shape),
        align_corners=False,
    )
    # The corners lie beyond the image, where there is background as at its border.
    image = functional.grid_sample(batch.image, place, padding_mode="border", align_corners=False)
    x, y, z = batch.views.scene.light_position.unbind(dim=2)
    x, cosine, sine = sign[:, None] * x, cosine[:, None], sine[:, None]
    lights = torch.stack([cosine * x - sine * y, sine * x + cosine * y, z], dim=2)
    scene = replace(batch.views.scene, light_position=lights)
    return replace(batch, image=image, views=replace(batch.views, scene=scene))

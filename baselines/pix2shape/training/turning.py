"""Images of questions turned about the viewing axis, and mirrored.

The camera looks at the centre of the shape's bounding box, so a turned picture shows the same shape
turned about the viewing axis, under lights that turned with it. A question whose pictures are all
mirrored asks of the mirror images what it asked before, and has the same answer.
"""

from dataclasses import replace

import torch
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.batch import Batch


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

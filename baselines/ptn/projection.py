"""The perspective transformer: voxels are sampled along the rays of a camera.

Yan et al., "Perspective Transformer Nets" (NeurIPS 2016): the places of samples are transformed
from the camera to the volume, the volume is interpolated there trilinearly, and the silhouette is
the largest value along each ray. Here the samples of a ray are spread evenly between the places
where it enters and leaves the volume's box, instead of over planes of depth that are the same for
all rays, so that none is wasted outside. Functions of tensors; places are in the volume's frame.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional


@dataclass(frozen=True, eq=False)
class Batch:
    """B images, with R rays each, over all of its views, in the frame of the image's volume.

    Attributes:
        image: linear radiance, (B, 3, S, S).
        camera: position of the image's camera, (B, 3); (B, 0) where the model is not told it.
        origin, direction: of rays through pixels' centres, (B, R, 3).
        silhouette: whether a ray meets the shape, 0 or 1, (B, R).
    """

    image: Tensor
    camera: Tensor
    origin: Tensor
    direction: Tensor
    silhouette: Tensor


def sampled(volume: Tensor, box: Tensor, points: Tensor) -> Tensor:
    """Interpolate volumes trilinearly.

    Args:
        volume: (B, D, D, D) by z, y and x; a value stands for the centre of its voxel.
        box: lowest and highest corner of the volume, (2, 3), x, y, z.
        points: (B, N, 3).

    Returns the values, (B, N); beyond the box they fall to 0 within half a voxel.
    """
    low, high = box
    grid = (2 * (points - low) / (high - low) - 1)[:, :, None, None]
    values = functional.grid_sample(
        volume[:, None], grid, padding_mode="zeros", align_corners=False
    )
    return values[:, 0, :, 0, 0]


def crossing(box: Tensor, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
    """Return where rays enter and leave a box, in lengths of their directions, (..., 2 of them).

    A ray that misses the box has both at the same place; one that starts inside enters at 0.
    """
    small = direction.abs() < 1e-12
    inverse = 1 / torch.where(small, torch.full_like(direction, 1e-12), direction)
    sides = (box[:, None] - origin.reshape(-1, 3)) * inverse.reshape(-1, 3)
    enter = sides.amin(dim=0).amax(dim=-1).clamp(min=0).reshape(origin.shape[:-1])
    leave = sides.amax(dim=0).amin(dim=-1).reshape(origin.shape[:-1])
    return enter, torch.maximum(enter, leave)


def along(
    volume: Tensor, box: Tensor, origin: Tensor, direction: Tensor, samples: int
) -> tuple[Tensor, Tensor]:
    """Sample volumes along rays.

    Args:
        volume: (B, D, D, D), as for `sampled`.
        origin, direction: of R rays each, (B, R, 3).
        samples: number of places along each ray.

    Returns values and places, (B, R, samples) each; a place is in lengths of the ray's direction.
    """
    enter, leave = crossing(box, origin, direction)
    middle = (torch.arange(samples, dtype=origin.dtype, device=origin.device) + 0.5) / samples
    reach = enter[..., None] + (leave - enter)[..., None] * middle
    points = origin[:, :, None] + direction[:, :, None] * reach[..., None]
    values = sampled(volume, box, points.flatten(1, 2)).view(reach.shape)
    return torch.where((leave > enter)[..., None], values, 0.0), reach


def silhouettes(
    volume: Tensor, box: Tensor, origin: Tensor, direction: Tensor, samples: int
) -> Tensor:
    """Return the largest value along each ray, (B, R); arguments as for `along`."""
    return along(volume, box, origin, direction, samples)[0].amax(dim=-1)


def first_hit(
    volume: Tensor,
    box: Tensor,
    origin: Tensor,
    direction: Tensor,
    samples: int,
    threshold: float = 0.5,
) -> Tensor:
    """Return where the value along each ray first exceeds a threshold, (B, R), NaN where never.

    The result is in lengths of the ray's direction, which is planar depth where directions have z
    = -1 in the camera's frame. Between two samples the value is taken to be linear.
    """
    values, reach = along(volume, box, origin, direction, samples)
    above = values > threshold
    place = above.int().argmax(dim=-1, keepdim=True)
    before = (place - 1).clamp(min=0)
    (v0, v1), (r0, r1) = (
        [numbers.gather(-1, at).squeeze(-1) for at in (before, place)]
        for numbers in (values, reach)
    )
    share = torch.where(v1 > v0, (threshold - v0) / (v1 - v0).clamp(min=1e-12), 1.0)
    return torch.where(above.any(dim=-1), r0 + (r1 - r0) * share.clamp(0, 1), torch.nan)


def outward(volume: Tensor, box: Tensor, points: Tensor) -> Tensor:
    """Return unit normals, (B, N, 3): where the value falls fastest, by differences of a voxel.

    Zero where the value is the same all around.
    """
    step = (box[1] - box[0]) / volume.shape[-1]
    slopes = [
        (sampled(volume, box, points - move) - sampled(volume, box, points + move)) / (2 * size)
        for move, size in zip(torch.diag(step), step, strict=True)
    ]
    return functional.normalize(torch.stack(slopes, dim=-1), dim=-1)

"""The loss of shape: errors of relief inside objects that no shift of a whole object explains."""

import torch
from torch import Tensor

SLOPE = 2.0  # weight of differences between neighbours


def shape_loss(errors: Tensor, inside: Tensor) -> Tensor:
    """Return mean |e - its object's mean e| + SLOPE * mean |e - its neighbour's e|.

    The first is what `shape_error` scores (with medians); the second teaches normals. Neighbours
    are the pixels below and to the right, where they lie inside the same object.

    Args:
        errors: of relief, scene units, (B, S, S).
        inside: the object that each pixel lies inside, (B, S, S), int; 0 for none.
    """
    image = torch.arange(len(inside), device=inside.device)[:, None, None]
    place = inside > 0
    own = errors[place]
    objects = (inside + image * (1 + int(inside.max())))[place]
    objects = torch.unique(objects, return_inverse=True)[1]
    pixels = torch.bincount(objects)
    means = own.new_zeros(len(pixels)).index_add(0, objects, own) / pixels
    slopes = []
    for axis in (1, 2):
        first, second = (inside.narrow(axis, i, inside.shape[axis] - 1) for i in (0, 1))
        slopes.append(errors.diff(dim=axis)[(first == second) & (first > 0)])
    return _mean_size(own - means[objects]) + SLOPE * _mean_size(torch.cat(slopes))


def _mean_size(values: Tensor) -> Tensor:
    return values.abs().sum() / max(1, len(values))

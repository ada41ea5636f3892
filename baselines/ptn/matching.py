"""Which answer shows the reference's shape: by volumes turned until they fit, and by codes.

Two images of one shape give volumes that differ by a rotation about the shape's centre. Rotations
are searched from a grid over SO(3) to finer and finer turns of the best ones; the fit is the
correlation of occupancies within the ball that all rotations keep.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from baselines.ptn.network import VOXELS, Ptn
from baselines.training.rotations import finer, rotation_grid

COARSE, FINE = 8, 16  # voxels a side of the volumes that are compared, at first and at last
GRID = 1200  # rotations that are tried first, some 20 degrees apart
KEPT, TURNS = 4, 32  # how many of the best are turned further, and in how many ways each
FINER = ((0.2, COARSE), (0.1, FINE))  # radians of these turns, and voxels a side, in each round
CHUNK = 256  # rotations at a time
FEATURES = ("fit of volumes", "nearness of codes")
FINELY = 4
RIDGE = 1e-3  # keeps the head's weights finite where labels are few


@torch.inference_mode()
def best_fits(reference: Tensor, answers: Tensor) -> Tensor:
    """Return how well a volume fits each of K others when it is turned, (K,), 1 at best.

    Args:
        reference: occupancies, (D, D, D) by z, y, x, D a multiple of 16; the turn is about the
            middle.
        answers: (K, D, D, D).
    """
    start = torch.from_numpy(rotation_grid(GRID))
    coarse = _level(reference, answers, COARSE).fits(start)
    best = []
    for answer, first in zip(answers, coarse.unbind(dim=1), strict=True):
        turns, fits = start, first
        for angle, side in FINER:
            turns = finer(turns, fits, KEPT, TURNS, angle)
            fits = _level(reference, answer[None], side).fits(turns)[:, 0]
        best.append(fits.amax())
    return torch.stack(best)


@dataclass(frozen=True, eq=False)
class _Level:
    """Volumes at one resolution: the reference, (S, S, S), and K answers at P points, (K, P).

    The points are the voxels of the ball. The reference is interpolated to FINELY times as many
    voxels a side, so that a turned volume is a lookup of the nearest ones.
    """

    reference: Tensor
    answers: Tensor
    points: Tensor

    def fits(self, rotations: Tensor) -> Tensor:
        """Return how well the reference fits the answers when it is turned, (R, K)."""
        side = len(self.reference)
        voxels, parts = self.reference.flatten(), []
        strides = torch.tensor([1.0, side, side * side])
        for chunk in torch.split(rotations, CHUNK):
            places = self.points @ chunk  # the inverse of each rotation, on the left
            nearest = places.add_(1).mul_(side / 2).floor_().clamp_(0, side - 1) @ strides
            values = voxels.index_select(0, nearest.flatten().int()).view(nearest.shape)
            parts.append(_centred(values))
        return torch.cat(parts) @ self.answers.T


def _level(reference: Tensor, answers: Tensor, side: int) -> _Level:
    small = functional.avg_pool3d(torch.cat([reference[None], answers])[:, None], VOXELS // side)
    place = (torch.arange(side) + 0.5) * 2 / side - 1
    points = torch.stack(torch.meshgrid(place, place, place, indexing="ij")[::-1], dim=-1)
    inside = points.norm(dim=-1) <= 1
    fine = functional.interpolate(small[:1], scale_factor=FINELY, mode="trilinear")[0, 0]
    return _Level(fine, _centred(small[1:, 0][:, inside]), points[inside])


def _centred(values: Tensor) -> Tensor:
    return functional.normalize(values - values.mean(dim=-1, keepdim=True), dim=-1)


@torch.inference_mode()
def features(model: Ptn, images: Tensor) -> Tensor:
    """Return what tells answers apart, (Q, K, 2): `FEATURES`, more is nearer.

    Args:
        images: of questions, (Q, 1 + K, 3, S, S), the reference first.
    """
    questions, pictures = images.shape[:2]
    none = images.new_empty(questions * pictures, 0)
    code = model.encode(images.flatten(0, 1), none)
    volumes = model.decode(code, none).view(questions, pictures, *[VOXELS] * 3)
    code = code.view(questions, pictures, -1)
    nearness = -(code[:, 1:] - code[:, :1]).norm(dim=-1)
    fits = torch.stack([best_fits(volume[0], volume[1:]) for volume in volumes])
    return torch.stack([fits, nearness], dim=-1)


def fitted_head(values: Tensor, right: Tensor) -> tuple[float, ...]:
    """Return weights of features that make right answers most likely, by a softmax over answers.

    Args:
        values: as `features` gives them, (Q, K, F); right: (Q,).
    """
    spread = values.std(dim=(0, 1)).clamp(min=1e-9).double()
    scaled = values.double() / spread
    weights = torch.zeros(values.shape[-1], dtype=torch.double, requires_grad=True)
    optimiser = torch.optim.LBFGS([weights], max_iter=100, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        optimiser.zero_grad()
        total = functional.cross_entropy(scaled @ weights, right) + RIDGE * weights.square().sum()
        total.backward()  # type: ignore[no-untyped-call]
        return total

    optimiser.step(loss)  # type: ignore[no-untyped-call]
    return tuple((weights.detach() / spread).tolist())

"""The networks: image -> Gaussian over codes -> offsets of a mesh; and the head that labels train.

A small convolutional encoder and a perceptron, sized for two cores. The paper infers codes in
several recurrent steps; this is its single-step form, an ordinary variational autoencoder.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.optim import Adam

from baselines.training import checkpoint
from baselines.training.checkpoint import Method, Ranges
from scenegen.common.records import check

Array = NDArray[Any]
SMOOTHING = 6.0  # weight of the Laplacian; offsets that change from vertex to vertex are damped
CHANNELS = (32, 64, 128)  # of the encoder's layers, each of which halves the image
HIDDEN = 256
HEAD = 64


@cache
def icosphere(subdivisions: int = 2) -> tuple[Array, Array]:
    """Return vertices on the unit sphere, (V, 3), and triangles, (F, 3), outside on the left.

    Two subdivisions give 162 vertices and 320 triangles. The vertices of a coarser icosphere are
    the first ones of a finer one.
    """
    golden = (1 + 5**0.5) / 2
    signs = [(a, b * golden) for a in (1.0, -1.0) for b in (1.0, -1.0)]
    corners = np.array([np.roll((0.0, a, b), turn) for turn in range(3) for a, b in signs])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    near = np.linalg.norm(corners[:, None] - corners, axis=2) < 1.1  # an edge is 1.051 long
    triples = [(i, j, k) for i in range(12) for j in range(i) for k in range(j)]
    faces = np.array(
        [t for t in triples if near[t[0], t[1]] and near[t[1], t[2]] and near[t[0], t[2]]]
    )
    inward = np.linalg.det(corners[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    for _ in range(subdivisions):
        corners, faces = _subdivided(corners, faces)
    return corners, faces


def _subdivided(corners: Array, faces: Array) -> tuple[Array, Array]:
    """Return the mesh with each triangle cut into four, the new vertices pushed to the sphere."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    middles = corners[unique].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = faces.T
    ab, bc, ca = (len(corners) + number.reshape(-1, 3)).T
    four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([corners, middles]), np.concatenate([np.stack(t, axis=1) for t in four])


@cache
def smoothing() -> Array:
    """Return the matrix that smooths values of the vertices, (V, V): (1 + SMOOTHING L)^-1.

    L is the Laplacian of the mesh's graph, divided by the number of neighbours. A constant stays
    as it is; what differs from one vertex to the next is damped.
    """
    corners, faces = icosphere()
    linked = np.zeros((len(corners), len(corners)))
    linked[faces, np.roll(faces, 1, axis=1)] = 1.0
    linked = np.maximum(linked, linked.T)
    laplacian = np.eye(len(corners)) - linked / linked.sum(axis=1, keepdims=True)
    return np.linalg.inv(np.eye(len(corners)) + SMOOTHING * laplacian)


@dataclass(frozen=True)
class Settings(checkpoint.Settings):
    """Settings of model and training.

    Attributes:
        size: a multiple of 8.
        code: length of a code.
        pairs: antithetic pairs of meshes that are rendered for each image of a batch.
        width: standard deviation of the meshes' offsets about the decoder's, before smoothing,
            where the sphere has radius 1.
        noise: standard deviation of pixels about the rendered ones, in radiance.
        spread: standard deviation of offsets before anything is seen, about the sphere.
        learning_rate: it falls linearly to 0 over the second half of training.
    """

    RANGES: ClassVar[Ranges] = {
        "size": (16, 128), "code": (2, 1024), "batch": (1, 1024), "pairs": (1, 256),
        "width": (1e-4, 1.0), "noise": (1e-3, 10.0), "spread": (1e-3, 1e6),
    }  # fmt: skip
    size: int = 32
    code: int = 64
    iterations: int = 2_000
    batch: int = 32
    pairs: int = 4
    width: float = 0.2
    noise: float = 0.1
    spread: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self.size % 8 == 0, "size", self.size, "a multiple of 8")


@dataclass(frozen=True)
class Card(checkpoint.Card):
    """The card of a model; `labels` is 0 where the head was not trained."""

    settings: Settings


class Model(nn.Module):
    """Encoder, decoder and head; the mesh has 162 vertices."""

    sphere: Tensor
    smooth: Tensor

    def __init__(self, card: Card) -> None:
        super().__init__()
        size, code = card.settings.size, card.settings.code
        corners, faces = icosphere()
        self.faces = faces
        self.register_buffer("sphere", torch.from_numpy(corners).float(), persistent=False)
        smooth = torch.from_numpy(smoothing()).float()
        self.register_buffer("smooth", smooth, persistent=False)
        layers: list[nn.Module] = []
        before = 3
        for channels in CHANNELS:
            layers += [nn.Conv2d(before, channels, 4, 2, 1), nn.GroupNorm(8, channels), nn.ReLU()]
            before = channels
        flat = before * (size // 8) ** 2
        hidden = [nn.Flatten(), nn.Linear(flat, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 2 * code)]
        self.encoder = nn.Sequential(*layers, *hidden)
        self.decoder = nn.Sequential(
            nn.Linear(code, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 2 * HIDDEN), nn.ReLU(),
            nn.Linear(2 * HIDDEN, corners.size),
        )  # fmt: skip
        last = self.decoder[-1]
        assert isinstance(last, nn.Linear)
        nn.init.normal_(last.weight, std=0.01)
        nn.init.zeros_(last.bias)
        self.head = Head(code)

    def encode(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Return means and log variances of q(z | x), (B, code) each, of images (B, 3, S, S)."""
        mean, log_variance = self.encoder(1 - image).chunk(2, dim=1)
        return mean, log_variance.clamp(-10, 4)

    def offsets(self, code: Tensor) -> Tensor:
        """Return the offsets of codes, (B, V, 3), not yet smoothed; the sphere has radius 1."""
        return self.decoder(code).view(len(code), -1, 3)

    def vertices(self, offsets: Tensor) -> Tensor:
        """Return the vertices that offsets, (..., V, 3), give: sphere + smoothed offsets.

        The object is taken to be centred, so the mesh's middle is put at the depth of the sphere's:
        one image cannot tell a large object from a small one that is near.
        """
        smoothed = offsets.transpose(-1, -2) @ self.smooth.T  # one product for all meshes
        vertices = self.sphere + smoothed.transpose(-1, -2)
        middle = vertices.mean(dim=-2, keepdim=True) * vertices.new_tensor([0.0, 0.0, 1.0])
        return vertices - middle


class Head(nn.Module):
    """Scores answers by a learned comparison of two codes; trained on labels alone."""

    shift: Tensor
    scale: Tensor

    def __init__(self, code: int) -> None:
        super().__init__()
        self.register_buffer("shift", torch.zeros(code))
        self.register_buffer("scale", torch.ones(code))
        self.layers = nn.Sequential(nn.Linear(2 * code, HEAD), nn.ReLU(), nn.Linear(HEAD, 1))

    def forward(self, codes: Tensor) -> Tensor:
        """Return scores of the answers, (Q, A), of codes (Q, 1 + A, code), the reference first."""
        codes = (codes - self.shift) / self.scale
        reference, answers = codes[:, :1], codes[:, 1:]
        pairs = torch.cat([(reference - answers).abs(), reference * answers], dim=2)
        return self.layers(pairs).squeeze(2)


@torch.no_grad()
def codes_of(model: Model, images: Tensor) -> Tensor:
    """Return the codes' means, (1, 1 + A, code), of the images of one question."""
    return model.encode(images.flatten(0, 1))[0][None]


def divergence(mean: Tensor, log_variance: Tensor) -> Tensor:
    """Return KL(q || N(0, 1)) of Gaussians with means and log variances (B, D), in nats, (B,)."""
    return 0.5 * (mean**2 + log_variance.exp() - 1 - log_variance).sum(dim=1)


def _optimisers(_card: Card, model: Model) -> dict[str, Adam]:
    return {"adam": Adam([*model.encoder.parameters(), *model.decoder.parameters()])}


METHOD = Method("rezende", Card, Model, _optimisers)

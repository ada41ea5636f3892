"""Answers to questions: from meshes compared under all rotations, or from the trained head."""

from functools import cache

import numpy as np
import torch
from torch import Tensor

from baselines.rezende.network import Card, Model, codes_of
from baselines.training.baseline import Answers
from baselines.training.images import Array
from baselines.training.rotations import rotation_grid
from iqtt import QuestionsFile

ROTATIONS = 512  # tried for each answer; any rotation is within about 20 degrees of one
FINE, STEPS = 8, 8  # rotations that are refined, and steps of that
BATCH = 64  # images at a time
COARSE = 42  # vertices of the reference that are turned: those of the icosphere before the last cut


def answers_of(model: Model, card: Card, _questions: QuestionsFile) -> Answers:
    """Return how a model answers questions.

    With weights that saw no labels, an answer's score is minus the distance of its mesh from the
    reference's, under the best rotation; else it is the head's.
    """

    def scores(images: Tensor) -> Tensor:
        return model.head(codes_of(model, images)) if card.labels else mesh_scores(model, images)

    return Answers(scores)


@torch.no_grad()
def meshes_of(model: Model, image: Array) -> Array:
    """Return the meshes of images (N, 3, S, S) by the codes' means, (N, V, 3), sphere radius 1."""
    meshes = [
        model.vertices(model.offsets(model.encode(torch.from_numpy(part))[0])).numpy()
        for part in np.split(image, range(BATCH, len(image), BATCH))
    ]
    return np.concatenate(meshes)


def mesh_scores(model: Model, images: Tensor) -> Tensor:
    """Return the scores of one question's answers by their meshes, (1, A) float64."""
    meshes = meshes_of(model, images[0].numpy())
    return torch.tensor(
        [[-mesh_distance(meshes[0], mesh) for mesh in meshes[1:]]], dtype=torch.double
    )


def mesh_distance(mesh: Array, other: Array) -> float:
    """Return the distance of two meshes, (V, 3) each, under the best rotation that is found.

    Both are moved to their centres of mass first. The distance is the mean from the vertices of one
    to the nearest of the other, plus the mean the other way round. ROTATIONS are tried with COARSE
    vertices of the one, and the best FINE of them are refined. Mirror images are not rotations of
    each other, so they differ.
    """
    mesh, other = (vertices - vertices.mean(axis=0) for vertices in (mesh, other))
    chosen = rotations()[
        np.argpartition(_distances(mesh[:COARSE], other, rotations()), FINE)[:FINE]
    ]
    return float(_distances(mesh, other, refined(mesh, other, chosen)).min())


def refined(mesh: Array, other: Array, turns: Array) -> Array:
    """Return rotations, (R, 3, 3), moved towards the nearest ones at which two meshes agree.

    Each step finds the rotation that best takes vertices to those that are nearest now (iterative
    closest points: Besl and McKay, PAMI 14, 1992; the rotation by Kabsch, Acta Cryst. A32, 1976).
    """
    for _ in range(STEPS):
        nearest = other[_squared(mesh, other, turns).argmin(axis=2)]
        left, _, right = np.linalg.svd(np.swapaxes(nearest, 1, 2) @ mesh)
        left[:, :, 2] *= np.linalg.det(left @ right)[:, None]  # no reflection
        turns = left @ right
    return turns


def _squared(mesh: Array, other: Array, turns: Array) -> Array:
    """Return squared distances of all vertices of one, turned, to all of the other, (R, V, W)."""
    turned = mesh @ turns.swapaxes(1, 2)
    square: Array = (mesh**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * turned @ other.T
    return square.clip(0)


def _distances(mesh: Array, other: Array, turns: Array) -> Array:
    """Return the distance of two meshes for each rotation of the first, (R,)."""
    squared = _squared(mesh, other, turns)
    there, back = (np.sqrt(squared.min(axis=axis)).mean(axis=1) for axis in (2, 1))
    return np.asarray(there + back)


@cache
def rotations() -> Array:
    """Return the rotations that are tried, (ROTATIONS, 3, 3) float32."""
    return rotation_grid(ROTATIONS)

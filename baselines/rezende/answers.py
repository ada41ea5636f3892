"""Answers to questions: from meshes compared under all rotations, or from the trained head."""

from functools import cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.rezende.network import METHOD, Model, codes_of
from baselines.rezende.reconstruct import meshes_of
from baselines.training.checkpoint import bundled, load_weights
from baselines.training.images import Array
from baselines.training.questions import Progress, each_question, is_question_file, open_test
from baselines.training.rotations import rotation_grid
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable

FILES = Path(__file__).with_name("files")
ROTATIONS = 512  # tried for each answer; any rotation is within about 20 degrees of one
FINE, STEPS = 8, 8  # rotations that are refined, and steps of that
COARSE = 42  # vertices of the reference that are turned: those of the icosphere before the last cut


def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, and their scores, as `baselines.training` says.

    With weights that saw no labels, an answer's score is minus the distance of its mesh from the
    reference's, under the best rotation; else it is the head's.
    """
    if not is_question_file(data):
        hint = "it reconstructs single objects without background; docs/baselines.md says why"
        raise SpecError(data, "rooms", "questions, the only data that rezende answers", hint)
    model, card = load_weights(weights or bundled(FILES, METHOD), METHOD)
    check_writable(Path(out), overwrite)

    def scores(images: Tensor) -> Tensor:
        return model.head(codes_of(model, images)) if card.labels else mesh_scores(model, images)

    with open_test(data, card.settings.size) as questions:
        values = each_question(questions, card.settings.size, scores, 1, progress=progress)
    numbers = values.double().numpy()
    write_answers(out, data, method=METHOD.name, scores=numbers, overwrite=overwrite)


def mesh_scores(model: Model, images: Tensor) -> Tensor:
    """Return the scores of one question's answers by their meshes, (1, A) float64."""
    meshes = meshes_of(model, images[0].numpy())
    return torch.tensor(
        [[-mesh_distance(meshes[0], mesh) for mesh in meshes[1:]]], dtype=torch.double
    )


def mesh_distance(one: Array, other: Array) -> float:
    """Return the distance of two meshes, (V, 3) each, under the best rotation that is found.

    Both are moved to their centres of mass first. The distance is the mean from the vertices of one
    to the nearest of the other, plus the mean the other way round. ROTATIONS are tried with COARSE
    vertices of the one, and the best FINE of them are refined. Mirror images are not rotations of
    each other, so they differ.
    """
    one, other = (mesh - mesh.mean(axis=0) for mesh in (one, other))
    chosen = rotations()[np.argpartition(_distances(one[:COARSE], other, rotations()), FINE)[:FINE]]
    return float(_distances(one, other, refined(one, other, chosen)).min())


def refined(one: Array, other: Array, turns: Array) -> Array:
    """Return rotations, (R, 3, 3), moved towards the nearest ones at which two meshes agree.

    Each step finds the rotation that best takes vertices to those that are nearest now (iterative
    closest points: Besl and McKay, PAMI 14, 1992; the rotation by Kabsch, Acta Cryst. A32, 1976).
    """
    for _ in range(STEPS):
        nearest = other[_squared(one, other, turns).argmin(axis=2)]
        left, _, right = np.linalg.svd(np.swapaxes(nearest, 1, 2) @ one)
        left[:, :, 2] *= np.linalg.det(left @ right)[:, None]  # no reflection
        turns = left @ right
    return turns


def _squared(one: Array, other: Array, turns: Array) -> Array:
    """Return squared distances of all vertices of one, turned, to all of the other, (R, V, W)."""
    turned = one @ turns.swapaxes(1, 2)
    square: Array = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * turned @ other.T
    return square.clip(0)


def _distances(one: Array, other: Array, turns: Array) -> Array:
    """Return the distance of two meshes for each rotation of the first, (R,)."""
    squared = _squared(one, other, turns)
    there, back = (np.sqrt(squared.min(axis=axis)).mean(axis=1) for axis in (2, 1))
    return np.asarray(there + back)


@cache
def rotations() -> Array:
    """Return the rotations that are tried, (ROTATIONS, 3, 3) float32."""
    return rotation_grid(ROTATIONS)

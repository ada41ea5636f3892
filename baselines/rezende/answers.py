"""Answers to questions: from meshes compared under all rotations, or from the trained head."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from baselines.checkpoints import load_weights
from baselines.pix2shape.data.rooms import check_reducible, is_question_file
from baselines.rezende.card import RECIPE
from baselines.rezende.head import codes_of
from baselines.rezende.images import question_images
from baselines.rezende.network import Model
from baselines.rezende.reconstruct import meshes_of
from iqtt.files.reader import open_questions, parts
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError
from scenegen.common.rotations import rotation_matrix
from scenegen.files.new_file import check_writable

Array = NDArray[Any]
METHOD = "rezende"
WEIGHTS = Path(__file__).with_name("files") / "questions-0.safetensors"
ROTATIONS = 512  # tried for each answer; any rotation is within about 20 degrees of one
FINE, STEPS = 8, 8  # rotations that are refined, and steps of that
COARSE = 42  # vertices of the reference that are turned: those of the icosphere before the last cut
Progress = Callable[[int, int], Any]


def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path = WEIGHTS,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, and the score of each, from images alone.

    With weights that saw no labels, an answer's score is minus the distance of its mesh from the
    reference's, under the best rotation; else it is the head's.

    Args:
        data: a file such as iqtt-test.h5; its answers are not read.
        weights: by default those of the package, trained without labels.
        progress: called with the number of questions done since the last call, and of all.

    Raises SpecError for rooms, which the method cannot do, and where images do not suit the
    weights; FileFormatError, OSError.
    """
    if not is_question_file(data):
        hint = "it reconstructs single objects without background; docs/baselines.md says why"
        raise SpecError(data, "rooms", "questions, the only data that rezende answers", hint)
    state = load_weights(weights, RECIPE)
    model, card = state.network, state.card
    check_writable(Path(out), overwrite)
    if len(parts(data)) > 1:
        raise SpecError(data, "training questions", "questions to answer, such as iqtt-test.h5")
    with open_questions(data) as questions:
        check_reducible(data, questions.height, questions.width, card.size)
        scores = []
        for row in range(len(questions)):
            stored = questions.read("questions", row)
            scores.append(answer_scores(model, stored, card.size, card.labels > 0))
            progress(1, len(questions))
    found = np.array(scores).reshape(len(scores), -1)
    write_answers(out, data, method=METHOD, scores=found, overwrite=overwrite)


def answer_scores(model: Model, stored: Array, size: int, by_head: bool) -> Array:
    """Return the scores of a question's answers, (A,), of images as stored, (1 + A, H, W, 3)."""
    if by_head:
        with torch.no_grad():
            scores: Array = model.head(codes_of(model, stored[None], size))[0].double().numpy()
            return scores
    meshes = meshes_of(model, np.stack(question_images(stored, size)))
    return np.array([-mesh_distance(meshes[0], mesh) for mesh in meshes[1:]], np.float64)


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
def rotations(count: int = ROTATIONS) -> Array:
    """Return rotations that are spread evenly over SO(3), (count, 3, 3) float32.

    Two irrational winding rates on two circles (Alexa, Super-Fibonacci spirals, CVPR 2022).
    """
    sqrt2, psi = 2**0.5, 1.533751168755204288118041
    s = np.arange(count) + 0.5
    t, d = s / count, 2 * np.pi * s
    r, big, a, b = np.sqrt(t), np.sqrt(1 - t), d / sqrt2, d / psi
    quaternions = np.stack([r * np.sin(a), r * np.cos(a), big * np.sin(b), big * np.cos(b)])
    return rotation_matrix(quaternions).astype(np.float32)

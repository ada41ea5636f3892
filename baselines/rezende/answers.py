"""Answers to questions: by comparing meshes under all rotations, or by the head that labels train."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from baselines.pix2shape.data.rooms import check_reducible, is_question_file
from baselines.rezende.head import codes_of
from baselines.rezende.images import question_images
from baselines.rezende.network import Model
from baselines.rezende.reconstruct import meshes_of
from baselines.rezende.weights import bundled, load_weights
from iqtt.files.reader import open_questions, parts
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError
from scenegen.common.new_file import check_writable
from scenegen.common.rotations import rotation_matrix

Array = NDArray[Any]
METHOD = "rezende"
ROTATIONS = 512  # tried for each answer; any rotation is within about 20 degrees of one
COARSE = 42  # vertices of the reference that are turned: those of the icosphere before the last cut
Progress = Callable[[int, int], Any]


def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, and the score of each, from images alone.

    With weights that saw no labels, an answer's score is minus the distance of its mesh from the
    reference's, under the best rotation; else it is the head's.

    Args:
        data: a file such as iqtt-test.h5; its answers are not read.
        weights: None for those that come with the package, trained without labels.
        progress: called with the number of questions done since the last call, and of all.

    Raises SpecError for rooms, which the method cannot do, and where images do not suit the
    weights; FileFormatError, OSError.
    """
    if not is_question_file(data):
        hint = "it reconstructs single objects without background; docs/baselines.md says why"
        raise SpecError(data, "rooms", "questions, the only data that rezende answers", hint)
    model, card = load_weights(bundled() if weights is None else weights)
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
    """Return the score of each answer of one question, (A,), of images as stored, (1 + A, H, W, 3)."""
    if by_head:
        with torch.no_grad():
            scores: Array = model.head(codes_of(model, stored[None], size))[0].double().numpy()
            return scores
    meshes = meshes_of(model, np.stack(question_images(stored, size)))
    return np.array([-mesh_distance(meshes[0], mesh) for mesh in meshes[1:]], np.float64)


def mesh_distance(one: Array, other: Array) -> float:
    """Return the distance of two meshes, (V, 3) each, under the best of ROTATIONS rotations.

    Both are moved to their centres of mass first. The distance is the mean from the first COARSE
    vertices of one to the nearest of the other, plus the mean the other way round. Mirror images
    are not rotations of each other, so they differ.
    """
    one, other = (mesh - mesh.mean(axis=0) for mesh in (one, other))
    turned = one[:COARSE] @ rotations().swapaxes(1, 2)  # (R, COARSE, 3)
    squared = (turned**2).sum(axis=2)[:, :, None] + (other**2).sum(axis=1) - 2 * turned @ other.T
    there = np.sqrt(squared.min(axis=2).clip(0)).mean(axis=1)
    back = np.sqrt(squared.min(axis=1).clip(0)).mean(axis=1)
    return float((there + back).min())


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

"""Answers: meshes are compared under rotations, never reflections; submissions are valid."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from baselines.rezende.answers import mesh_distance, mesh_scores, refined, rotations
from baselines.rezende.network import METHOD, Card, Settings
from baselines.rezende.sphere import icosphere
from baselines.training.checkpoint import new_state, save_weights
from baselines.training.questions import question_images
from iqtt import open_questions

CARD = Card("rezende", Settings(size=16, code=4))


def stored(path, card=CARD):
    save_weights(path, METHOD, new_state(METHOD, card).network, card)
    return path


@pytest.fixture
def weights(tmp_path):
    return stored(tmp_path / "weights.safetensors")


def chiral():
    """Return a mesh that is no rotation of its mirror image: three arms of different lengths."""
    sphere, _ = icosphere(2)
    arms = zip(np.eye(3), (0.8, 1.6, 2.4))
    length = 1 + sum(reach * (sphere @ axis).clip(0) ** 6 for axis, reach in arms)
    return (0.7 * sphere * length[:, None]).astype(np.float32)


def test_a_turned_and_moved_mesh_is_nearer_than_its_mirror_image_or_another():
    mesh = chiral()
    wide = mesh * np.float32([1.6, 1, 1])
    for turn in Rotation.random(5, random_state=1).as_matrix().astype(np.float32):
        same = mesh_distance(mesh, mesh @ turn.T + np.float32([3, -1, 2]))
        mirrored = mesh_distance(mesh, (mesh * np.float32([-1, 1, 1])) @ turn.T)
        assert 0 <= same < 0.5 * min(mirrored, mesh_distance(mesh, wide @ turn.T))


def test_refined_rotations_are_proper_even_towards_a_mirror_image():
    mesh = chiral()
    three = np.diag(np.float32([3, 2, 1]))
    turns = refined(three, three * np.float32([1, 1, -1]), np.eye(3, dtype=np.float32)[None])
    np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-4)
    best = abs(refined(mesh, mesh, rotations()[::16]) - np.eye(3)).max(axis=(1, 2)).min()
    assert best < 1e-3


def test_an_equal_image_has_the_best_score(split):
    model = new_state(METHOD, CARD).network.eval()
    model.decoder[-1].weight.data *= 300  # untrained meshes are almost spheres
    with open_questions(split / "iqtt-val.h5") as questions:
        images = torch.from_numpy(question_images(questions, 0, 16))[None]
    images[0, 3] = images[0, 0]
    with torch.no_grad():
        scores = mesh_scores(model, images)
    assert scores.shape == (1, 3)
    assert scores.isfinite().all()
    assert scores.argmax() == 2

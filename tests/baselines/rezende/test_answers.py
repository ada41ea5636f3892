"""Answers: meshes are compared under rotations, never reflections; submissions are valid."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refused
from scipy.spatial.transform import Rotation

from baselines.checkpoints import new_state, save_weights
from baselines.rezende import write_submission
from baselines.rezende.answers import answer_scores, mesh_distance, refined, rotations
from baselines.rezende.card import RECIPE, Card
from baselines.rezende.sphere import icosphere
from iqtt.files.reader import open_questions
from metrics.submissions.validation import validate
from scenegen.common.errors import FileFormatError, SpecError

CARD = Card(size=16, code=4)


@pytest.fixture
def weights(tmp_path):
    path = tmp_path / "weights.safetensors"
    save_weights(path, new_state(RECIPE, CARD))
    return path


def chiral():
    """Return a mesh that is no rotation of its mirror image: three arms of different lengths."""
    sphere, _ = icosphere(2)
    arms = zip(np.eye(3), (0.8, 1.6, 2.4))
    length = 1 + sum(reach * (sphere @ axis).clip(0) ** 6 for axis, reach in arms)
    return (0.7 * sphere * length[:, None]).astype(np.float32)


def test_rotations_are_proper_and_cover_all_others():
    found = rotations().astype(float)
    np.testing.assert_allclose(
        found @ found.swapaxes(1, 2), np.tile(np.eye(3), (512, 1, 1)), atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.det(found), 1, atol=1e-6)
    others = Rotation.random(500, random_state=0).as_matrix()
    trace = np.einsum("aij,bij->ab", others, found).max(axis=1)
    angle = np.degrees(np.arccos(((trace - 1) / 2).clip(-1, 1)))
    assert angle.max() < 30
    assert angle.mean() < 17


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


@pytest.mark.parametrize("by_head", [False, True], ids=["meshes", "head"])
def test_an_equal_image_has_the_best_score(split, by_head):
    model = new_state(RECIPE, CARD).network.eval()
    model.decoder[-1].weight.data *= 300  # untrained meshes are almost spheres
    with open_questions(split / "iqtt-val.h5") as questions:
        stored = questions.read("questions", 0).copy()
    stored[3] = stored[0]
    scores = answer_scores(model, stored, 16, by_head)
    assert scores.shape == (3,)
    assert np.isfinite(scores).all()
    if not by_head:
        assert scores.argmax() == 2


@pytest.mark.parametrize("labels", [0, 5])
def test_submissions_are_valid_and_do_not_depend_on_the_answers(split, tmp_path, weights, labels):
    save_weights(weights, new_state(RECIPE, replace(CARD, labels=labels)))
    told = []
    for name in ("iqtt-test.h5", "iqtt-val.h5"):
        out = tmp_path / f"answers-{name}"
        write_submission(split / name, out, weights, progress=lambda *n: told.append(n))
        assert validate(out, split / name) == []
    assert told == [(1, 2)] * 2 + [(1, 3)] * 3


def test_rooms_training_files_and_other_sizes_are_refused(split, tmp_path, weights):
    from scenegen.description.specs import DatasetSpec
    from scenegen.rooms.make import make_dataset

    make_dataset(
        tmp_path / "rooms.h5", DatasetSpec(height=32, width=32, min_visible_pixels=1), count=1
    )
    out = tmp_path / "out.h5"
    with refused(SpecError, "rooms.h5", "rooms", "questions"):
        write_submission(tmp_path / "rooms.h5", out, weights)
    with refused(SpecError, "iqtt-train.h5", "training questions"):
        write_submission(split / "iqtt-train.h5", out, weights)
    save_weights(weights, new_state(RECIPE, Card(size=24)))
    with refused(SpecError, "iqtt-test.h5", "64x64", "24"):
        write_submission(split / "iqtt-test.h5", out, weights)
    with pytest.raises(FileFormatError):
        write_submission(split / "iqtt-test.h5", out, split / "iqtt-test.h5")
    assert not out.exists()

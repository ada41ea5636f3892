"""Submissions: scores of every answer by images alone, and what is refused."""

import h5py
import numpy as np
import pytest
from pix2shape_models import edited, released

from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from metrics.scoring.evaluate import score
from scenegen.common.errors import SceneGenError, SpecError

torch = pytest.importorskip("torch")
from baselines import cnn, siamese  # noqa: E402
from baselines.checkpoints import WEIGHTS, load_weights  # noqa: E402
from baselines.resnet.answering import accuracy, images_of  # noqa: E402

PACKAGES = {"cnn": cnn, "siamese": siamese}
each = pytest.mark.parametrize("name", PACKAGES)


@each
def test_a_submission_is_valid_and_holds_the_networks_scores(name, run_folders, truths, tmp_path):
    weights, out = run_folders[name] / WEIGHTS, tmp_path / "answers.h5"
    told = []
    package = PACKAGES[name]
    package.write_submission(truths.iqtt, out, weights, progress=lambda *done: told.append(done))
    assert told == [(6, 6)]
    state = load_weights(weights, package.network.METHOD.recipe)
    network, card = state.network, state.card
    with h5py.File(out) as file, h5py.File(truths.iqtt) as questions:
        found, answer = file["scores"][:], file.attrs["run"]
        for row in range(6):
            images = images_of(questions["questions"][row], card.size)
            with torch.no_grad():
                assert network(images[None])[0].numpy() == pytest.approx(found[row], rel=1e-4)
    assert answer == "3 labels, seed 1"
    right = score([out]).metrics["iqtt_accuracy"].value
    val = truths.iqtt.with_name("iqtt-val.h5")
    assert 0 <= right <= 1
    assert card.validation == accuracy(network, val, card.size, 3)


@each
def test_labels_and_answers_of_the_questions_are_not_read(name, run_folders, truths, tmp_path):
    """The same images in a file of the authors' layout, which holds nothing else."""
    weights = run_folders[name] / WEIGHTS
    bare = released(tmp_path / "bare.h5", [0] * 6, 32)
    with h5py.File(bare, "r+") as file, h5py.File(truths.iqtt) as questions:
        file["questions"][:] = questions["questions"][:] / np.float32(255)
    found = []
    for data in (bare, truths.iqtt):
        PACKAGES[name].write_submission(data, tmp_path / "x.h5", weights, overwrite=True)
        with h5py.File(tmp_path / "x.h5") as file:
            found.append(file["scores"][:])
    assert found[0] == pytest.approx(found[1], abs=1e-4)


def test_other_weights_checkpoints_and_data_are_refused(run_folders, truths, questions, tmp_path):
    folder = run_folders["cnn"]
    (tmp_path / "text.safetensors").write_text("none")
    out = tmp_path / "x.h5"
    cases = [
        (truths.iqtt, run_folders["siamese"] / WEIGHTS, "weights.safetensors"),
        (truths.iqtt, folder / "checkpoint.safetensors", "checkpoint.safetensors"),
        (truths.iqtt, tmp_path / "text.safetensors", "text.safetensors"),
        (questions, folder / WEIGHTS, "iqtt-train.h5"),
        (truths.rooms, folder / WEIGHTS, "rooms.h5"),
        (released(tmp_path / "odd.h5", [0], 24), folder / WEIGHTS, "odd.h5"),
    ]
    for data, weights, where in cases:
        with pytest.raises(SceneGenError) as error:
            cnn.write_submission(data, out, weights)
        assert where in error.value.where
    assert not out.exists()
    with pytest.raises(FileNotFoundError):
        cnn.write_submission(truths.iqtt, out, tmp_path / "none.safetensors")


def test_questions_of_two_answers(run_folders, small, tmp_path):
    """A softmax has as many outputs as in training; distances are measured to any answer."""
    spec = SplitSpec(
        train=4, labeled=4, val=2, test=5, cubes=(8, 8), distractors="mirror-pair", answers=2,
        height=32, width=32, min_cube_pixels=0,
    )  # fmt: skip
    make_split(tmp_path / "two", spec)
    test, out = tmp_path / "two" / "iqtt-test.h5", tmp_path / "x.h5"
    siamese.write_submission(test, out, run_folders["siamese"] / WEIGHTS)
    with h5py.File(out) as file:
        assert file["scores"].shape == (5, 2)
    with pytest.raises(SpecError) as error:
        cnn.write_submission(test, out, run_folders["cnn"] / WEIGHTS, overwrite=True)
    assert error.value.found == "questions of 2 answers"
    own = cnn.train(tmp_path / "two/iqtt-train.h5", tmp_path / "run", iterations=2, **small)
    cnn.write_submission(test, out, own, overwrite=True)
    with h5py.File(out) as file:
        assert file["scores"].shape == (5, 2)


def test_no_answers_no_accuracy(run_folders, truths, tmp_path):
    state = load_weights(run_folders["cnn"] / WEIGHTS, cnn.network.METHOD.recipe)
    network, card = state.network, state.card
    assert accuracy(network, truths.iqtt, card.size, 3) is None
    val = truths.iqtt.with_name("iqtt-val.h5")
    assert accuracy(network, val, card.size, 2) is None

    def right(file):
        images = np.repeat(file["questions"][:], 1, axis=0)
        with torch.no_grad():
            scores = network(torch.stack([images_of(one, card.size) for one in images]))
        file["answers"][:] = scores.argmax(dim=1).numpy()

    assert accuracy(network, edited(val, tmp_path / "v.h5", right), card.size, 3) == 1.0

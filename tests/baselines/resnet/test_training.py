"""Training: it learns, it goes on after a kill, its questions are the file's, faults are told."""

import shutil

import h5py
import numpy as np
import pytest
from pix2shape_models import edited

from scenegen.common.errors import SceneGenError, SpecError

torch = pytest.importorskip("torch")
from baselines import cnn, siamese  # noqa: E402
from baselines.checkpoints import CHECKPOINT, WEIGHTS, load_weights  # noqa: E402
from baselines.resnet import training  # noqa: E402
from baselines.resnet.training import LabelledQuestions, permuted  # noqa: E402
from baselines.tensor_files import load_tensors  # noqa: E402

PACKAGES = {"cnn": cnn, "siamese": siamese}
named = pytest.mark.parametrize("package", [cnn, siamese], ids=["cnn", "siamese"])


def test_questions_are_those_of_the_file(questions):
    source = LabelledQuestions(questions, 16, 2)
    assert (len(source), source.answers) == (2, 3)
    with h5py.File(questions) as file:
        stored, answers = file["labeled/questions"][:], file["labeled/answers"][:]
    images, answer = source[1]
    blocks = stored[1].reshape(4, 16, 2, 16, 2, 3).mean(axis=(2, 4)) / 255
    assert images.numpy() == pytest.approx(np.moveaxis(blocks, -1, 1), abs=1e-6)
    assert answer == answers[1]
    assert len(LabelledQuestions(questions, 16)) == 3


def test_permuted_answers_stay_with_their_questions():
    images = torch.arange(6 * 4.0).view(6, 4, 1, 1, 1).expand(6, 4, 3, 2, 2)
    right = torch.tensor([0, 1, 2, 0, 1, 2])
    seen = set()
    for iteration in range(20):
        mixed, new = permuted(images, right, 5, iteration)
        rows = torch.arange(6)
        assert torch.equal(mixed[:, 0], images[:, 0])
        assert torch.equal(mixed[rows, 1 + new], images[rows, 1 + right])
        values = mixed[:, 1:, 0, 0, 0].sort(dim=1).values
        assert torch.equal(values, images[:, 1:, 0, 0, 0])
        seen |= set(enumerate(new.tolist()))
        assert torch.equal(permuted(images, right, 5, iteration)[1], new)
    assert len(seen) == 18, "the right answer of each question comes to stand everywhere"


@named
def test_it_learns_the_questions_that_it_sees(package, questions, small, tmp_path):
    told = []
    settings = {**small, "width": 8, "batch": 3, "learning_rate": 0.003}
    package.train(
        questions, tmp_path, iterations=60, **settings, progress=lambda *what: told.append(what)
    )
    losses = [numbers["loss"] for *_, numbers in told[:-1]]
    assert np.mean(losses[-5:]) < 0.3 * np.mean(losses[:5])
    assert [done for done, *_ in told] == [*range(1, 61), 60]
    done, total, numbers = told[-1]
    assert (done, total) == (60, 60)
    assert 0 <= numbers["accuracy on iqtt-val.h5"] <= 1


@named
def test_who_is_stopped_goes_on_as_if_never_stopped(
    package, questions, small, tmp_path, monkeypatch
):
    settings = {**small, "iterations": 5, "seed": 4}
    whole = package.train(questions, tmp_path / "whole", **settings)
    monkeypatch.setattr(training, "EVERY", 2)

    def stop(done, total, numbers):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        package.train(questions, tmp_path / "parts", **settings, progress=stop)
    assert not (tmp_path / "parts" / WEIGHTS).exists()
    with pytest.raises(FileExistsError):
        package.train(questions, tmp_path / "parts", **settings)
    began = []
    parts = package.train(
        questions, tmp_path / "parts", resume=True, progress=lambda done, *_: began.append(done)
    )
    assert began[0] == 3
    assert whole.read_bytes() == parts.read_bytes()
    other = package.train(questions, tmp_path / "other", **{**settings, "seed": 5})
    one, two = load_tensors(whole)[0], load_tensors(other)[0]
    assert any(not torch.equal(one[name], two[name]) for name in one)


def test_the_card_tells_how_it_was_trained(run_folders, questions):
    card = load_weights(run_folders["cnn"] / WEIGHTS, cnn.network.METHOD.recipe).card
    with h5py.File(questions) as file:
        mark = file.attrs["fingerprint_labeled"]
    assert (card.labels, card.answers, card.seed, card.iteration) == (3, 3, 1, 3)
    assert card.fingerprint == mark
    assert card.validation is not None


def test_a_run_goes_on_with_its_own_data_alone(run_folders, questions, tmp_path):
    def marked(file):
        file.attrs["fingerprint_labeled"] = "0" * 64

    shutil.copytree(run_folders["siamese"], tmp_path / "run")
    other = edited(questions, tmp_path / "other.h5", marked)
    with pytest.raises(SpecError) as error:
        siamese.train(other, tmp_path / "run", resume=True)
    assert error.value.found == "fingerprint 000000000000"


@pytest.mark.parametrize(
    ("name", "settings", "where"),
    [
        ("iqtt-train.h5", {"labels": 4}, "labels"),
        ("iqtt-train.h5", {"labels": 0}, "labels"),
        ("iqtt-train.h5", {"depth": 34}, "depth"),
        ("iqtt-train.h5", {"width": 10**9}, "width"),
        ("iqtt-train.h5", {"size": 0}, "size"),
        ("iqtt-train.h5", {"batch": 0}, "batch"),
        ("iqtt-train.h5", {"size": 24}, "iqtt-train.h5"),
        ("iqtt-train.h5", {"learning_rate": float("nan")}, "learning_rate"),
        ("iqtt-test.h5", {}, "iqtt-test.h5"),
        ("unlabelled.h5", {}, "unlabelled.h5"),
        ("rooms.h5", {}, "rooms.h5"),
        ("nothing.h5", {}, None),
    ],
    ids=lambda value: None if value is None else str(value),
)
def test_what_cannot_be_trained_on(name, settings, where, questions, truths, tmp_path):
    def empty(file):
        for field in ("questions", "answers"):
            file[f"labeled/{field}"].resize(0, axis=0)

    folder = truths.rooms.parent if name == "rooms.h5" else questions.parent
    path = edited(questions, tmp_path / name, empty) if name == "unlabelled.h5" else folder / name
    with pytest.raises((SceneGenError, OSError)) as error:
        cnn.train(path, tmp_path / "run", **{"size": 16, **settings})
    assert not (tmp_path / "run").exists()
    if where is not None:
        assert where.replace("_", " ") in error.value.where.replace("_", " ")


def test_a_loss_that_is_not_finite_is_an_error_and_leaves_no_weights(questions, small, tmp_path):
    settings = {**small, "learning_rate": 1.0}
    bad = cnn.network.METHOD
    broken = type(bad)(
        "cnn", bad.network, lambda scores, right: scores.sum() * torch.nan, bad.files, False
    )
    with pytest.raises(SceneGenError) as error:
        training.train(broken, questions, tmp_path, **settings)
    assert error.value.where == "iteration 0"
    assert not any((tmp_path / name).exists() for name in (WEIGHTS, CHECKPOINT))

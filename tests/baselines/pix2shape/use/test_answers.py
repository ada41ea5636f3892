"""Answers to questions: the nearest z_scene, in the file's order, from images alone."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from h5_edits import damaged_chunk, gone, put
from pix2shape_models import edited, made, of_questions, released

from iqtt.files.reader import open_questions
from metrics.scoring.scoring import score
from metrics.submissions.validation import validate
from scenegen.common.errors import FileFormatError, SceneGenError

torch = pytest.importorskip("torch")

from baselines.pix2shape.data.rooms import channels_first  # noqa: E402
from baselines.pix2shape.use import predict  # noqa: E402
from baselines.pix2shape.use.predict import answer_file  # noqa: E402
from scenegen.rendering.ground_truth import decode_image  # noqa: E402


@pytest.fixture
def model(train_questions: Path) -> Any:
    return made(of_questions(train_questions))


@pytest.fixture(autouse=True)
def few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither 6 nor 7 questions fill batches of 4."""
    monkeypatch.setattr(predict, "BATCH", 16)


def answered(model: Any, path: Path, out: Path, **how: Any) -> tuple[list[int], np.ndarray]:
    """Return answers and scores; where only one of them is written, from `metrics`."""
    from metrics.submissions.reader import open_predictions

    answer_file(model, path, out, overwrite=True, **how)
    with open_predictions(out) as found, h5py.File(out) as file:
        assert found.rows.tolist() == list(range(len(found)))
        return found.answers.tolist(), file["scores"][()]


def distances(model: Any, path: Path, part: str | None = None) -> np.ndarray:
    """Return the distances of all answers' z_scene from the reference's, one image at a time."""
    found = []
    with open_questions(path, part) as questions, torch.no_grad():
        for record in questions:
            images = torch.from_numpy(
                np.stack([channels_first(image, 32) for image in decode_image(record.images)])
            )
            codes = [model.encoder(image[None], image.new_empty(1, 0))[0] for image in images]
            scene = [code.double().numpy()[: model.config.networks.z_scene] for code in codes]
            found.append([np.linalg.norm(scene[k] - scene[0]) for k in (1, 2, 3)])
    return np.array(found)


def test_the_nearest_scene_is_the_answer(model, truths, tmp_path):
    done: list[tuple[int, int]] = []
    answers, scores = answered(
        model, truths.iqtt, tmp_path / "a.h5", progress=lambda *step: done.append(step)
    )
    expected = distances(model, truths.iqtt)
    np.testing.assert_allclose(scores, -expected, rtol=1e-4)
    assert answers == expected.argmin(axis=1).tolist()
    assert len(set(answers)) > 1
    assert done == [(4, 6), (2, 6)]
    assert [p for p in validate(tmp_path / "a.h5") if not p.is_hint] == []
    assert score([tmp_path / "a.h5"]).method == "pix2shape"


def test_the_view_has_no_say(model, truths, tmp_path):
    before = answered(model, truths.iqtt, tmp_path / "a.h5")
    spec = model.config.networks
    assert spec.z_view == 10
    with torch.no_grad():
        model.encoder.last.weight[spec.z_scene :] *= 100
    after = answered(model, truths.iqtt, tmp_path / "a.h5")
    np.testing.assert_array_equal(after[1], before[1])
    with torch.no_grad():
        model.encoder.last.weight[: spec.z_scene] *= 2
    assert not np.array_equal(answered(model, truths.iqtt, tmp_path / "a.h5")[1], before[1])


def test_the_same_image_is_the_answer_and_a_tie_abstains(model, tmp_path):
    """Files as released: images and nothing beside; 7 questions in batches of 4."""
    right = [2, 0, 1, -1, 2, -2, 0]
    path = released(tmp_path / "released.h5", right)
    answers, scores = answered(model, path, tmp_path / "a.h5")
    assert answers == [max(answer, -1) for answer in right]
    assert scores[3, 0] == scores[3, 2] > scores[3, 1]
    with h5py.File(tmp_path / "a.h5") as file:
        assert file.attrs["truth_fingerprint"] == ""


def test_larger_images_are_reduced(model, tmp_path):
    path = released(tmp_path / "large.h5", [1, 2, 0], size=96)
    assert answered(model, path, tmp_path / "a.h5")[0] == [1, 2, 0]


def test_neither_answers_nor_lights_are_needed(model, truths, tmp_path):
    folder = Path(truths.iqtt).parent
    with h5py.File(truths.iqtt) as file:
        assert "answers" not in file
        assert "truth" not in file
    expected = answered(model, folder / "iqtt-val.h5", tmp_path / "a.h5")
    path = edited(folder / "iqtt-val.h5", tmp_path / "bare.h5", gone("answers", "truth"))
    found = answered(model, path, tmp_path / "a.h5")
    assert found[0] == expected[0]
    np.testing.assert_array_equal(found[1], expected[1])
    wrong = put("answers", slice(None), 0)
    path = edited(folder / "iqtt-val.h5", tmp_path / "wrong.h5", wrong)
    np.testing.assert_array_equal(answered(model, path, tmp_path / "a.h5")[1], expected[1])


def test_training_questions_are_not_answered(model, train_questions, tmp_path):
    with pytest.raises(SceneGenError) as error:
        answer_file(model, train_questions, tmp_path / "a.h5")
    assert (error.value.where, error.value.found) == (str(train_questions), "training questions")
    assert not (tmp_path / "a.h5").exists()


def test_a_file_that_cannot_be_read_on_leaves_what_was_there(model, truths, tmp_path):
    path = edited(truths.iqtt, tmp_path / "bad.h5", damaged_chunk("questions", 5))
    (tmp_path / "a.h5").write_text("mine")
    with pytest.raises(FileFormatError, match=r"bad\.h5: questions, row 5: cannot be read"):
        answer_file(model, path, tmp_path / "a.h5", overwrite=True)
    assert (tmp_path / "a.h5").read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 2


def test_numbers_that_are_not_finite_are_not_written(model, tmp_path):
    path = released(tmp_path / "released.h5", [1, 2])
    path = edited(path, tmp_path / "bad.h5", put("questions", (1, 2, 5, 5), np.nan))
    with pytest.raises(SceneGenError, match="scores"):
        answer_file(model, path, tmp_path / "a.h5")
    assert not (tmp_path / "a.h5").exists()

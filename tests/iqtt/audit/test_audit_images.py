"""Tests of the audit: each proof of images and views is seen to fail on its own damage."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from iqtt.audit.audit import audit
from iqtt.audit.report import table

Failing = Callable[..., set[str]]


def released_statuses(path: Path) -> dict[str, str]:
    found = {proof.name: proof.status for proof in audit([path], probed=0).proofs}
    return {name: status for name, status in found.items() if status != "skipped"}


def plain(count: int = 7) -> Any:
    """White images, each with a grey rectangle of its own, (count, 4, 20, 24, 3) float32."""
    images = np.ones((count, 4, 20, 24, 3), np.float32)
    for k, image in enumerate(images.reshape(-1, 20, 24, 3)):
        image[5 : 10 + k % 5, 4:14] = 0.3 + 0.01 * k
    return images


@pytest.fixture
def judged(tmp_path: Path) -> Callable[..., dict[str, str]]:
    """Write images as released, and return the statuses of the proofs that they allow."""

    def judge(images: Any, answers: Any) -> dict[str, str]:
        with h5py.File(tmp_path / "plain.h5", "w") as file:
            file["questions"], file["answers"] = images, answers
        return released_statuses(tmp_path / "plain.h5")

    return judge


NAMES = ("answer places", "pixel values", "framing", "distinct images", "distinct questions")


def test_released_files_pass(judged: Callable[..., dict[str, str]]) -> None:
    assert judged(plain(), np.arange(7) % 3) == dict.fromkeys(NAMES, "ok")


def test_an_audit_of_no_questions_does_not_pass(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "iqtt-val.h5", "w") as file:
        file["questions"], file["answers"] = plain(0), np.zeros(0, np.uint8)
    found = audit([tmp_path])
    assert not found.passed
    assert json.loads(found.to_json())["passed"] is False
    assert {proof.status for proof in found.proofs} <= {"ok", "skipped"}
    assert "there are no questions" in table(found)


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.5, 1.01])
def test_values_that_are_no_radiance(judged: Callable[..., dict[str, str]], value: float) -> None:
    images = plain()
    images[4, 2, 7, 7, 1] = value
    assert judged(images, np.arange(7) % 3) == {**dict.fromkeys(NAMES, "ok"), NAMES[1]: "FAIL"}


def test_only_questions_with_answers_are_measured(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "iqtt-train.h5", "w") as file:
        file["unlabeled/questions"] = plain(7)
        file["labeled/questions"], file["labeled/answers"] = 1 - plain(3) / 2, np.arange(3)
    found = audit([tmp_path], probed=3)
    assert [(t.answers, t.probed) for t in found.tables] == [("stored", 3), ("unknown", 0)]
    assert {p.n for p in found.probes} == {3}


def test_uneven_answers(judged: Callable[..., dict[str, str]]) -> None:
    assert judged(plain(), [0, 1, 2, 0, 1, 0, 0])["answer places"] == "FAIL"
    assert judged(plain(), [0, 1, 2, 0, 1, 2, 2])["answer places"] == "ok"


def test_the_same_question_in_another_order(judged: Callable[..., dict[str, str]]) -> None:
    images = plain()
    images[6] = images[1][[0, 3, 1, 2]]
    assert judged(images, np.arange(7) % 3) == {
        **dict.fromkeys(NAMES, "ok"),
        **dict.fromkeys(NAMES[3:], "FAIL"),
    }


def test_an_image_twice_in_two_files(failing: Failing, split_folder: Path) -> None:
    with h5py.File(split_folder / "iqtt-train.h5") as train:
        image = train["unlabeled/questions"][3, 2]

    def edit(file: h5py.File) -> None:
        file["questions"][5, 0] = image

    assert failing(edit) >= {"distinct images", "cast again"}


def test_shapes_on_the_border(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        image = file["questions"][3, 1]
        left = int((image != 255).any(axis=(0, 2)).argmax())
        file["questions"][3, 1] = np.roll(image, -left, axis=1)

    assert failing(edit) == {"framing", "cast again"}


def test_another_background(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        images = file["questions"][()]
        images[(images == 255).all(axis=-1)] = 250
        file["questions"][...] = images

    assert failing(edit) >= {"framing", "cast again"}


def test_a_hidden_cube(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        shown = file["truth/visible_pixels"][2]
        shown[3, 0] += shown[3, 1] - 1
        shown[3, 1] = 1
        file["truth/visible_pixels"][2] = shown

    assert failing(edit) == {"visibility", "cast again"}


def test_a_silhouette_larger_than_its_cubes(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        shown = file["truth/visible_pixels"][2]
        shown[3] = np.minimum(shown[3], 3)
        file["truth/visible_pixels"][2] = shown

    assert failing(edit) == {"visibility", "cast again"}


def test_the_reference_and_the_answer_from_one_side(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        views, right = file["truth/world_from_shape"][1], 1 + file["answers"][1]
        views[right] = views[0]
        file["truth/world_from_shape"][1] = views
        file["truth/angle_degrees"][1] = 0

    assert failing(edit) == {"angles", "cast again"}


def test_an_angle_that_lies(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        file["truth/angle_degrees"][4] += 0.01

    assert failing(edit) == {"angles"}


@pytest.mark.parametrize("factor", [-1.0, 1.001, np.nan])
def test_rotations_that_are_none(failing: Failing, factor: float) -> None:
    def edit(file: h5py.File) -> None:
        wrong = 1 + (file["answers"][1] + 1) % 3
        views = file["truth/world_from_shape"][1]
        views[wrong] *= factor
        file["truth/world_from_shape"][1] = views

    assert {"rotations"} <= failing(edit) <= {"rotations", "cast again"}


def test_other_lights(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        color = file["truth/light_color"][3]
        color[2] *= 1.05
        file["truth/light_color"][3] = color

    assert failing(edit) == {"cast again"}


def test_another_shape_than_the_image_shows(failing: Failing) -> None:
    def edit(file: h5py.File) -> None:
        images = file["questions"][3]
        file["questions"][3] = images[[0, 2, 1, 3]]

    assert failing(edit) >= {"cast again"}

"""The audit: a fair split passes, and every proof is seen to fail on its own damage."""

import json
import shutil
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import pytest
from audit_tables import audited

from iqtt.audit.audit import to_json
from iqtt.audit.report import markdown, table
from iqtt.shapes.polycube import ROTATIONS, canonical, canonical_class, set_ids
from scenegen.common.errors import FileFormatError, SpecError

OF_IMAGES = ("answer places", "pixel values", "framing", "distinct images", "distinct questions")
BY_CUBES = {
    *("shapes", "one right answer", "answers differ", "labels", "mirror images", "matched"),
    *("stored ids", "splits apart", "splits for ever", "rotations", "angles", "lines of sight"),
    *("visibility", "cast again", "one explanation"),
}
PROOFS = {"content", *OF_IMAGES, *BY_CUBES}
Edit = Callable[[h5py.File], Any]


def set_shape(truth, row, image, cubes):
    """Store another shape of as many cubes, and ids that are right for it."""
    stored = truth["cubes"][row]
    stored[image, : len(cubes)] = cubes
    truth["cubes"][row] = stored
    for name, form in (("shape_id", canonical), ("class_id", canonical_class)):
        ids = truth[name][row]
        ids[image] = set_ids(form(np.asarray(cubes)[None])).view(np.uint8)
        truth[name][row] = ids


def shape(truth, row, image):
    return truth["cubes"][row, image, : truth["cube_count"][row]]


def changed(name, at, change):
    """Change one row of a dataset."""
    return lambda file: file[name].__setitem__(at, change(file[name][at]))


def wrong(file, row, k=1):
    """Return which image of a question shows its k-th wrong answer."""
    return 1 + int((file["answers"][row] + k) % 3)


def second_right_answer(file):
    set_shape(file["truth"], 2, wrong(file, 2), shape(file["truth"], 2, 0) @ ROTATIONS[7].T)


def in_pieces(cubes):
    cubes[1, 0] += 9
    return cubes


def at_the_border(file):
    image = file["questions"][3, 1]
    left = int((image != 255).any(axis=(0, 2)).argmax())
    file["questions"][3, 1] = np.roll(image, -left, axis=1)


def scaled(image, factor):
    def change(values):
        values[image] *= factor
        return values

    return change


VAL, TEST, TRAIN = "iqtt-val.h5", "iqtt-test-answers.h5", "iqtt-train.h5"
ALL, VIEWS = slice(None), "truth/world_from_shape"
# File, what is done to it, and the proofs that fail; others may fail too where it ends in dots.
DAMAGES: list[tuple[str, Edit, str]] = [
    (VAL, changed("answers", ALL, lambda a: (a + 1) % 3), "one right answer"),
    (TEST, changed("answers", ALL, lambda a: (a + 1) % 3), "one right answer"),
    (VAL, second_right_answer, "one right answer, answers differ, ..."),
    (TRAIN, changed("truth/unlabeled/distractor_kind", 2, np.flip), "one right answer, ..."),
    (VAL, changed("truth/cubes", 3, in_pieces), "shapes, ..."),
    (VAL, changed("truth/shape_id", 4, lambda ids: ids[[1, 2, 3, 0]]), "stored ids"),
    (VAL, changed("truth/class_id", 4, lambda ids: ids[[1, 2, 3, 0]]), "stored ids"),
    (VAL, at_the_border, "framing, cast again"),
    *(
        (
            VAL,
            lambda file, by=by: changed(VIEWS, 1, scaled(wrong(file, 1), by))(file),
            "rotations, ...",
        )
        for by in (-1.0, 1.001, np.nan)
    ),
    (VAL, changed("truth/light_color", 3, scaled(2, 1.05)), "cast again"),
    (VAL, changed("questions", 3, lambda images: images[[0, 2, 1, 3]]), "cast again, ..."),
]


@pytest.mark.parametrize(("name", "edit", "proofs"), DAMAGES)
def test_every_damage_fails_its_proof(failing, name, edit, proofs):
    questions = ["iqtt-test.h5"] if name == TEST else []
    failed, expected = failing(edit, name, *questions), set(proofs.split(", "))
    assert failed >= expected - {"..."}
    assert "..." in expected or failed == expected


def test_an_image_twice_in_two_files(failing, split_folder):
    with h5py.File(split_folder / "iqtt-train.h5") as train:
        image = train["unlabeled/questions"][3, 2]
    failed = failing(lambda file: file["questions"].__setitem__((5, 0), image), VAL, TRAIN)
    assert failed >= {"distinct images", "cast again"}


def test_faces_are_told_apart(failing, monkeypatch):
    monkeypatch.setattr("iqtt.audit.proofs.views.FACE_STEPS", 60)
    assert failing(lambda file: file.attrs.__setitem__("command", "")) == {"cast again"}


def test_a_fair_split_passes_and_all_is_told(split_folder, monkeypatch):
    monkeypatch.setattr("iqtt.audit.audit.EXPLAINED", 8)
    told: list[int] = []
    found = audited([split_folder], progress=told.append)
    assert {proof.name: proof.status for proof in found.proofs} == dict.fromkeys(PROOFS, "ok")
    assert found.passed
    assert sum(told) == 24
    assert [(t.name, t.answers, t.probed) for t in found.tables] == [
        ("iqtt-test.h5", "stored", 6),
        ("iqtt-train.h5 labeled", "stored", 6),
        ("iqtt-train.h5 unlabeled", "from the cubes", 6),
        ("iqtt-val.h5", "stored", 6),
    ]
    (record,) = json.loads(to_json([found]))["audits"]
    assert json.loads(to_json([found]))["format"] == "pix2shape-bench/iqtt-audit"
    assert record["passed"] is True
    assert {proof["name"] for proof in record["proofs"]} == PROOFS
    assert all(0 <= p["low"] <= p["accuracy"] <= p["high"] <= 1 for p in record["probes"])
    assert all(len(t["fingerprint"]) == 64 for t in record["tables"])
    assert all(
        proof.detail in text for text in (table(found), markdown(found)) for proof in found.proofs
    )


def test_files_that_cannot_be_audited(tmp_path):
    (tmp_path / "iqtt-val.h5").write_bytes(b"no HDF5")
    for paths, kind in (
        ([], SpecError),
        ([tmp_path / "x"], FileNotFoundError),
        ([tmp_path], FileFormatError),
    ):
        with pytest.raises(kind):
            audited(paths)


@pytest.mark.usefixtures("few_explained")
def test_a_file_of_answers_stands_for_its_questions(split_folder):
    test, answers = (split_folder / f"iqtt-test{kind}.h5" for kind in ("", "-answers"))
    found = audited([test])
    assert audited([answers, test]).tables == found.tables
    assert {p.name for p in found.proofs if p.status == "skipped"} == {"splits apart"}


@pytest.mark.usefixtures("few_explained")
def test_questions_without_answers(split_folder, tmp_path):
    shutil.copy(split_folder / "iqtt-test.h5", tmp_path)
    found = audited([tmp_path])
    assert found.passed
    assert found.probes == ()
    skipped = {proof.name for proof in found.proofs if proof.status == "skipped"}
    assert skipped == BY_CUBES | {"answer places"}
    both = audited([tmp_path, split_folder / "iqtt-val.h5"])
    assert "iqtt-test.h5" in both.proofs[0].detail


def plain(count=7):
    """White images, each with a grey rectangle of its own, (count, 4, 20, 24, 3) float32."""
    images = np.ones((count, 4, 20, 24, 3), np.float32)
    for k, image in enumerate(images.reshape(-1, 20, 24, 3)):
        image[5 : 10 + k % 5, 4:14] = 0.3 + 0.01 * k
    return images


@pytest.fixture
def failed(tmp_path):
    """Write a file as released, and return the proofs that fail."""

    def judge(images, answers):
        with h5py.File(tmp_path / "plain.h5", "w") as file:
            file["questions"], file["answers"] = images, answers
        found = audited([tmp_path / "plain.h5"], probed=0).proofs
        assert {proof.name for proof in found if proof.status != "skipped"} == set(OF_IMAGES)
        return {proof.name for proof in found if proof.status == "FAIL"}

    return judge


def test_released_files(failed):
    fair = np.arange(7) % 3
    assert failed(plain(), fair) == set()
    assert failed(plain(), [0, 1, 2, 0, 1, 2, 2]) == set()
    assert failed(plain(), [0, 1, 2, 0, 1, 0, 0]) == {"answer places"}
    for value in (np.nan, np.inf, -0.5, 1.01):
        images = plain()
        images[4, 2, 7, 7, 1] = value
        assert failed(images, fair) == {"pixel values"}
    images = plain()
    images[6] = images[1][[0, 3, 1, 2]]
    assert failed(images, fair) == {"distinct images", "distinct questions"}


def test_an_audit_of_no_questions_does_not_pass(tmp_path):
    with h5py.File(tmp_path / "iqtt-val.h5", "w") as file:
        file["questions"], file["answers"] = plain(0), np.zeros(0, np.uint8)
    found = audited([tmp_path])
    assert not found.passed
    assert json.loads(to_json([found]))["passed"] is False
    assert {proof.status for proof in found.proofs} <= {"ok", "skipped"}


def test_only_questions_with_answers_are_measured(tmp_path):
    with h5py.File(tmp_path / "iqtt-train.h5", "w") as file:
        file["unlabeled/questions"] = plain(7)
        file["labeled/questions"], file["labeled/answers"] = 1 - plain(3) / 2, np.arange(3)
    found = audited([tmp_path], probed=3)
    assert [(t.answers, t.probed) for t in found.tables] == [("stored", 3), ("unknown", 0)]
    assert {p.n for p in found.probes} == {3}

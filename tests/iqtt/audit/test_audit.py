"""Tests of the audit: a fair split passes, and every proof is seen to fail on its own damage."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from polycubes import are_congruent

from iqtt.audit.audit import audit, question_count
from iqtt.audit.report import markdown, table
from iqtt.files.layout import NO_CUBE
from iqtt.shapes.polycube import ROTATIONS, canonical, canonical_class, is_chiral, mirror, set_ids
from scenegen.common.errors import FileFormatError, SpecError

PROOFS = {
    *("shapes", "one right answer", "answers differ", "stored ids", "splits apart", "rotations"),
    *("angles", "visibility", "cast again", "answer places", "pixel values", "framing"),
    *("distinct images", "distinct questions"),
}
BY_CUBES = PROOFS - {
    "answer places",
    "pixel values",
    "framing",
    "distinct images",
    "distinct questions",
}


def statuses(*paths: Path, **options: Any) -> dict[str, str]:
    return {proof.name: proof.status for proof in audit(paths, **options).proofs}


def set_shape(truth: h5py.Group, row: int, image: int, cubes: Any) -> None:
    """Store another shape of as many cubes, and ids that are right for it."""
    stored = truth["cubes"][row]
    stored[image, : len(cubes)] = cubes
    truth["cubes"][row] = stored
    for name, form in (("shape_id", canonical), ("class_id", canonical_class)):
        ids = truth[name][row]
        ids[image] = set_ids(form(np.asarray(cubes)[None])).view(np.uint8)
        truth[name][row] = ids


def shape(truth: h5py.Group, row: int, image: int) -> Any:
    return truth["cubes"][row, image, : truth["cube_count"][row]]


def test_a_fair_split_passes(split_folder: Path) -> None:
    told: list[int] = []
    found = audit([split_folder], progress=told.append)
    assert {proof.name: proof.status for proof in found.proofs} == dict.fromkeys(PROOFS, "ok")
    assert found.passed
    assert sum(told) == question_count([split_folder]) == 24
    assert [(t.name, t.answers, t.probed) for t in found.tables] == [
        ("iqtt-test.h5", "stored", 6),
        ("iqtt-train.h5 labeled", "stored", 6),
        ("iqtt-train.h5 unlabeled", "from the cubes", 6),
        ("iqtt-val.h5", "stored", 6),
    ]


def test_it_tells_all_in_json_text_and_markdown(split_folder: Path) -> None:
    found = audit([split_folder])
    record = json.loads(found.to_json())
    assert record["format"] == "pix2shape-bench/iqtt-audit"
    assert record["passed"] is True
    assert {proof["name"] for proof in record["proofs"]} == PROOFS
    assert all(0 <= p["low"] <= p["accuracy"] <= p["high"] <= 1 for p in record["probes"])
    assert all(len(t["fingerprint"]) == 64 for t in record["tables"])
    for text in (table(found), markdown(found)):
        assert "exactly one answer congruent to the reference" in text
        assert "silhouette's area" in text
        assert "No proof failed." in text
    assert audit([split_folder]).to_json() == found.to_json()


@pytest.mark.parametrize("name", ["iqtt-val.h5", "iqtt-test-answers.h5"])
def test_answers_that_name_another(failing: Callable[..., set[str]], name: str) -> None:
    def edit(file: h5py.File) -> None:
        file["answers"][...] = (file["answers"][()] + 1) % 3

    assert failing(edit, name) == {"one right answer"}


def test_uneven_answers(failing: Callable[..., set[str]]) -> None:
    def edit(file: h5py.File) -> None:
        file["answers"][...] = 0

    assert failing(edit) == {"one right answer", "answer places"}


def test_a_second_right_answer(failing: Callable[..., set[str]]) -> None:
    def edit(file: h5py.File) -> None:
        wrong = 1 + (file["answers"][2] + 1) % 3
        turned = shape(file["truth"], 2, 0) @ ROTATIONS[7].T
        set_shape(file["truth"], 2, wrong, turned)

    assert failing(edit) >= {"one right answer", "answers differ"}


def test_a_second_right_answer_where_no_answers_are_told(failing: Callable[..., set[str]]) -> None:
    def edit(file: h5py.File) -> None:
        truth = file["truth/unlabeled"]
        kinds = truth["distractor_kind"][2]
        wrong = int((kinds >= 0).argmax())
        set_shape(truth, 2, 1 + wrong, shape(truth, 2, 0))
        kinds[wrong] = -1
        truth["distractor_kind"][2] = kinds

    assert "one right answer" in failing(edit, "iqtt-train.h5")


def test_kinds_that_name_another(failing: Callable[..., set[str]]) -> None:
    def edit(file: h5py.File) -> None:
        kinds = file["truth/unlabeled/distractor_kind"]
        kinds[2] = np.roll(kinds[2], 1)

    assert failing(edit, "iqtt-train.h5") == {"one right answer"}


def test_distractors_alike(failing: Callable[..., set[str]]) -> None:
    def edit(file: h5py.File) -> None:
        first, second = (1 + (file["answers"][2] + k) % 3 for k in (1, 2))
        set_shape(file["truth"], 2, second, shape(file["truth"], 2, first) @ ROTATIONS[7].T)

    found = failing(edit)
    assert "answers differ" in found
    assert "one right answer" not in found


def test_a_mirror_image_in_another_split(
    failing: Callable[..., set[str]], split_folder: Path
) -> None:
    with h5py.File(split_folder / "iqtt-train.h5") as train:
        truths = (train["truth/labeled"], train["truth/unlabeled"])
        shapes = [shape(t, row, image) for t in truths for row in range(6) for image in range(4)]
    # Train has it in one hand only.
    chiral = next(
        cubes
        for cubes in shapes
        if is_chiral(cubes[None])[0] and not any(are_congruent(mirror(cubes), s) for s in shapes)
    )

    def edit(file: h5py.File) -> None:
        file["truth/cube_count"][0] = len(chiral)
        file["truth/cubes"][0] = NO_CUBE
        for image in range(4):
            set_shape(file["truth"], 0, image, mirror(chiral) @ ROTATIONS[image].T)

    assert "splits apart" in failing(edit)


def test_shapes_in_pieces(failing: Callable[..., set[str]]) -> None:
    def edit(file: h5py.File) -> None:
        cubes = file["truth/cubes"][3]
        cubes[1, 0] += 9
        file["truth/cubes"][3] = cubes

    assert failing(edit) >= {"shapes"}


@pytest.mark.parametrize("name", ["shape_id", "class_id"])
def test_ids_that_lie(failing: Callable[..., set[str]], name: str) -> None:
    def edit(file: h5py.File) -> None:
        ids = file[f"truth/{name}"][4]
        file[f"truth/{name}"][4] = ids[[1, 2, 3, 0]]

    assert failing(edit) == {"stored ids"}


def test_files_that_cannot_be_audited(split_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="paths"):
        audit([])
    with pytest.raises(FileNotFoundError, match="holds no iqtt"):
        audit([tmp_path])
    (tmp_path / "iqtt-val.h5").write_bytes(b"no HDF5")
    with pytest.raises(FileFormatError):
        audit([tmp_path])


def test_a_file_of_answers_stands_for_its_questions(split_folder: Path) -> None:
    test, answers = (split_folder / f"iqtt-test{kind}.h5" for kind in ("", "-answers"))
    assert audit([answers, test]).tables == audit([test]).tables
    assert statuses(test)["splits apart"] == "skipped"


def test_questions_without_answers(split_folder: Path, tmp_path: Path) -> None:
    shutil.copy(split_folder / "iqtt-test.h5", tmp_path)
    found = audit([tmp_path])
    assert found.passed
    assert found.probes == ()
    skipped = {proof.name for proof in found.proofs if proof.status == "skipped"}
    assert skipped == BY_CUBES | {"answer places"}
    both = audit([tmp_path, split_folder / "iqtt-val.h5"])
    assert "not told of iqtt-test.h5" in both.proofs[0].detail

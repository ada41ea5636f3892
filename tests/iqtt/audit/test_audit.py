"""The audit: a fair split passes, and every proof is seen to fail on its own damage."""

import json
import shutil
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import h5py
import numpy as np
import pytest
from audit_tables import audited
from h5_edits import attribute, gone
from refusals import refused

from iqtt.audit.audit import to_json
from iqtt.audit.proofs.images import content
from iqtt.audit.report import text
from iqtt.audit.strangers import RULES, audit_strangers
from iqtt.audit.table import content_problems, open_paths, read_table
from iqtt.files.reader import AnswersFile, QuestionsFile
from iqtt.shapes.polycube import ROTATIONS, canonical, canonical_class, set_ids
from scenegen.common.errors import FileFormatError
from scenegen.files.content import column_digest, row_digest, seal

OF_IMAGES = (
    "correct positions",
    "pixel values",
    "framing",
    "distinct images",
    "distinct questions",
)
BY_CUBES = {
    *("shapes", "one correct option", "options differ", "labels", "mirror images", "matched"),
    *("stored ids", "disjoint splits", "split by hash", "rotations", "angles", "lines of sight"),
    *("visibility", "ray-cast images", "unique solution"),
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


def another_background(images):
    images[(images == 255).all(axis=-1)] = 250
    return images


def scaled(image, factor):
    def change(values):
        values[image] *= factor
        return values

    return change


VAL, TEST, TRAIN = "iqtt-val.h5", "iqtt-test-answers.h5", "iqtt-train.h5"
ALL, VIEWS = slice(None), "truth/world_from_shape"
# File, what is done to it, and the proofs that fail; others may fail too where it ends in dots.
DAMAGES: list[tuple[str, Edit, str]] = [
    (VAL, changed("answers", ALL, lambda a: (a + 1) % 3), "one correct option"),
    (TEST, changed("answers", ALL, lambda a: (a + 1) % 3), "one correct option"),
    (VAL, second_right_answer, "one correct option, options differ, ..."),
    (TRAIN, changed("truth/unlabeled/distractor_kind", 2, np.flip), "one correct option, ..."),
    (VAL, changed("truth/cubes", 3, in_pieces), "shapes, ..."),
    (VAL, changed("truth/shape_id", 4, lambda ids: ids[[1, 2, 3, 0]]), "stored ids"),
    (VAL, changed("truth/class_id", 4, lambda ids: ids[[1, 2, 3, 0]]), "stored ids"),
    (VAL, at_the_border, "framing, ray-cast images"),
    (VAL, changed("questions", ALL, another_background), "framing, ray-cast images, ..."),
    *(
        (
            VAL,
            lambda file, by=by: changed(VIEWS, 1, scaled(wrong(file, 1), by))(file),
            "rotations, ...",
        )
        for by in (-1.0, 1.001, np.nan)
    ),
    (VAL, changed("truth/light_color", 3, scaled(2, 1.05)), "ray-cast images"),
    (VAL, changed("questions", 3, lambda images: images[[0, 2, 1, 3]]), "ray-cast images, ..."),
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
    assert failed >= {"distinct images", "ray-cast images"}


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
    assert all(p.detail in text(found, form) for form in (False, True) for p in found.proofs)


@pytest.mark.usefixtures("few_explained")
def test_a_file_of_answers_stands_for_its_questions(split_folder):
    test, answers = (split_folder / f"iqtt-test{kind}.h5" for kind in ("", "-answers"))
    found = audited([test])
    assert audited([answers, test]).tables == found.tables
    assert {p.name for p in found.proofs if p.status == "skipped"} == {"disjoint splits"}


@pytest.mark.usefixtures("few_explained")
def test_questions_without_answers(split_folder, tmp_path):
    shutil.copy(split_folder / "iqtt-test.h5", tmp_path)
    found = audited([tmp_path])
    assert found.passed
    assert found.probes == ()
    skipped = {proof.name for proof in found.proofs if proof.status == "skipped"}
    assert skipped == BY_CUBES | {"correct positions"}
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
    assert failed(plain(), [0, 1, 2, 0, 1, 0, 0]) == {"correct positions"}
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


FILES = ("iqtt-train.h5", "iqtt-val.h5", "iqtt-test.h5", "iqtt-test-answers.h5")


@contextmanager
def tables_of(*paths):
    with open_paths(paths) as opened:
        yield [read_table(*named, np.zeros(0, int)) for named in opened.items()]


def judged(*paths):
    """The proof of the content of some files, alone."""
    with tables_of(*paths) as tables:
        return content(tables)


def places(path):
    """Every attribute and every dataset of a file: (name, attribute or None)."""
    with h5py.File(path) as file:
        found = [("/", key) for key in file.attrs]

        def add(name, item):
            found.extend((name, key) for key in item.attrs)
            if isinstance(item, h5py.Dataset):
                found.append((name, None))

        file.visititems(add)
    return found


def flipped(value, rng):
    """The value with one bit changed, of a character or of a number."""
    if isinstance(value, str):
        at = int(rng.integers(len(value)))
        return value[:at] + chr(ord(value[at]) ^ 1) + value[at + 1 :]
    array = np.array(value)
    if array.dtype.kind == "O":
        array[0] = flipped(array[0], rng)
        return array
    raw = array.reshape(-1).view(np.uint8)
    raw[rng.integers(raw.size)] ^= 1 << rng.integers(8)
    return array


@pytest.mark.parametrize("every", [27, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", FILES)
def test_every_changed_bit_is_found(split_folder, tmp_path, name, every):
    """Of one place in 27; the slow test changes all."""
    rng = np.random.default_rng(7)
    for one in FILES:
        shutil.copy(split_folder / one, tmp_path)
    assert judged(tmp_path / name).status == "ok"
    whole, missed = (split_folder / name).read_bytes(), []
    for where, key in places(split_folder / name)[::every]:
        with h5py.File(tmp_path / name, "r+") as file:
            if key is None:
                file[where][...] = flipped(file[where][()], rng)
            else:
                file[where].attrs[key] = flipped(file[where].attrs[key], rng)
        try:
            if judged(tmp_path / name).status != "FAIL":
                missed.append((where, key))
        except FileFormatError:
            pass
        (tmp_path / name).write_bytes(whole)
    assert missed == []


def test_nothing_may_be_added_taken_away_or_renamed(damaged):
    edits = {
        "an attribute more": attribute("note", "mine"),
        "a dataset more": lambda file: file.create_dataset("x", data=1),
        "a name more": lambda file: file.__setitem__("zz", file["questions"]),
        "no digest of a dataset": lambda file: file["answers"].attrs.__delitem__("sha256"),
        "a group renamed": lambda file: file.move("truth", "lies"),
    }
    for name, edit in edits.items():
        assert judged(damaged(edit)).status == "FAIL", name


def test_a_forger_who_seals_again_has_another_digest_of_truth(damaged):
    """That digest is what score files name."""

    def forge(file):
        file["answers"][:] = (file["answers"][:] + 1) % 3
        file["answers"].attrs["sha256"] = column_digest(map(row_digest, file["answers"][:]))
        seal(file)

    path = damaged(forge)
    with tables_of(path) as (table,):
        assert table.truth_changed
        assert len(content_problems([table])) == 1
    with AnswersFile(path) as answers:
        assert len(answers.problems()) == 1


def test_released_files_have_no_digests_and_are_not_judged(split_folder, released):
    without = released("x.h5")
    assert judged(without).status == "skipped"
    both = judged(without, split_folder / "iqtt-train.h5")
    assert both.status == "ok"
    assert without.name in both.detail


def test_new_files_must_have_their_digests(damaged):
    for name in ("content_digest", "truth_digest"):
        with refused(FileFormatError, f"attribute {name!r}", "none"):
            judged(damaged(gone(name)))


L = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1]]  # chiral
FLAT = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]  # its mirror image is itself
TILTED = [[0.8, 0.0, 0.6], [0.36, 0.8, -0.48], [-0.48, 0.6, 0.64]]
OTHER = [[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]]


def mirrored(cubes):
    return [[-x, y, z] for x, y, z in cubes]


def view(cubes, rotation=TILTED):
    return {"cubes": cubes, "rotation": rotation}


def faults(tmp_path, *questions, **more):
    path = tmp_path / "shapes.json"
    path.write_text(json.dumps({"questions": questions, **more}))
    return [set(found) for found in audit_strangers(path, lambda done: None)["faults"]]


GOOD = {"reference": view(L), "answers": [view(L, OTHER), view(mirrored(L), OTHER)], "key": 0}
CASES = [
    (GOOD, set()),
    ({**GOOD, "key": 1}, {"wrong key"}),
    ({**GOOD, "key": 2}, {"wrong key"}),
    ({**GOOD, "answers": GOOD["answers"][1:] * 2}, {"no correct option", "equal images"}),
    (
        {"reference": view(FLAT), "answers": [view(FLAT, OTHER), view(mirrored(FLAT), TILTED)]},
        {"more than one correct option"},
    ),
    ({**GOOD, "answers": [view(L, OTHER), view(L[:4], OTHER)]}, {"different cube counts"}),
    ({**GOOD, "answers": [view(L, OTHER), view([*L[:4], [5, 5, 5]])]}, {"more than one piece"}),
    (
        {**GOOD, "reference": view(L, np.eye(3).tolist())},
        {"hidden cube"},  # the cube at [2, 1, 0] lies behind that at [2, 1, 1]
    ),
]


@pytest.mark.parametrize(("question", "expected"), CASES)
@pytest.mark.parametrize("more", [{}, {"camera_distance": 40.0}])
def test_each_fault_is_named(tmp_path, question, expected, more):
    assert faults(tmp_path, question, **more) == [expected]
    assert expected <= set(RULES)


def test_questions_of_ours_have_no_fault(split_folder, tmp_path):
    with QuestionsFile(split_folder / "iqtt-val.h5") as file:
        truths = [truth for row in range(len(file)) if (truth := file.truth(row)) is not None]
        answers = [record.answer for record in file]
    for truth, answer in zip(truths, answers, strict=True):
        views = [
            view(cubes.tolist(), rotation.tolist())
            for cubes, rotation in zip(truth.cubes, truth.world_from_shape, strict=True)
        ]
        question = {"reference": views[0], "answers": views[1:], "key": answer}
        distance = float(truth.camera.position[2])
        assert faults(tmp_path, question, camera_distance=distance) == [set()]


@pytest.mark.parametrize(
    "content",
    [
        "nonsense", "[]", '{"questions": []}',
        json.dumps({"questions": [{**GOOD, "reference": view([[0, 0, 0.5]])}]}),
        json.dumps({"questions": [{**GOOD, "reference": view([*L, L[0]])}]}),
        json.dumps({"questions": [{**GOOD, "answers": GOOD["answers"][:1]}]}),
        json.dumps({"questions": [{**GOOD, "reference": view(L, np.diag([1, 1, -1]).tolist())}]}),
        json.dumps({"questions": [GOOD], "camera_distance": 1.0}),
    ],
)  # fmt: skip
def test_what_is_no_list_of_questions_is_refused(tmp_path, content):
    path = tmp_path / "shapes.json"
    path.write_text(content)
    with pytest.raises(FileFormatError):
        audit_strangers(path, lambda done: None)

"""Question files read with the reading API, and beside it with plain h5py."""

import dataclasses
import itertools

import h5py
import numpy as np
import pytest
from streamed import check_equal, stored

from iqtt import QuestionStream, SplitSpec, make_split
from iqtt.files.layout import NO_CUBE
from iqtt.files.preview import RIGHT, question_sheet
from iqtt.files.reader import AnswersFile, QuestionsDataset, answers_beside, open_questions, parts
from iqtt.questions.kinds import DISTRACTOR_KINDS
from iqtt.questions.specs import SUITE
from iqtt.shapes.polycube import canonical_class
from iqtt.shapes.splits import split_of

TABLES = [  # of the tiny split: file, part, answers told, truth told
    ("iqtt-train.h5", "labeled", True, True),
    ("iqtt-train.h5", "unlabeled", False, True),
    ("iqtt-val.h5", "", True, True),
    ("iqtt-test.h5", "", False, False),
]


@pytest.mark.parametrize(("name", "part", "answered", "known"), TABLES)
def test_records_are_what_the_file_holds(split_folder, name, part, answered, known):
    with open_questions(split_folder / name, part) as questions, h5py.File(questions.path) as file:
        raw = file[part or "/"]
        assert len(questions) == 6
        assert (questions.has_answers, questions.has_truth) == (answered, known)
        assert questions.part == part
        assert questions.split == name.split("-")[1].removesuffix(".h5")
        assert questions.fingerprint == file.attrs["fingerprint" + ("_" + part if part else "")]
        assert (questions.height, questions.width, questions.image_dtype) == (32, 32, "uint8")
        assert questions.spec.seed is None
        assert questions.attributes["writer"] == file.attrs["writer"]
        for i, record in enumerate(questions):
            assert record.index == i
            np.testing.assert_array_equal(record.images, raw["questions"][i])
            assert record.radiance.dtype == np.float32
            np.testing.assert_allclose(record.radiance, record.images / 255, atol=1e-7)
            assert record.answer == (raw["answers"][i] if answered else None)
            assert (record.truth is not None) == known


def test_truth_has_no_padding_and_agrees_with_the_images(split_folder):
    with open_questions(split_folder / "iqtt-val.h5") as questions:
        records = list(questions)
        cubes, lights = questions.read("cubes", slice(0, 6)), questions.read("light_count", 3)
        assert (cubes == NO_CUBE).any(), "some shapes are smaller than the largest"
    assert len(records[3].truth.light_position) == len(records[3].truth.light_color) == 4
    assert [len(one) for one in records[3].truth.light_color] == lights.tolist()
    for record in records:
        truth = record.truth
        assert truth.cubes.dtype == np.int8
        assert (truth.cubes != NO_CUBE).all()
        assert truth.visible_pixels.shape == truth.cubes.shape[:2]
        hit = np.isfinite(truth.depth)
        assert truth.visible_pixels.sum(axis=1).tolist() == hit.sum(axis=(1, 2)).tolist()
        assert (record.images[~hit] == 255).all(), "the background is white"
        same = [k for k in range(3) if truth.shape_id[k + 1] == truth.shape_id[0]]
        assert same == [record.answer] == [k for k, v in enumerate(truth.distractor_kind) if not v]
        assert set(truth.distractor_kind) <= {None, *DISTRACTOR_KINDS}
        assert truth.camera == questions.spec.camera(truth.camera.position[2])
        assert questions.spec.min_angle_degrees <= truth.angle_degrees <= 180


def test_answers_of_another_file(split_folder, damaged, released):
    path, answers = split_folder / "iqtt-test.h5", split_folder / "iqtt-test-answers.h5"
    assert answers_beside(path) == answers_beside(str(path)) == answers
    assert answers_beside(split_folder / "iqtt-val.h5") is None
    with open_questions(path, answers=answers) as questions, h5py.File(answers) as file:
        assert questions.has_answers
        assert questions.has_truth
        assert [record.answer for record in questions] == file["answers"][:].tolist()
        kinds = [record.truth.distractor_kind.index(None) for record in questions]
        assert kinds == file["answers"][:].tolist()
        assert questions.read("cubes", 2).shape == (4, 7, 3)
    with AnswersFile(answers) as known:
        assert len(known) == 6
        assert known.fingerprint == questions.fingerprint
        assert known.truth(-1).distractor_kind == known.truth(5).distractor_kind
        assert known.read("answers", slice(1, 4)).tolist() == [
            known.read("answers", i) for i in (1, 2, 3)
        ]
    with AnswersFile(split_folder / "iqtt-train.h5") as known:
        assert (known.part, len(known)) == ("labeled", 6)
    plain = released("iqtt-test.h5", {"": (4, None)})
    with h5py.File(plain.with_name("iqtt-test-answers.h5"), "w") as file:
        file["answers"] = np.array([0, 2, 1, 1])
    with open_questions(plain, answers=answers_beside(plain)) as questions:
        assert [record.answer for record in questions] == [0, 2, 1, 1]


@pytest.mark.parametrize("shape", [(5,), (5, 1)])
@pytest.mark.parametrize("dtype", ["uint8", "int8", ">i4", "int64", "uint64"])
def test_released_answers_of_any_integer_type(released, shape, dtype):
    answers = np.array([2, 0, 1, 1, 2], dtype).reshape(shape)
    with open_questions(released(tables={"": (5, answers)})) as questions:
        assert [record.answer for record in questions] == [2, 0, 1, 1, 2]
        assert questions.read("answers", slice(1, 3)).tolist() == [0, 1]
        assert questions.read("answers", 1).dtype == np.uint8
        assert questions.spec is questions.split is questions.fingerprint is None
        assert not questions.has_truth
        assert questions[0].truth is None


@pytest.mark.parametrize("dtype", ["float32", "uint8", "float16", ">f4"])
@pytest.mark.parametrize("options", [{}, {"chunks": (2, 4, 7, 24, 1), "compression": "gzip"}])
def test_released_images(released, dtype, options):
    path = released("iqtt-train.h5", {"labeled": (3, [0, 1, 2]), "unlabeled": (7, None)}, dtype)
    assert parts(path) == ("labeled", "unlabeled")
    for part, count in (("labeled", 3), ("unlabeled", 7)):
        with open_questions(path, part) as questions, h5py.File(path) as file:
            assert len(questions) == count
            assert (questions.height, questions.width) == (20, 24)
            assert questions.has_answers == (part == "labeled")
            stored = file[part]["questions"][count - 1]
            np.testing.assert_array_equal(questions[-1].images, stored)
            assert questions[-1].radiance.dtype == np.float32
            assert questions[-1].radiance.max() <= 1.001


def test_parts(split_folder, released):
    assert parts(split_folder / "iqtt-train.h5") == ("labeled", "unlabeled")
    assert parts(split_folder / "iqtt-test.h5") == parts(released()) == ("",)
    only = released("iqtt-train.h5", {"unlabeled": (4, None)})
    assert parts(only) == ("unlabeled",)
    with open_questions(only) as questions:
        assert (questions.part, len(questions)) == ("unlabeled", 4)


def test_an_empty_table(released):
    path = released(tables={"labeled": (0, np.zeros(0, np.int64)), "unlabeled": (2, None)})
    with open_questions(path, "labeled") as questions:
        assert (len(questions), list(questions)) == (0, [])
        assert questions.read("questions", slice(0, 9)).shape == (0, 4, 20, 24, 3)
        with pytest.raises(IndexError):
            questions[0]


def test_fields_are_what_there_is(split_folder, released):
    assert QuestionsDataset(split_folder / "iqtt-train.h5", "unlabeled").fields == ("questions",)
    assert list(QuestionsDataset(released("a.h5", {"": (4, None)}))[3]) == ["questions"]
    assert list(QuestionsDataset(released("b.h5"))[3]) == ["questions", "answers"]
    path = split_folder / "iqtt-test.h5"
    data = QuestionsDataset(path, answers=split_folder / "iqtt-test-answers.h5")
    assert data.fields == ("questions", "answers")
    data = QuestionsDataset(split_folder / "iqtt-val.h5", fields=["cubes", "depth", "answers"])
    shapes = {name: values.shape for name, values in data[2].items()}
    assert shapes == {"cubes": (4, 7, 3), "depth": (4, 32, 32), "answers": ()}


def expected_rows(folder, split="train"):
    """Return all columns of a split's questions; in training labelled ones come first."""
    if split == "train":
        parts = ("labeled", "unlabeled")
        images = stored(folder / "iqtt-train.h5", *parts)
        truth = stored(folder / "iqtt-train.h5", *(f"truth/{part}" for part in parts))
        return {"questions": images["questions"], **truth}
    columns = stored(folder / f"iqtt-{split}.h5")
    return {name.removeprefix("truth/"): values for name, values in columns.items()}


def small(folder):
    spec = SplitSpec(seed=5, train=12, labeled=6, val=6, test=6, cubes=(5, 7), lights=(1, 2),
                     height=32, width=32, min_cube_pixels=2, with_depth=True)  # fmt: skip
    return spec, expected_rows(folder), expected_rows(folder, "val")


def test_rows_are_those_of_the_file(split_folder):
    spec, train, val = small(split_folder)
    check_equal(QuestionStream(spec, fields=[*train], batch=5, stop=12), train)
    check_equal(QuestionStream(spec, fields=[*val], batch=4, stop=6, split="val"), val)
    two = {"questions": train["questions"][[3, 4, 5, 9, 10, 11]]}
    ranks = {"rank": 1, "world_size": 2}
    check_equal(QuestionStream(spec, fields=["questions"], batch=3, stop=12, **ranks), two)


def test_beyond_a_file_positions_are_balanced_in_blocks_and_shapes_are_of_training(
    split_folder, monkeypatch
):
    spec, _, _ = small(split_folder)
    monkeypatch.setattr("iqtt.files.stream.BLOCK", 12)
    for batch in QuestionStream(spec, fields=["answers", "cubes"], batch=12, start=12, stop=48):
        assert np.bincount(batch["answers"]).tolist() == [4, 4, 4]
        for cubes in batch["cubes"][:, 0]:
            used = cubes[cubes[:, 0] != NO_CUBE]
            assert split_of(canonical_class(used[None]), chains=True).tolist() == [0]


def test_pictures_stay_on_the_device(split_folder):
    torch = pytest.importorskip("torch")
    spec, train, _ = small(split_folder)
    fields = ["questions", "depth", "answers"]
    for batch in QuestionStream(spec, fields=fields, batch=12, stop=12, on_device=True):
        for name in ("questions", "depth"):
            found = torch.from_dlpack(batch[name]).numpy()
            np.testing.assert_array_equal(found, train[name], err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("kind", SUITE)
def test_all_kinds_have_the_bits_of_files(kind, tmp_path):
    distractors, answers = SUITE[kind]
    spec = SplitSpec(distractors=distractors, answers=answers, train=70, labeled=20, val=0, test=0,
                     height=32, width=32, min_cube_pixels=1, with_depth=True)  # fmt: skip
    make_split(tmp_path / "split", spec)
    expected = expected_rows(tmp_path / "split")
    for batch, workers in itertools.product((1, 7, 64), (0, 1, 2)):
        stream = QuestionStream(spec, fields=[*expected], batch=batch, stop=70, workers=workers)
        check_equal(stream, expected)


@pytest.fixture(scope="module")
def records(split_folder):
    with open_questions(split_folder / "iqtt-val.h5") as questions:
        return list(questions)


def has(pixels, color):
    return int((pixels == color).all(axis=-1).sum())


def test_nothing_is_given_away_unless_asked(records):
    for record in records:
        sheet = np.asarray(question_sheet([record], False))
        assert has(sheet, RIGHT) == 0
        unanswered = dataclasses.replace(record, answer=None, truth=None)
        assert np.array_equal(sheet, np.asarray(question_sheet([unanswered], False)))


def test_shapes_beside_released_questions_are_nobodys(damaged):
    path = damaged(lambda file: file.attrs.clear())
    with open_questions(path) as questions:
        assert questions.fields == ("questions", "answers")

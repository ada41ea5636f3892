"""Streams of questions have the bits of files of questions."""

import itertools

import numpy as np
import pytest
from streamed import check_equal, stored

from iqtt import QuestionStream, SplitSpec, make_split
from iqtt.files.layout import NO_CUBE
from iqtt.questions.specs import SUITE
from iqtt.shapes.polycube import canonical_class
from iqtt.shapes.splits import split_of
from scenegen.common.errors import SpecError


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


def test_settings_that_no_stream_has():
    for wrong in ({"fields": ["image"]}, {"split": "training"}, {"batch": 5000}):
        with pytest.raises(SpecError):
            QuestionStream("matched", **wrong)
    with pytest.raises(SpecError, match="at most 4 rows"):
        QuestionStream(SplitSpec(height=4096, width=4096), batch=5)
    with pytest.raises(SpecError):
        QuestionStream("matches")
    with pytest.raises(SpecError):
        QuestionStream({SplitSpec(cubes=(6, 6), answers=n, distractors="near"): 1 for n in (2, 3)})


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

"""Rows for models: the right letter in every order, pictures that show the stored cubes."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from sheets import find

from iqtt.files.reader import QuestionsFile
from iqtt.vlm.pictures import composed, draw_pictures, stored_question
from iqtt.vlm.reading import LETTERS
from iqtt.vlm.rows import Asked, vlm_rows
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rooms.preview import srgb_bytes


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)))


def test_the_letter_of_every_rotation_shows_the_right_answer(asked: Asked) -> None:
    rows = list(vlm_rows(asked))
    assert [row.id for row in rows[:4]] == ["0-0", "0-1", "0-2", "1-0"]
    with QuestionsFile(asked.path) as questions:
        for row in rows:
            letter = LETTERS.index(row.answer or "")
            assert row.original(letter) == questions[row.question_index].answer
            first = rows[3 * row.question_index]
            for k in range(3):
                assert row.images[1 + k] == first.images[1 + row.original(k)]
            assert row.images[0] == first.images[0]


def test_pictures_are_the_stored_ones_drawn_finer(asked: Asked) -> None:
    with QuestionsFile(asked.path) as questions:
        assert questions.spec is not None
        truths = [truth for i in range(6) if (truth := questions.truth(i)) is not None]
        shown = [stored_question(questions.spec, truth) for truth in truths]
        drawn = list(draw_pictures(questions.spec, shown, 64))
        for record, pictures in zip(questions, drawn, strict=True):
            stored = srgb_bytes(record.radiance).repeat(2, axis=1).repeat(2, axis=2)
            differs = np.abs(stored.astype(int) - pictures).max(axis=-1) > 3
            # A ray through a pixel's centre and the mean of its four corners differ at edges only.
            assert differs.mean() < 0.12
            inside = ~differs
            assert np.abs(stored.astype(int) - pictures)[inside].mean() < 1


def test_a_composed_picture_holds_the_pictures_themselves() -> None:
    pictures = np.random.default_rng(0).integers(0, 256, (4, 64, 80, 3), np.uint8)
    at = [find(np.asarray(composed(pictures)), picture) for picture in pictures]
    assert at[0][0] < at[1][0] == at[2][0] == at[3][0]
    assert at[1][1] < at[2][1] < at[3][1]


def test_a_withheld_test_tells_nothing_beside_its_pictures(split_folder: Path) -> None:
    test = Asked(split_folder / "iqtt-test.h5", size=64)
    for row in vlm_rows(test):
        assert row.answer is None
        assert set(row.facts.values()) == {None}
    told = list(vlm_rows(replace(test, with_answers=True)))
    with QuestionsFile(test.path, answers=split_folder / "iqtt-test-answers.h5") as questions:
        assert [LETTERS.index(row.answer or "") for row in told] == [q.answer for q in questions]


def test_a_file_that_cannot_be_drawn_is_refused(split_folder: Path, tmp_path: Path) -> None:
    alone = tmp_path / "iqtt-test.h5"
    alone.write_bytes((split_folder / "iqtt-test.h5").read_bytes())
    with pytest.raises(FileFormatError):
        next(vlm_rows(Asked(alone, size=64)))
    for change in ({"rotations": 2}, {"size": 8}, {"answers": split_folder / "iqtt-val.h5"}):
        with pytest.raises((SpecError, FileFormatError)):
            next(vlm_rows(replace(Asked(alone), **change)))

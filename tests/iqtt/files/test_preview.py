"""Sheets of questions: measured, since nobody looks at them in a test."""

import dataclasses

import numpy as np
import pytest
from sheets import enlarged, find

from iqtt.files.preview import RIGHT, question_sheet
from iqtt.files.reader import open_questions
from scenegen.rooms.preview import srgb_bytes


@pytest.fixture(scope="module")
def records(split_folder):
    with open_questions(split_folder / "iqtt-val.h5") as questions:
        return list(questions)


def shown(record, factor=1):
    """The four images as a sheet should show them, `factor` times as large."""
    return [enlarged(srgb_bytes(image), factor) for image in record.radiance]


def has(pixels, color):
    return int((pixels == color).all(axis=-1).sum())


def framed(sheet, places, size=(128, 128)):
    """Tell of each tile whether the frame of the right answer surrounds it, and nothing half."""
    found = []
    for y, x in places:
        around = np.ones((size[0] + 6, size[1] + 6), bool)
        around[3:-3, 3:-3] = False
        ring = sheet[y - 3 : y + size[0] + 3, x - 3 : x + size[1] + 3][around]
        assert has(ring, RIGHT) in (0, len(ring))
        found.append(has(ring, RIGHT) > 0)
    return found


@pytest.mark.parametrize("show_answers", [False, True])
def test_reference_then_answers_in_reading_order(records, show_answers):
    sheet = np.asarray(question_sheet(records[:3], show_answers))
    for i, record in enumerate(records[:3]):
        places = [find(sheet, tile) for tile in shown(record, 4)]
        assert len({y for y, _ in places}) == 1
        gaps = np.diff([x for _, x in places]) - 128
        assert 0 < gaps[1] == gaps[2] < gaps[0] / 2, "the reference stands apart"
        right = [False] + [show_answers and k == record.answer for k in range(3)]
        assert framed(sheet, places) == right
        y = places[0][0]
        assert i == 0 or y > find(sheet, shown(records[i - 1], 4)[0])[0] + 128 + 20


def test_nothing_is_given_away_unless_asked(records):
    for record in records:
        sheet = np.asarray(question_sheet([record], False))
        assert has(sheet, RIGHT) == 0
        unanswered = dataclasses.replace(record, answer=None, truth=None)
        assert np.array_equal(sheet, np.asarray(question_sheet([unanswered], False)))

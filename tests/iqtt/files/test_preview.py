"""Sheets of questions: measured, since nobody looks at them in a test."""

import dataclasses

import numpy as np
import pytest
from sheets import enlarged, find

from iqtt.files.preview import BACKGROUND, RIGHT, question_sheet
from iqtt.files.reader import QuestionRecord, open_questions
from scenegen.rooms.preview import srgb_bytes

BELOW = slice(128, 150)  # rows of the labels, from the tiles' top


@pytest.fixture(scope="module")
def records(split_folder):
    with open_questions(split_folder / "iqtt-val.h5") as questions:
        return list(questions)


def noise(size, answer=1, dtype="uint8", index=0):
    """A question of noise, so that each tile can be found in a sheet."""
    images = np.random.default_rng(index).integers(0, 256, (4, *size, 3)).astype(dtype)
    return QuestionRecord(index, images if dtype == "uint8" else images / 255, answer, None)


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
        (y, x), label = places[0], [sheet[places[0][0] :][BELOW, x : x + 128] for _, x in places]
        assert all((one != BACKGROUND).any() for one in label), "each has a label"
        line = sheet[y : y + 128, x + 128 + gaps[0] // 2]
        assert has(line, line[0]) == 128, "a divider behind the reference"
        assert line[0].max() < 220
        assert i == 0 or y > find(sheet, shown(records[i - 1], 4)[0])[0] + 128 + 20


def test_labels_tell_index_letters_kinds_and_angle(records):
    """A label changes with what it tells, all else being equal, and with nothing else."""

    def labels(record, show_answers=True):
        sheet = np.asarray(question_sheet([record], show_answers))
        places = [find(sheet, tile) for tile in shown(record, 4)]
        return [sheet[y:][BELOW, x : x + 128] for y, x in places]

    def differing(record, other):
        pairs = zip(labels(record), labels(other), strict=True)
        return [k for k, (a, b) in enumerate(pairs) if not np.array_equal(a, b)]

    base = dataclasses.replace(records[0], answer=0)
    kinds = dataclasses.replace(base.truth, distractor_kind=(None, "near", "mirror"))
    told = dataclasses.replace(base, truth=kinds)
    other = dataclasses.replace(kinds, distractor_kind=(None, "near", "other"))
    angle = dataclasses.replace(kinds, angle_degrees=kinds.angle_degrees + 5)
    assert differing(told, dataclasses.replace(told, index=7)) == [0]
    assert differing(told, dataclasses.replace(told, truth=other)) == [3]
    assert differing(told, dataclasses.replace(told, truth=angle)) == [1]
    assert differing(told, dataclasses.replace(told, truth=None)) == [1, 2, 3]
    a, b, c = (one[:, 40:88] for one in labels(base, show_answers=False)[1:])
    assert not np.array_equal(a, b)
    assert not np.array_equal(b, c)


def test_nothing_is_given_away_unless_asked(records):
    for record in records:
        sheet = np.asarray(question_sheet([record], False))
        assert has(sheet, RIGHT) == 0
        assert np.array_equal(sheet, np.asarray(question_sheet([unanswered(record)], False)))


def unanswered(record):
    return dataclasses.replace(record, answer=None, truth=None)


def test_the_right_answer_is_known_from_the_truth_too(records):
    sheet = np.asarray(question_sheet([dataclasses.replace(records[0], answer=None)], True))
    assert np.array_equal(sheet, np.asarray(question_sheet([records[0]], True)))


@pytest.mark.parametrize(
    ("size", "factor"),
    [((16, 16), 8), ((100, 100), 2), ((256, 200), 1), ((20, 60), 3)],
)
@pytest.mark.parametrize("dtype", ["uint8", "float32"])
def test_images_of_any_size_keep_their_pixels(size, factor, dtype):
    record = noise(size, dtype=dtype)
    sheet = np.asarray(question_sheet([record], True))
    places = [find(sheet, tile) for tile in shown(record, factor)]
    tile = (size[0] * factor, size[1] * factor)
    assert framed(sheet, places, tile) == [False, False, True, False]


def test_large_images_are_averaged_down():
    record = noise((512, 512))
    sheet = np.asarray(question_sheet([record], False))
    means = srgb_bytes(record.radiance[0]).reshape(256, 2, 256, 2, 3).mean(axis=(1, 3))
    assert np.abs(sheet[16:272, 16:272] - means).max() <= 1
    assert sheet.shape[1] < 1200


def test_many_questions_stand_in_two_columns():
    few, many = ([noise((32, 32), index=i) for i in range(n)] for n in (4, 5))
    a, b = question_sheet(few, False), question_sheet(many, False)
    assert (b.width, b.height < a.height) == (2 * a.width, True)
    places = [find(np.asarray(b), shown(record, 4)[0]) for record in many]
    assert places == sorted(places), "in reading order"

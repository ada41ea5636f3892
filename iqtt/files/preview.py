"""Pictures of questions: a sheet with the reference and the answers of each."""

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from iqtt.files.reader import QuestionRecord
from iqtt.questions.specs import LETTERS
from scenegen.rooms.preview import BACKGROUND, FAINT, INK, srgb_bytes

Array = NDArray[Any]
SMALLEST_TILE, LARGEST_TILE = 128, 256  # other images are scaled by a whole factor
FRAME = 4  # pixels around the right answer
GAP = 10  # pixels between answers
WIDE_GAP = 34  # pixels between reference and answers, with a line in the middle
MARGIN = 16  # pixels around a question
LABEL_HEIGHT = 22
LINE_HEIGHT, LETTER_WIDTH = 18, 7  # pixels of the text above the questions
RIGHT = (0, 128, 94)  # Okabe and Ito's green, darker
LINE = (190, 190, 190)
MANY = 4  # more questions than this stand in two columns


def question_sheet(
    records: Sequence[QuestionRecord], show_answers: bool, task: str = ""
) -> Image.Image:
    """Return a sheet with a row for each question: the reference, then answers A, B and C.

    Args:
        records: one or more questions with images of one size.
        show_answers: whether to frame the right answer, and to name the kind of the wrong ones.
        task: what is asked; it stands above the questions.
    """
    pictures = [[_tile(image) for image in np.nan_to_num(record.radiance)] for record in records]
    (width, height), answers = _slot(pictures[0][0]), len(pictures[0]) - 1
    wide = (1 + answers) * width + WIDE_GAP + (answers - 1) * GAP + 2 * MARGIN
    cell = (wide, height + LABEL_HEIGHT + MARGIN + 2 * FRAME)
    columns = 2 if len(records) > MANY else 1
    lines = -(-len(records) // columns)
    asked = textwrap.wrap(task, (columns * wide - 2 * MARGIN) // LETTER_WIDTH)
    header = LINE_HEIGHT * len(asked)
    sheet = Image.new("RGB", (columns * wide, header + lines * cell[1] + MARGIN), BACKGROUND)
    font = ImageFont.load_default(size=12)
    ImageDraw.Draw(sheet).text((MARGIN, MARGIN // 2), "\n".join(asked), fill=INK, font=font)
    for i, (record, tiles) in enumerate(zip(records, pictures, strict=True)):
        corner = i % columns * wide + MARGIN, header + i // columns * cell[1] + MARGIN
        _draw_question(sheet, corner, record, tiles, show_answers)
    return sheet


def _draw_question(
    sheet: Image.Image,
    corner: tuple[int, int],
    record: QuestionRecord,
    tiles: Sequence[Image.Image],
    show_answers: bool,
) -> None:
    draw = ImageDraw.Draw(sheet)
    font, strong = ImageFont.load_default(size=12), ImageFont.load_default(size=14)
    (left, top), (width, height) = corner, _slot(tiles[0])
    answer = _right_answer(record) if show_answers else None
    below = top + height + FRAME + 4
    for k, tile in enumerate(tiles):
        slot = left + k * (width + GAP) + (k > 0) * (WIDE_GAP - GAP)
        x, right = slot + (width - tile.width) // 2, answer is not None and k == answer + 1
        by = FRAME if right else 1
        box = (x - by, top - by, x + tile.width + by - 1, top + height + by - 1)
        draw.rectangle(box, fill=RIGHT if right else LINE)
        sheet.paste(tile, (x, top))
        letter, note = "" if k == 0 else LETTERS[k - 1], ""
        if k == 0:
            note = f"question {record.index}"
        elif show_answers:
            note = _note(record, k - 1, right)
        start = slot + (width - strong.getlength(letter) - font.getlength(note)) / 2
        draw.text((start, below - 2), letter, fill=RIGHT if right else INK, font=strong)
        start += strong.getlength(letter)
        draw.text((start, below), note, fill=RIGHT if right else FAINT, font=font)
    x = left + width + WIDE_GAP // 2
    draw.line((x, top, x, top + height), fill=LINE)


def _right_answer(record: QuestionRecord) -> int | None:
    """Return which answer is right, from the answers or else from the truth; None if unknown."""
    if record.answer is None and record.truth is not None and None in record.truth.distractor_kind:
        return record.truth.distractor_kind.index(None)
    return record.answer


def _note(record: QuestionRecord, k: int, right: bool) -> str:
    """Return the text below answer k: whether it is right, or its kind."""
    if right:
        return "   correct" + (
            f", rotated {record.truth.angle_degrees:.0f}°" if record.truth else ""
        )
    kind = record.truth.distractor_kind[k] if record.truth else None
    return f"   {kind}" if kind else ""


def _slot(tile: Image.Image) -> tuple[int, int]:
    """Return width and height of the place of a tile, wide enough for the text below it."""
    return max(tile.width, SMALLEST_TILE), tile.height


def _tile(radiance: Array) -> Image.Image:
    picture = Image.fromarray(srgb_bytes(radiance))
    longest = max(picture.size)
    if longest > LARGEST_TILE:
        return picture.reduce(-(-longest // LARGEST_TILE))
    factor = -(-SMALLEST_TILE // longest)
    return picture.resize(
        (picture.width * factor, picture.height * factor), Image.Resampling.NEAREST
    )

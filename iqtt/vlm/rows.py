"""Questions as rows for models: pictures, text, and what the file tells of the answer."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from iqtt.files.reader import QuestionsFile, answers_beside
from iqtt.files.truth import QuestionTruth
from iqtt.floors import floors_of
from iqtt.perspective.columns import RoomTruth
from iqtt.questions.kinds import DISTRACTOR_KINDS, question_kind
from iqtt.questions.specs import QuestionSpec, SplitSpec
from iqtt.vlm.pictures import composed, draw_pictures, png, stored_pictures, stored_question
from iqtt.vlm.prompt import LARGEST, SIZE, SMALLEST, question_text
from iqtt.vlm.reading import LETTERS
from scenegen.common.errors import FileFormatError
from scenegen.common.records import check
from scenegen.files.rows import chosen_rows

Array = NDArray[Any]
Layout = Literal["composed", "separate"]
AT_ONCE = 16  # questions whose truth is in memory


@dataclass(frozen=True)
class Asked:
    """A file of questions, and how a model is asked them.

    Attributes:
        path: the file of questions.
        part: "labeled" or "unlabeled" of a training file.
        answers: the file of the test answers, which holds the cubes; None takes the one beside.
        with_answers: whether rows of a test file tell the answers.
        layout: one picture of all, or one picture each.
        rotations: 1, or as many as there are answers: in rotation r, answer r comes first.
        size: of the shorter side of each picture, pixels.
        with_reference: False leaves the reference out, for a control.
        items: rows that are asked; all by default.
        device: as in `backend.DEVICES`.
    """

    path: str | Path
    part: str | None = None
    answers: str | Path | None = None
    with_answers: bool = False
    layout: Layout = "composed"
    rotations: int = 1
    size: int = SIZE
    with_reference: bool = True
    items: Sequence[int] | None = None
    device: str = "auto"


@dataclass(frozen=True, eq=False)
class Row:
    """A question in one order of its answers.

    Attributes:
        id: of the row, such as "17-0".
        question_index: row of the question in its file.
        rotation: letter k shows the answer (k + rotation) mod K of the file.
        pictures: the reference, then the answers in the order of their letters, (1 + K, H, W, 3)
            sRGB uint8.
        layout, with_reference: as in `Asked`.
        letters: those of the answers.
        answer: the right letter; None where it is withheld.
        facts: kind, angle, cubes, shape and floor, as `truth` has them; None where withheld.
        digest: fingerprint of the table that the question is from.
        of_rooms: whether it is about furnished rooms, not shapes.
    """

    id: str
    question_index: int
    rotation: int
    pictures: Array
    layout: Layout
    with_reference: bool
    letters: str
    answer: str | None
    facts: dict[str, Any]
    digest: str
    of_rooms: bool = False

    @cached_property
    def image(self) -> bytes:
        """All pictures and their letters as one PNG file in sRGB."""
        return png(composed(self.pictures, self.with_reference))

    @cached_property
    def images(self) -> tuple[bytes, ...]:
        """The reference, unless it is left out, and each answer as PNG files in sRGB."""
        return tuple(png(picture) for picture in self.pictures[0 if self.with_reference else 1 :])

    @property
    def sent(self) -> tuple[bytes, ...]:
        """The PNG files that a model is sent, as the layout wants it."""
        return (self.image,) if self.layout == "composed" else self.images

    @property
    def question(self) -> str:
        """The text, as the layout wants it."""
        return question_text(len(self.letters), self.layout, self.with_reference, self.of_rooms)

    def control(self) -> "Row":
        """Return the same row without its reference."""
        return replace(self, with_reference=False)

    def original(self, letter: int) -> int:
        """Return the answer of the file that a letter of this row shows, both from 0."""
        return (letter + self.rotation) % len(self.letters)


def count_rows(asked: Asked) -> int:
    """Return how many rows `vlm_rows` yields. Raises as it does."""
    with QuestionsFile(asked.path, asked.part) as questions:
        return len(_items(asked, questions)) * _rotations(asked, questions)


def vlm_rows(asked: Asked) -> Iterator[Row]:
    """Yield the rows of a file, question by question, each in `rotations` orders of its answers.

    Raises:
        OSError, FileFormatError: as `QuestionsFile`; a file that tells no cubes, as a released one
            or a test file without its answers, cannot be drawn anew.
        SpecError: a number out of range.
    """
    with _opened(asked) as questions:
        rotations, items = _rotations(asked, questions), _items(asked, questions)
        tell = asked.with_answers or questions.beside is None
        assert questions.spec is not None  # `_opened` refuses released files
        for start in range(0, len(items), AT_ONCE):
            chosen = items[start : start + AT_ONCE]
            truths = [truth for row in chosen if (truth := questions.truth(row)) is not None]
            drawn = _drawn(asked, questions, chosen, truths)
            for row, truth, pictures in zip(chosen, truths, drawn, strict=True):
                answer = int(questions.read("answers", row)) if tell else None
                for rotation in range(rotations):
                    yield _row(asked, questions, row, rotation, pictures, truth, answer)


def _drawn(
    asked: Asked,
    questions: QuestionsFile,
    rows: Sequence[int],
    truths: Sequence[QuestionTruth | RoomTruth],
) -> Iterator[Array]:
    """Yield the pictures of questions: of shapes drawn anew, of rooms those of the file."""
    if not isinstance(questions.spec, SplitSpec):
        check(SMALLEST <= asked.size <= LARGEST, "size", asked.size,
              f"from {SMALLEST} to {LARGEST} pixels")  # fmt: skip
        return (stored_pictures(questions[row], asked.size) for row in rows)
    shown = [stored_question(questions.spec, t) for t in truths if isinstance(t, QuestionTruth)]
    return draw_pictures(questions.spec, shown, asked.size, asked.device)


def _opened(asked: Asked) -> QuestionsFile:
    """Open a file with what it takes to draw its pictures: its own truth, or that of its answers.

    Raises as `vlm_rows`.
    """
    questions = QuestionsFile(asked.path, asked.part)
    if questions.spec is not None and not questions.has_answers:
        questions.close()
        path = asked.answers or answers_beside(asked.path)
        if path is None:
            hint = "give the answer key, which holds the cubes, with --answer-key"
            raise FileFormatError(asked.path, "images only", "cubes and poses to draw", hint)
        questions = QuestionsFile(asked.path, asked.part, path)
    if not questions.has_truth or not questions.has_answers:
        questions.close()
        raise FileFormatError(asked.path, "pictures alone", "cubes and poses to draw")
    return questions


def _items(asked: Asked, questions: QuestionsFile) -> Sequence[int]:
    rows = range(len(questions))
    if asked.items is None:
        return rows
    chosen = chosen_rows(list(asked.items), len(rows))
    return [chosen] if isinstance(chosen, int) else chosen


def _rotations(asked: Asked, questions: QuestionsFile) -> int:
    choices = (1, questions.answers)
    check(asked.rotations in choices, "rotations", asked.rotations, f"1 or {questions.answers}")
    return asked.rotations


def _facts(truth: QuestionTruth | RoomTruth, spec: QuestionSpec) -> dict[str, Any]:
    codes = [-1 if k is None else DISTRACTOR_KINDS.index(k) for k in truth.distractor_kind]
    kind = question_kind(codes)
    floor = floors_of(spec).get(kind)
    if isinstance(truth, RoomTruth):  # no two questions are about one room
        cubes, cluster = None, truth.scenes[0].to_json().encode()
    else:
        cubes, cluster = int(truth.cubes.shape[1]), truth.class_id[0]
    return {
        "kind": kind,
        "angle": round(truth.angle_degrees, 3),
        "cubes": cubes,
        "shape": hashlib.sha256(cluster).hexdigest()[:16],
        "floor": None if floor is None else floor.accuracy,
    }


def _row(
    asked: Asked,
    questions: QuestionsFile,
    index: int,
    rotation: int,
    pictures: Array,
    truth: QuestionTruth | RoomTruth,
    answer: int | None,
) -> Row:
    count = questions.answers
    assert questions.spec is not None  # `_opened` refuses released files
    facts = _facts(truth, questions.spec)
    order = [0, *(1 + (k + rotation) % count for k in range(count))]
    return Row(
        id=f"{index}-{rotation}",
        question_index=index,
        rotation=rotation,
        pictures=pictures[order],
        layout=asked.layout,
        with_reference=asked.with_reference,
        letters=LETTERS[:count],
        answer=None if answer is None else LETTERS[(answer - rotation) % count],
        facts=dict.fromkeys(facts) if answer is None else facts,
        digest=questions.fingerprint or "",
        of_rooms=isinstance(truth, RoomTruth),
    )

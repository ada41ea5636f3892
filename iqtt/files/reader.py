"""Read question files, ours and the released 3D-IQTT v2: records by row, map-style dataset.

A training file holds two tables of questions, "labeled" and "unlabeled"; other files one, at the
root, which is called "".
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Self, overload

import numpy as np
from numpy.typing import NDArray

from iqtt.files.layout import (
    FORMAT,
    SCORED,
    answer_column,
    known_kinds,
    named,
    question_columns,
    truth_columns,
)
from iqtt.files.truth import QuestionTruth, question_truth
from iqtt.perspective.columns import RoomTruth, developed, room_truth
from iqtt.perspective.specs import split_spec
from iqtt.questions.specs import QuestionSpec, SplitSpec
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.description.specs import IMAGE_DTYPES
from scenegen.files.attributes import read_digest, read_root, read_text
from scenegen.files.input_file import checking, describing
from scenegen.files.rows import RowDataset, RowFile, chosen_rows
from scenegen.files.sets.shards import OpenFile
from scenegen.layout import TRUTH_DIGEST
from scenegen.rendering.ground_truth import decode_image, undeveloped

Array = NDArray[Any]
PARTS = ("labeled", "unlabeled")
TOLERANCE = 0.01  # how far the images of released files may leave 0..1
RELEASED_ANSWERS = 3  # of a question


class NoImagesError(FileFormatError):
    """The file holds answers but no images; these are in another file."""


class NoAnswersError(FileFormatError):
    """The file holds questions but no answers; these are in another file."""


@dataclass(frozen=True, eq=False)
class QuestionRecord:
    """One question.

    Attributes:
        index: row of the question.
        images: the reference, then K options, (1 + K, H, W, 3), as stored.
        answer: index of the correct option, 0 to K - 1; None if the file has no answer key.
        truth: shapes, views and lights, or rooms; None if the file does not have them.
        is_developed: whether images are developed, not radiance.
    """

    index: int
    images: Array
    answer: int | None
    truth: QuestionTruth | RoomTruth | None
    is_developed: bool = False

    @property
    def radiance(self) -> Array:
        """Linear RGB radiance, (1 + K, H, W, 3) float32; of developed images, what they show."""
        return undeveloped(self.images) if self.is_developed else decode_image(self.images)


def open_questions(
    path: str | Path, part: str | None = None, answers: str | Path | None = None
) -> "QuestionsFile":
    """Open a question file for reading; raises as `QuestionsFile` does."""
    return QuestionsFile(path, part, answers)


def open_tables(path: str | Path) -> "list[QuestionsFile]":
    """Open a file once for all its tables: those of questions, or else of answers without images.

    Closing one table closes all. Raises as `QuestionsFile`.
    """
    opened = OpenFile(path, FORMAT.kind)
    kind = QuestionsFile
    with checking(opened.file):
        try:
            names = table_names(opened, kind.CONTENT)
        except NoImagesError:
            kind = AnswersFile
            names = table_names(opened, kind.CONTENT)
    return [kind(opened, name) for name in names]


def parts(path: str | Path) -> tuple[str, ...]:
    """Return the tables of a file: "labeled" and "unlabeled", or "" for one at the root.

    Raises OSError, FileFormatError as `QuestionsFile`.
    """
    with OpenFile(path, FORMAT.kind) as opened, checking(opened.file):
        return table_names(opened, QuestionsFile.CONTENT)


def holds_questions(opened: OpenFile) -> bool:
    """Return whether an open file holds questions or their answers, ours or released ones.

    Such a file can then be handed to `QuestionsFile`, and another one to `RoomsFile`.
    """
    with checking(opened.file):
        kind = read_text(opened.file, "format", opened.path)
        released = kind is None and any(name in opened.file for name in ("questions", *PARTS))
        return released or kind == FORMAT.name


def answers_beside(path: str | Path) -> Path | None:
    """Return the file of answers beside a test file, such as iqtt-test-answers.h5, if any."""
    path = Path(path)
    beside = path.with_name(f"{path.stem}-answers{path.suffix}")
    return beside if beside.is_file() else None


class QuestionsFile(RowFile):
    """An open question file: one of its tables, a sequence of `QuestionRecord`s.

    Attributes, besides those of `RowFile`:
        part: "labeled" or "unlabeled", or "" for the only table of a file.
        tables: the names of all tables of the file.
        spec: the settings of the file; the seed is included only in an answer key; None for a
            released file.
        split: "train", "val" or "test"; None for a released file.
        answers: number of options per question, 2 or 3.
        fingerprint: recipe hash: SHA-256 of settings, shapes, views and answer key of this table;
            None for a released file.
        height, width, image_dtype: image size in pixels, and "uint8", "float16" or "float32"; 0
            and "" for an answer key.
        beside: the file with the answer key, if it is separate.
    """

    CONTENT: ClassVar[str] = "questions"  # the column that every table has
    SCORED = SCORED

    def __init__(
        self,
        path: str | Path | OpenFile,
        part: str | None = None,
        answers: str | Path | None = None,
    ) -> None:
        """Open a question file, or take an open one, and check the layout of one of its tables.

        Args:
            path: a file of ours, or a released one.
            part: "labeled" or "unlabeled" of a training file.
            answers: a file such as iqtt-test-answers.h5, for a file without answers.

        Raises:
            OSError: no such file, or a folder.
            FileFormatError: not HDF5, not a question file, of another format, or damaged; or the
                answers belong to another file.
            SpecError: `part` is not given where there are two, or names none of them; or `answers`
                is given for a file that has its own.
        """
        self.spec: QuestionSpec | None = None
        self.fingerprint: str | None = None
        self.beside: QuestionsFile | None = None
        self.height, self.width, self.image_dtype = 0, 0, ""
        self._known_answers: Array | None = None
        self._part = part
        super().__init__(path if isinstance(path, OpenFile) else OpenFile(path, FORMAT.kind))
        if answers is not None:
            try:
                self.join(answers)
            except BaseException:
                self.close()
                raise

    @property
    def cube_spec(self) -> SplitSpec | None:
        """`spec` of questions about cubes. Raises SpecError for questions about rooms."""
        if self.spec is None or isinstance(self.spec, SplitSpec):
            return self.spec
        raise SpecError(str(self.path), "questions about rooms", "questions about shapes of cubes")

    def _open_columns(self) -> None:
        file = self.opened.file
        if "format" in file.attrs:
            self.attributes = read_root(file, self.path, FORMAT)
            with describing(f"{self.path}: attribute 'spec'"):
                self.spec = split_spec(self.attributes["spec"])
        self.split = self.attributes.get("split")
        self.answers = self.spec.answers if self.spec else RELEASED_ANSWERS
        self.tables = table_names(self.opened, self.CONTENT)
        self.part = self._chosen(self._part)
        self._count_rows(self._named(self.CONTENT))
        if self._named("questions") in file:
            self._take_images()
        if self._named("answers") in file:
            self._take_answers()
        if self.spec is not None:
            home = f"truth/{self.part}".rstrip("/")
            if home in file:
                self._take(home, truth_columns(self.spec, known_kinds(file[home])))
            mark, digest = (named(name, self.part) for name in ("fingerprint", TRUTH_DIGEST))
            self.fingerprint = read_text(file, mark, self.path, needed=True)
            self.stored_truth_digest = read_digest(file, digest, self.path, self.has_answers)

    def _named(self, name: str) -> str:
        """Return the name of a data set of this table in its file."""
        return f"{self.part}/{name}".lstrip("/")

    def _chosen(self, part: str | None) -> str:
        if part is None and len(self.tables) == 1:
            return self.tables[0]
        if part is None or part not in self.tables:
            expected = " or ".join(self.tables) or "none, because the file has one table only"
            raise SpecError(f"{self.path}: part", part or "none", expected)
        return part

    def _take_images(self) -> None:
        if self.spec is not None:
            self._take(self.part, question_columns(self.spec))
        else:
            self._take_released_images()
        images = self._stored["questions"]
        self.height, self.width = images.shape[2:4]
        self.image_dtype = str(images.dtype.name)

    def _take_released_images(self) -> None:
        """Take images of any size; floating-point ones have radiance from 0 to 1."""
        images = self._stored["questions"] = self.opened.array(self._named("questions"))
        shape, kind = images.shape, str(images.dtype.name)
        place, answers = f"{self.path}: questions", 1 + RELEASED_ANSWERS
        if len(shape) != 5 or (shape[1], shape[4]) != (answers, 3) or min(shape[2:4]) == 0:
            raise FileFormatError(place, f"shape {shape}", f"(Q, {answers}, H, W, 3)")
        if kind not in IMAGE_DTYPES:
            raise FileFormatError(place, f"type {kind}", " or ".join(IMAGE_DTYPES))
        if kind != "uint8" and len(self):
            first = self.read("questions", 0)
            low, high = first.min(), first.max()
            if not (low >= -TOLERANCE and high <= 1 + TOLERANCE):  # so NaN is refused too
                found = f"values from {low:g} to {high:g}"
                raise FileFormatError(self.place("questions", 0), found, "0 to 1")

    def _take_answers(self) -> None:
        """Read all answers, of any type of integers, and check them."""
        stored = self._stored["answers"] = self.opened.array(self._named("answers"))
        if stored.shape not in ((len(self),), (len(self), 1)) or stored.dtype.kind not in "iu":
            found = f"shape {stored.shape}, type {stored.dtype}"
            expected = f"shape ({len(self)},), whole numbers"
            raise FileFormatError(f"{self.path}: answers", found, expected)
        answers = stored[()].reshape(-1)
        wrong = np.flatnonzero((answers < 0) | (answers >= self.answers))
        if len(wrong):
            place, expected = self.place("answers", int(wrong[0])), f"0 to {self.answers - 1}"
            raise FileFormatError(place, answers[wrong[0]], expected)
        self._known_answers = answers.astype(np.uint8)
        if self.spec is not None:
            self._schema["answers"] = self.opened.file[self.part or "/"], answer_column()

    def join(self, answers: "str | Path | QuestionsFile") -> None:
        """Add answer key and ground truth of another file, which is closed with this one.

        Raises SpecError where this file has its own, and FileFormatError where they belong to the
        questions of another one.
        """
        place = answers.path if isinstance(answers, QuestionsFile) else answers
        if self.has_answers:
            raise SpecError("answers", place, f"none, as {self.path} has its own")
        if not isinstance(answers, QuestionsFile):
            answers = AnswersFile(answers, self.part)
        self.beside = beside = answers
        if (len(beside), beside.fingerprint) != (len(self), self.fingerprint):
            expected = f"{_identity(self)}, as in {self.path}"
            raise FileFormatError(f"{place}: answers", _identity(beside), expected)
        self._stored |= beside._stored
        self._schema |= beside._schema
        self._known_answers = beside._known_answers
        self.stored_truth_digest = beside.stored_truth_digest

    @property
    def has_images(self) -> bool:
        """Whether the file has images; an answer key may have none."""
        return "questions" in self._stored

    @property
    def has_answers(self) -> bool:
        """Whether the file has the answer key."""
        return self._known_answers is not None

    @property
    def has_truth(self) -> bool:
        """Whether the file has shapes, views and lights, or rooms."""
        return "distractor_kind" in self._stored

    def table(self, part: str) -> Self:
        """Return another table of the same open file; raises as when one is opened."""
        return type(self)(self.opened, part)

    @overload
    def __getitem__(self, index: int) -> QuestionRecord: ...
    @overload
    def __getitem__(self, index: slice | Sequence[int] | Array) -> list[QuestionRecord]: ...
    def __getitem__(self, index: Any) -> QuestionRecord | list[QuestionRecord]:
        """Read a row, or several by a slice or a list; negative numbers count from the end.

        Raises as `rows.chosen_rows`, and FileFormatError.
        """
        rows = chosen_rows(index, len(self))
        if isinstance(rows, int):
            return self._record(rows)
        return [self._record(row) for row in rows]

    def _record(self, row: int) -> QuestionRecord:
        return QuestionRecord(
            index=row,
            images=self.read("questions", row),
            answer=int(self.read("answers", row)) if self.has_answers else None,
            truth=self.truth(row),
            is_developed=bool(developed(self.spec)),
        )

    def __iter__(self) -> Iterator[QuestionRecord]:
        return (self[i] for i in range(len(self)))

    def read(self, name: str, rows: int | slice) -> Any:
        """Read rows of one column, such as "questions", "answers" or "cubes", as `RowFile.read`.

        Answers are returned as uint8, for any integer type of the file.
        """
        if name == "answers" and self._known_answers is not None:
            return self._known_answers[rows]
        return super().read(name, rows)

    def truth(self, row: int) -> QuestionTruth | RoomTruth | None:
        """Return the ground truth of a question, apart from the correct option; or None.

        Raises as `read`.
        """
        if not self.has_truth:
            return None
        names = (name for name in self.fields if name not in ("questions", "answers"))
        values = {name: self.read(name, row) for name in names}
        if isinstance(self.spec, SplitSpec):
            return question_truth(values, self.spec)
        with describing(self.place("scene", row)):
            return room_truth(values)

    def reopener(self) -> "Callable[[], QuestionsFile]":
        """Return a function, which can be pickled, that opens the same table again."""
        answers = None if self.beside is None else self.beside.path.absolute()
        return partial(type(self), self.path.absolute(), self.part, answers)

    def close(self) -> None:
        """Close the file, and the file of its answers; idempotent."""
        super().close()
        if self.beside is not None:
            self.beside.close()


class AnswersFile(QuestionsFile):
    """An open file with answers and what is known of the questions; it may lack the images."""

    CONTENT = "answers"


class QuestionsDataset(RowDataset):
    """The questions of a table as dicts of arrays, for any training loop; see `RowDataset`."""

    def __init__(
        self,
        questions: str | Path | QuestionsFile,
        part: str | None = None,
        fields: Sequence[str] | None = None,
        answers: str | Path | None = None,
    ) -> None:
        """Check the file once, or take one that is open, with its part and answers.

        Args:
            questions, part, answers: as for `QuestionsFile`.
            fields: what an item has: "questions", "answers", or a dataset of the truth such as
                "cubes"; by default the questions, and the answers if there are any.

        Raises as `QuestionsFile`, and SpecError for an unknown field.
        """
        if isinstance(questions, QuestionsFile):
            opened: AbstractContextManager[QuestionsFile] = nullcontext(questions)
        else:
            opened = QuestionsFile(questions, part, answers)
        with opened as file:
            default = ("questions", "answers") if file.has_answers else ("questions",)
            super().__init__(file, default if fields is None else fields)
            self.spec, self.fingerprint = file.spec, file.fingerprint


def table_names(opened: OpenFile, content: str) -> tuple[str, ...]:
    """Return the tables of a file that hold a column; ("",) if it is at the root.

    Raises FileFormatError where there is none; its hint says what to open instead.
    """
    file, path = opened.file, opened.path
    names = tuple(part for part in PARTS if f"{part}/{content}" in file)
    if names or content in file:
        return names or ("",)
    if content == "questions" and any(name in file for name in ("answers", "labeled/answers")):
        images = path.name.replace("-answers", "")
        what = images if images != path.name else "the file of questions"
        hint = f"open {what} instead, with this file as the answer key"
        raise NoImagesError(path, "this is an answer key without images", hint=hint)
    if content == "answers" and "questions" in file:
        hint = "ask the creators of the questions for the answer key"
        raise NoAnswersError(path, "this file has no answer key, nor has its folder", hint=hint)
    expected = f"a dataset {content!r}, 'labeled/{content}' or 'unlabeled/{content}'"
    raise FileFormatError(path, "a file without questions", expected)


def _identity(file: QuestionsFile) -> str:
    mark = f"recipe hash {file.fingerprint[:12]}" if file.fingerprint else "no recipe hash"
    return f"{len(file)} questions, {mark}"

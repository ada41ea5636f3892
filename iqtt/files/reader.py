"""Read question files, ours and the released 3D-IQTT v2: records by row, map-style dataset."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from iqtt.files.attributes import read_root
from iqtt.files.layout import question_columns
from iqtt.files.tables import TableFile, table_parts
from iqtt.files.truth import QuestionTruth
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.description.specs import IMAGE_DTYPES
from scenegen.files import trial
from scenegen.files.input_file import checking
from scenegen.files.row_file import RowDataset
from scenegen.files.shards import opened_with_shards
from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
TOLERANCE = 0.01  # how far the images of released files may leave 0..1


@dataclass(frozen=True, eq=False)
class QuestionRecord:
    """One question.

    Attributes:
        index: row of the question.
        images: the reference, then K answers, (1 + K, H, W, 3), as stored.
        answer: which of these shows the reference's shape, 0 to K - 1; None if the file does not
            tell.
        truth: shapes, views and lights; None if the file does not tell them.
    """

    index: int
    images: Array
    answer: int | None
    truth: QuestionTruth | None

    @property
    def radiance(self) -> Array:
        """Linear RGB radiance, (1 + K, H, W, 3) float32."""
        return decode_image(self.images)


def open_questions(
    path: str | Path, part: str | None = None, answers: str | Path | None = None
) -> "QuestionsFile":
    """Open a question file for reading; raises as `QuestionsFile` does."""
    return QuestionsFile(path, part, answers)


def parts(path: str | Path) -> tuple[str, ...]:
    """Return the tables of a file: "labeled" and "unlabeled", or "" for one at the root.

    Raises OSError, FileFormatError as `QuestionsFile`.
    """
    with opened_with_shards(Path(path), "question file") as (file, _), checking(file):
        read_root(file, Path(path))
        return table_parts(file, Path(path), QuestionsFile.CONTENT)


def answers_beside(path: str | Path) -> Path | None:
    """Return the file of answers beside a test file, such as iqtt-test-answers.h5, if any.

    Raises FileFormatError as `trial.try_file`: nobody named this file.
    """
    path = Path(path)
    beside = path.with_name(f"{path.stem}-answers{path.suffix}")
    if not beside.is_file():
        return None
    trial.try_file(beside)
    return beside


class AnswersFile(TableFile):
    """An open file with answers and what is known of the questions; it may lack the images."""

    CONTENT = "answers"

    def _open_content(self) -> int:
        return self._take_answers()


class QuestionsFile(TableFile):
    """An open question file: a sequence of `QuestionRecord`s.

    Attributes:
        height, width: size of an image, pixels.
        image_dtype: "uint8", "float16" or "float32".
        beside: the file with the answers, if it is another one.
    """

    CONTENT = "questions"

    def __init__(
        self, path: str | Path, part: str | None = None, answers: str | Path | None = None
    ) -> None:
        """Open a question file and check the layout of one of its tables.

        Args:
            path: a file of ours, or a released one.
            part: "labeled" or "unlabeled" of a training file.
            answers: a file such as iqtt-test-answers.h5, for a file without answers.

        Raises:
            OSError: no such file, or a folder.
            FileFormatError: not HDF5, not a question file, of a newer format, or damaged; or the
                answers belong to another file.
            SpecError: `part` is not given where there are two, or names none of them; or `answers`
                is given for a file that has its own.
        """
        super().__init__(path, part)
        self.beside: AnswersFile | None = None
        if answers is not None:
            try:
                self._join(answers)
            except BaseException:
                self.close()
                raise

    def __getitem__(self, index: int) -> QuestionRecord:
        """Read one row; negative indices count from the end. Raises IndexError, FileFormatError."""
        row = range(len(self))[index]
        return QuestionRecord(
            index=row,
            images=self.read("questions", row),
            answer=int(self.read("answers", row)) if self.has_answers else None,
            truth=self.truth(row),
        )

    def __iter__(self) -> Iterator[QuestionRecord]:
        return (self[i] for i in range(len(self)))

    def close(self) -> None:
        """Close the file, and the file of its answers; idempotent."""
        super().close()
        if self.beside is not None:
            self.beside.close()

    def _open_content(self) -> int:
        images = self._datasets["questions"] = self._dataset("questions")
        shape: tuple[int, ...] = images.shape or ()
        kind = str(images.dtype.name)
        kinds: tuple[str, ...] = IMAGE_DTYPES
        expected = "(Q, 4, H, W, 3)"
        good = len(shape) == 5 and shape[1] == 4 and shape[4] == 3 and min(shape[2:4]) > 0
        if self.spec is not None:
            (column,) = question_columns(self.spec)
            expected, kinds = f"(Q, {', '.join(map(str, column.shape))})", (column.dtype,)
            good = shape[1:] == column.shape
        if not good:
            raise FileFormatError(f"{self.path}: questions", f"shape {shape}", expected)
        if kind not in kinds:
            raise FileFormatError(f"{self.path}: questions", f"type {kind}", " or ".join(kinds))
        self.height, self.width = shape[2:4]
        self.image_dtype = kind
        if self.spec is None and kind != "uint8" and shape[0]:
            self._check_range()
        if f"{self.part}/answers" in self._file:
            self._take_answers(shape[0])
        return shape[0]

    def _check_range(self) -> None:
        """Refuse floating-point images with values from 0 to 255; the first row is looked at."""
        first = self.read("questions", 0)
        low, high = first.min(), first.max()
        if not (low >= -TOLERANCE and high <= 1 + TOLERANCE):  # so NaN is refused too
            raise FileFormatError(
                self.place("questions", 0), f"values from {low:g} to {high:g}", "0 to 1"
            )

    def _join(self, answers: str | Path) -> None:
        """Add answers and truth of another file, if they belong to the questions of this one."""
        if self.has_answers:
            raise SpecError("answers", answers, f"none, as {self.path} has its own")
        self.beside = beside = AnswersFile(answers, self.part)
        if (len(beside), beside.fingerprint) != (len(self), self.fingerprint):
            expected = f"{_identity(self)}, as in {self.path}"
            raise FileFormatError(f"{answers}: answers", _identity(beside), expected)
        self._datasets |= beside._datasets
        self._stored |= beside._stored
        self._ranges, self.kind_names = beside._ranges, beside.kind_names
        self.stored_truth_digest = beside.stored_truth_digest


class QuestionsDataset(RowDataset):
    """The questions of a table as dicts of arrays, for any training loop; see `RowDataset`."""

    def __init__(
        self,
        path: str | Path,
        part: str | None = None,
        fields: Sequence[str] | None = None,
        answers: str | Path | None = None,
    ) -> None:
        """Check the file once.

        Args:
            path, part, answers: as for `QuestionsFile`.
            fields: what an item has: "questions", "answers", or a dataset of the truth such as
                "cubes"; by default the questions, and the answers if there are any.

        Raises as `QuestionsFile`, and SpecError for an unknown field.
        """
        opener = partial(QuestionsFile, Path(path), part, answers)
        with opener() as file:
            default = ("questions", "answers") if file.has_answers else ("questions",)
            super().__init__(opener, len(file), default if fields is None else fields)
            for name in self.fields:
                file.check_field(name)
            self.spec, self.fingerprint = file.spec, file.fingerprint


def _identity(file: TableFile) -> str:
    mark = f"fingerprint {file.fingerprint[:12]}" if file.fingerprint else "no fingerprint"
    return f"{len(file)} questions, {mark}"

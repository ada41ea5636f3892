"""What a study asks: the questions of a split with their right answers, kinds and images."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Self

import numpy as np

from iqtt.files.reader import NoAnswersError, QuestionsFile, answers_beside
from iqtt.questions.specs import question_kind
from iqtt.quiz.draw import Cell, cells_of, draw_rows
from iqtt.quiz.pictures import KeptPictures, png
from scenegen.common.errors import SpecError
from scenegen.common.records import check

QUESTIONS, CALIBRATIONS = 20, 2  # of each participant; the paper asked one calibration question
MOST_QUESTIONS = 1000
HASHED = 100  # questions of a released file, that tell it from others with its answers
UNTOLD = "not told"  # the kind of questions whose file does not tell it
FROM_TEST, FROM_VALIDATION = "test", "val"


@dataclass(frozen=True)
class Settings:
    """What the participants of a study have in common; an answers file keeps it.

    Attributes:
        fingerprint, calibration_fingerprint: of the questions that are asked, and of those of the
            calibration: that of the file, or SHA-256 of answers and images of a released file.
        answers: how many answers a question offers, 2 or 3.
        questions, calibrations: how many each participant is asked.
        seed: of the draws.
    """

    fingerprint: str
    calibration_fingerprint: str
    answers: int
    questions: int = QUESTIONS
    calibrations: int = CALIBRATIONS
    seed: int = 0

    def __post_init__(self) -> None:
        most, low = MOST_QUESTIONS, f"from 1 to {MOST_QUESTIONS}"
        check(1 <= self.questions <= most, "questions", self.questions, low)
        check(0 <= self.calibrations <= most, "calibration", self.calibrations, f"0 to {most}")
        check(0 <= self.seed < 2**63, "seed", self.seed, "from 0 to 2**63 - 1")


@dataclass(frozen=True)
class Question:
    """A question of somebody's quiz.

    Attributes:
        calibration: whether the right answer is told afterwards; it does not count then.
        row: of its file.
        kind: as `question_kind` names it, or UNTOLD.
        angle_degrees: from the reference's view to the right answer's; None where it is not told.
        right: place of the right answer, from 0.
        shape: a name of the reference's shape, the same for mirror images; empty where not told.
    """

    calibration: bool
    row: int
    kind: str
    angle_degrees: float | None
    right: int
    shape: str


class Pool:
    """An open table of questions whose right answers are known."""

    def __init__(self, path: str | Path, part: str | None = None) -> None:
        """Open a file, and the file of answers beside it where it has none of its own.

        Raises OSError, FileFormatError and SpecError as `QuestionsFile`, and NoAnswersError.
        """
        self.file = QuestionsFile(path, part)
        try:
            if not self.file.has_answers:
                self.file.close()
                beside = answers_beside(path)
                if beside is None:
                    name = Path(path)
                    expected = f"{name.stem}-answers{name.suffix} beside it"
                    raise NoAnswersError(path, "questions but no answers", expected)
                self.file = QuestionsFile(path, part, beside)
            self._read_labels()
        except BaseException:
            self.file.close()
            raise
        self._lock = Lock()
        self._pictures = KeptPictures()

    def _read_labels(self) -> None:
        file, every = self.file, slice(None)
        self.right: list[int] = file.read("answers", every).tolist()
        self.kinds, self.shapes = [UNTOLD] * len(file), [""] * len(file)
        self.angles: Sequence[float | None] = [None] * len(file)
        self.fingerprint = file.fingerprint or ""
        if file.has_truth:
            self.kinds = [
                question_kind(row) for row in file.read("distractor_kind", every).tolist()
            ]
            self.angles = [round(a, 6) for a in file.read("angle_degrees", every).tolist()]
            references = np.asarray(file.read("class_id", every))[:, 0]
            self.shapes = [hashlib.sha256(row.tobytes()).hexdigest()[:12] for row in references]
        if not self.fingerprint:
            content = hashlib.sha256(bytes(self.right))
            for row in range(0, len(file), max(1, len(file) // HASHED)):
                content.update(np.ascontiguousarray(file.read("questions", row)).tobytes())
            self.fingerprint = content.hexdigest()

    def question(self, row: int, calibration: bool) -> Question:
        """Return what is known of a row."""
        at = row
        return Question(
            calibration, row, self.kinds[at], self.angles[at], self.right[at], self.shapes[at]
        )

    def kept_images(self, row: int) -> Sequence[bytes] | None:
        """Return the images of a row if they are at hand."""
        return self._pictures.get(row)

    def images(self, row: int) -> Sequence[bytes]:
        """Return the reference and the answers of a row as PNG files; for any number of threads.

        Raises FileFormatError where the row is damaged.
        """
        found = self.kept_images(row)
        if found is None:
            with self._lock:
                record = self.file[row]
            found = [png(image) for image in record.radiance]
            self._pictures.put(row, found)
        return found


class Study:
    """The questions of a study, from which each participant's are drawn; a context manager.

    Those of the calibration come from the validation file beside a test file, where there is one:
    shapes of a test set are in no validation set. Otherwise a few rows of the file are kept for it,
    which nobody is asked later. So feedback tells no answer of a question that counts.
    """

    def __init__(
        self,
        path: str | Path,
        part: str | None = None,
        questions: int = QUESTIONS,
        calibrations: int = CALIBRATIONS,
        seed: int = 0,
    ) -> None:
        """Open the files. Raises as `Pool`, and SpecError where there are too few questions."""
        self.path = Path(path)
        self.pool = self.calibration = Pool(path, part)
        try:
            beside = self._validation(Path(path), calibrations)
            if beside is not None:
                self.calibration = Pool(beside)
            self._share(questions, calibrations, seed)
        except BaseException:
            self.close()
            raise

    def _share(self, questions: int, calibrations: int, seed: int) -> None:
        """Say which rows are asked, and which are for the calibration."""
        pool, kept = self.pool, self.calibration
        self.settings = Settings(
            pool.fingerprint, kept.fingerprint, pool.file.answers, questions, calibrations, seed
        )
        other: Sequence[int] = range(len(kept.file))
        rows: Sequence[int] = range(len(pool.file))
        needed = questions + (calibrations if kept is pool else 0)
        if len(rows) < needed:
            raise SpecError(f"{self.path}: questions", len(rows), f"at least {needed}")
        if kept is pool:
            everything = cells_of(pool.kinds, pool.right, rows)
            other = draw_rows(everything, calibrations, seed, 0, attempt=1)
            rows = sorted(set(rows) - set(other))
        self._cells, self._calibration_cells = (
            _cells(p, r) for p, r in ((pool, rows), (kept, other))
        )

    def draw(self, participant: int) -> list[Question]:
        """Return a participant's questions in their order, those of the calibration first."""
        settings, first = self.settings, self.calibration
        told = draw_rows(
            self._calibration_cells, settings.calibrations, settings.seed, participant, attempt=2
        )
        asked = draw_rows(self._cells, settings.questions, settings.seed, participant)
        return [
            *(first.question(row, calibration=True) for row in told),
            *(self.pool.question(row, calibration=False) for row in asked),
        ]

    def images(self, row: int, calibration: bool) -> Sequence[bytes]:
        """Return the images of a question, as `Pool.images`."""
        return (self.calibration if calibration else self.pool).images(row)

    def kept_images(self, row: int, calibration: bool) -> Sequence[bytes] | None:
        """Return as `images`, at once; None where the file would have to be read."""
        return (self.calibration if calibration else self.pool).kept_images(row)

    def close(self) -> None:
        """Close the files; idempotent."""
        for pool in (self.pool, self.calibration):
            pool.file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _validation(self, path: Path, calibrations: int) -> Path | None:
        """Return the validation file of the same split beside a test file, if it has enough."""
        beside = path.with_name(path.name.replace(FROM_TEST, FROM_VALIDATION))
        spec = self.pool.file.spec
        if beside == path or not beside.is_file() or spec is None:
            return None
        with QuestionsFile(beside) as file:
            same = file.spec is not None and file.spec.public() == spec.public()
            enough = file.has_answers and len(file) >= calibrations > 0
            return beside if same and enough else None


def _cells(pool: Pool, rows: Sequence[int]) -> dict[Cell, list[int]]:
    return cells_of([pool.kinds[r] for r in rows], [pool.right[r] for r in rows], rows)

"""What a study asks: the questions of a split with their right answers, kinds and images."""

import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iqtt.files.reader import NoAnswersError, QuestionsFile, answers_beside
from iqtt.questions.specs import question_kind
from iqtt.quiz.draw import Cell, cells_of, draw_rows
from scenegen.common.errors import SpecError
from scenegen.common.recent import Recent
from scenegen.common.records import check
from scenegen.rooms.preview import srgb_bytes

QUESTIONS, CALIBRATIONS = 20, 2  # of each participant; the paper asked one calibration question
MOST_QUESTIONS = 1000
HASHED = 100  # questions of a released file, that tell it from others with its answers
UNTOLD = "not told"  # the kind of questions whose file does not tell it
LARGEST = 512  # pixels of a side; larger images are made smaller by a whole factor
KEPT_BYTES = 256 * 2**20  # of encoded images


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
    """An open table of questions whose right answers are known; a context manager.

    Attributes:
        file: the table; with the file of answers beside it, if it has none of its own.
        right, kinds, angles, shapes: of each row, as in `Question`.
        fingerprint: as in `Settings`.
    """

    def __init__(self, path: str | Path, part: str | None = None) -> None:
        """Open a file, with the file of answers beside it where it has none of its own.

        Raises OSError, FileFormatError and SpecError as `QuestionsFile`, and NoAnswersError.
        """
        self.file = QuestionsFile(path, part)
        try:
            if not self.file.has_answers:
                self.file.close()
                beside = answers_beside(path)
                if beside is None:
                    expected = f"{Path(path).stem}-answers{Path(path).suffix} beside it"
                    raise NoAnswersError(path, "questions but no answers", expected)
                self.file = QuestionsFile(path, part, beside)
            self._read_labels()
        except BaseException:
            self.file.close()
            raise
        self._lock = Lock()
        self._pictures: Recent[Sequence[bytes]] = Recent(KEPT_BYTES)

    def _read_labels(self) -> None:
        file, every = self.file, slice(None)
        self.right: list[int] = file.read("answers", every).tolist()
        self.kinds, self.shapes = [UNTOLD] * len(file), [""] * len(file)
        self.angles: Sequence[float | None] = [None] * len(file)
        self.fingerprint = file.fingerprint or ""
        if file.has_truth:
            kinds = file.read("distractor_kind", every).tolist()
            self.kinds = [question_kind(row) for row in kinds]
            self.angles = [round(a, 6) for a in file.read("angle_degrees", every).tolist()]
            references = np.asarray(file.read("class_id", every))[:, 0]
            self.shapes = [hashlib.sha256(row.tobytes()).hexdigest()[:12] for row in references]
        if not self.fingerprint:
            content = hashlib.sha256(bytes(self.right))
            for row in range(0, len(file), max(1, len(file) // HASHED)):
                content.update(np.ascontiguousarray(file.read("questions", row)).tobytes())
            self.fingerprint = content.hexdigest()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.file.close()

    def require_asked(self, path: Path, settings: Settings) -> None:
        """Raise SpecError unless the answers at a path are to these questions."""
        if self.fingerprint != settings.fingerprint:
            found = f"answers to the split of fingerprint {settings.fingerprint:.12}"
            raise SpecError(path, found, f"{self.fingerprint:.12}, that of {self.file.path}")

    def question(self, row: int, calibration: bool) -> Question:
        """Return what is known of a row."""
        kind, angle, shape = self.kinds[row], self.angles[row], self.shapes[row]
        return Question(calibration, row, kind, angle, self.right[row], shape)

    def cells(self, rows: Sequence[int]) -> dict[Cell, list[int]]:
        """Return these rows by the cells that draws are balanced over."""
        return cells_of([self.kinds[r] for r in rows], [self.right[r] for r in rows], rows)

    def kept_images(self, row: int) -> Sequence[bytes] | None:
        """Return as `images`, at once; None where the file would have to be read."""
        return self._pictures.get(row)

    def images(self, row: int) -> Sequence[bytes]:
        """Return the reference and the answers of a row as PNG files; for any number of threads.

        Raises FileFormatError where the row is damaged.
        """
        images = self.kept_images(row)
        if images is None:
            with self._lock:
                record = self.file[row]
            images = [png(image) for image in record.radiance]
            self._pictures.put(row, images, sum(map(len, images)))
        return images


def png(radiance: NDArray[Any]) -> bytes:
    """Return linear radiance, (H, W, 3), as a PNG file in sRGB; what is not finite is black."""
    picture = Image.fromarray(srgb_bytes(np.nan_to_num(radiance)))
    factor = -(-max(picture.size) // LARGEST)
    out = io.BytesIO()
    (picture if factor == 1 else picture.reduce(factor)).save(out, "PNG", compress_level=6)
    return out.getvalue()


class Study:
    """The questions of a study, from which each participant's are drawn; a context manager.

    Those of the calibration come from the validation file beside a test file, where there is one:
    shapes of a test set are in no validation set. Otherwise a few rows of the file are kept for it,
    which nobody is asked later. So feedback tells no answer of a question that counts.

    Attributes:
        pool, calibration: the tables of questions that count, and of those of the calibration,
            which may be the same.
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
        self.pool = self.calibration = Pool(path, part)
        try:
            beside = self._validation(Path(path), calibrations)
            if beside is not None:
                self.calibration = Pool(beside)
            marks = self.pool.fingerprint, self.calibration.fingerprint
            count = self.pool.file.answers
            self.settings = Settings(*marks, count, questions, calibrations, seed)
            self._share_rows(Path(path))
        except BaseException:
            self.close()
            raise

    def _share_rows(self, path: Path) -> None:
        """Divide the rows into those that count and those for the calibration."""
        pool, settings = self.pool, self.settings
        shared = self.calibration is pool
        rows: Sequence[int] = range(len(pool.file))
        practice: Sequence[int] = range(len(self.calibration.file))
        needed = settings.questions + (settings.calibrations if shared else 0)
        check(len(rows) >= needed, f"{path}: questions", len(rows), f"at least {needed}")
        if shared:
            every = pool.cells(rows)
            practice = draw_rows(every, settings.calibrations, settings.seed, 0, attempt=1)
            rows = sorted(set(rows) - set(practice))
        self._cells = pool.cells(rows)
        self._calibration_cells = self.calibration.cells(practice)

    def draw(self, participant: int) -> list[Question]:
        """Return a participant's questions in their order, those of the calibration first."""
        settings, cells = self.settings, self._calibration_cells
        first = draw_rows(cells, settings.calibrations, settings.seed, participant, attempt=2)
        rows = draw_rows(self._cells, settings.questions, settings.seed, participant)
        return [
            *(self.calibration.question(row, calibration=True) for row in first),
            *(self.pool.question(row, calibration=False) for row in rows),
        ]

    def pool_of(self, question: Question) -> Pool:
        """Return the table that a question is in."""
        return self.calibration if question.calibration else self.pool

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
        beside = path.with_name(path.name.replace("test", "val"))
        spec = self.pool.file.spec
        if beside == path or not beside.is_file() or spec is None:
            return None
        with QuestionsFile(beside) as file:
            same = file.spec is not None and file.spec.public() == spec.public()
            enough = file.has_answers and len(file) >= calibrations > 0
            return beside if same and enough else None
